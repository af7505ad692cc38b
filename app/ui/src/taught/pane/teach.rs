//! Teaching the present pose of the arm, and poses from elsewhere.

use egui::{Button, Id, Key, TextEdit, Ui, WidgetInfo, WidgetType};

use crate::style::parts;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Dialog, Model};
use handeye_workbench::tr;
use handeye_workbench::{shell, taught};

/// The two rows.
pub fn teach_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let id = Id::new("name of the pose to teach");
    let mut name: String = parts::remembered(ui, id);
    let taken = model.taught().iter().any(|pose| pose.name == name.trim());
    let reason = if model.robot.is_none() || !model.control.is_connected() {
        Some(tr!(language, "Not connected: the position of the arm is not known"))
    } else if taken {
        Some(tr!(language, "There is a pose of that name already"))
    } else {
        None
    };
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut name)
            .desired_width((ui.available_width() - 150.0).clamp(80.0, 200.0))
            .char_limit(60)
            .hint_text(tr!(language, "Name, or none"));
        let response = ui.add(field);
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, tr!(language, "Name of the new pose")));
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        let clicked = parts::gated_ui(ui, reason, Button::new(tr!(language, "Teach here"))).clicked();
        if (clicked || entered) && reason.is_none() {
            let trimmed = name.trim();
            outbox.send(taught::Command::Teach { name: (!trimmed.is_empty()).then(|| trimmed.to_owned()) });
            name.clear();
        }
    });
    if let Some(reason) = reason.filter(|_| taken) {
        parts::hint_ui(ui, reason);
    }
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().button_padding.x = 7.0;
        let reason = model.cell.is_none().then(|| tr!(language, "Not connected: taught poses belong to an arm"));
        let import = parts::gated_ui(ui, reason, Button::new(tr!(language, "Import…")));
        if import.on_hover_text(tr!(language, "Add poses from a file")).clicked() {
            outbox.send(shell::Command::SetDialog(Some(Dialog::ImportPoses)));
        }
        let is_empty = model.taught().is_empty();
        if ui.add_enabled(!is_empty, Button::new(tr!(language, "Export…"))).clicked() {
            outbox.send(shell::Command::SetDialog(Some(Dialog::ExportPoses)));
        }
        let what = tr!(language, "Ten poses around the board, instead of those in the list. Undo brings them back");
        let reason = if model.has_reference_poses() {
            model.sequence_runs.then(|| tr!(language, "A sequence is under way"))
        } else {
            Some(tr!(
                language,
                "The reference poses are those of CoppeliaSim's UR5: another arm would go somewhere else"
            ))
        };
        let button = Button::new(tr!(language, "Reference poses"));
        if parts::gated_ui(ui, reason, button).on_hover_text(what).clicked() {
            outbox.send(taught::Command::TeachReference);
        }
    });
    parts::remember(ui, id, name);
}
