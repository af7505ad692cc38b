//! Names of frames and files, and what the transform in the files means under these names.

use egui::{Grid, Id, Label, RichText, TextEdit, Ui};
use handeye_estimate::handeye::Mode;
use handeye_export::ExportNames;

use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::export;
use handeye_workbench::model::Model;
use handeye_workbench::text::Text;
use handeye_workbench::tr;

/// Names that are being edited.
#[derive(Debug, Clone, Default)]
struct Draft {
    /// What they were when editing began; `None` when nothing is edited.
    from: Option<ExportNames>,
    names: ExportNames,
}

/// The form.
pub fn names_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::section_ui(ui, tr!(language, "Names"));
    let id = Id::new("names of the export");
    let mut draft: Draft = parts::remembered(ui, id);
    // A change from elsewhere in the meantime, as by undo, overrides an unfinished edit.
    if draft.from.as_ref() != Some(&model.export.names) {
        draft = Draft { from: None, names: model.export.names.clone() };
    }
    let mut is_left = false;
    Grid::new("export names").num_columns(2).spacing([10.0, 4.0]).show(ui, |ui| {
        let names = &mut draft.names;
        for (caption, what, value) in [
            (tr!(language, "Robot base"), tr!(language, "Frame of the robot's base"), &mut names.base_frame),
            (tr!(language, "Robot tip"), tr!(language, "Frame of the robot's tip"), &mut names.effector_frame),
            (
                tr!(language, "Camera frame"),
                tr!(language, "Frame of the camera in optical axes: x right, y down, z forward"),
                &mut names.camera_frame,
            ),
            (tr!(language, "Board frame"), tr!(language, "Frame of the board"), &mut names.target_frame),
            (tr!(language, "Camera name"), tr!(language, "Name of the camera in ROS"), &mut names.camera_name),
            (
                tr!(language, "Calibration"),
                tr!(language, "Name of the calibration, and of its files"),
                &mut names.calibration,
            ),
        ] {
            let weak = Palette::of(ui).weak;
            let label = ui.label(RichText::new(caption).color(weak)).on_hover_text(what);
            let field = TextEdit::singleline(value).desired_width(f32::INFINITY).char_limit(80);
            let response = ui.add(field).labelled_by(label.id).on_hover_text(what);
            if response.changed() {
                draft.from = Some(model.export.names.clone());
            }
            is_left |= response.lost_focus() && draft.from.is_some();
            ui.end_row();
        }
    });
    match draft.names.check() {
        Err(error) => parts::notice_ui(ui, Tone::Bad, &Text::from(error).in_language(language), |_| ()),
        Ok(()) if is_left && draft.names != model.export.names => {
            outbox.send(export::Command::SetNames(draft.names.clone()));
            // It is shown as it was until the names are taken.
            draft.from = None;
        }
        Ok(()) => {}
    }
    meaning_ui(ui, model, &draft.names);
    parts::remember(ui, id, draft);
}

/// The sentence that states the direction of the transform.
fn meaning_ui(ui: &mut Ui, model: &Model, names: &ExportNames) {
    let mode = model.solve.solved.as_ref().and_then(|solved| solved.result.mode);
    let parent = match mode {
        Some(Mode::EyeInHand) => &names.effector_frame,
        Some(Mode::EyeToHand) => &names.base_frame,
        None => return,
    };
    let meaning = text!(
        "{camera} expressed in {parent}: a point p in the camera is T·p in {parent}",
        camera = &names.camera_frame,
        parent = parent
    );
    let colour = Palette::of(ui).text;
    ui.add(Label::new(RichText::new(meaning.in_language(model.view.language)).color(colour)).wrap());
}
