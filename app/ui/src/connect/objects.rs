//! Where the scene has the parts of the cell.

use egui::{CollapsingHeader, Label, RichText, TextEdit, Ui, WidgetInfo, WidgetType};
use handeye_coppeliasim::cell::{BadCellPath, CellPart, CellPaths};

use crate::style::theme::Palette;
use crate::style::{form, parts};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::connect;
use handeye_workbench::model::Model;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;

/// The paths as they are typed; `None` while nothing was.
pub(super) type Draft = Option<[String; CellPart::ALL.len()]>;

/// A path for each part, folded while those of the public scene are in use when the pane is first shown.
pub(super) fn objects_ui(ui: &mut Ui, model: &Model, draft: &mut Draft, outbox: &mut Outbox) {
    let language = model.view.language;
    CollapsingHeader::new(tr!(language, "Objects of the scene"))
        .id_salt("objects of the scene")
        .default_open(model.objects != CellPaths::default())
        .show(ui, |ui| {
            let hint = tr!(language, "Paths as in the scene hierarchy of CoppeliaSim, such as /Panda/Tip");
            parts::hint_ui(ui, hint);
            let mut typed = draft.clone().unwrap_or_else(|| written(&model.objects));
            for (part, path) in CellPart::ALL.into_iter().zip(&mut typed) {
                let name = name(part, language);
                let field = form::row_ui(ui, name, |ui| {
                    let hint = if part.may_be_absent() { tr!(language, "none") } else { "" };
                    let width = ui.available_width().min(300.0);
                    ui.add(TextEdit::singleline(path).char_limit(400).desired_width(width).hint_text(hint))
                });
                let label = text!("Path: {part}", part = name).in_language(language);
                field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, &label));
            }
            let read = read(&typed);
            if let Err((part, why)) = &read {
                let colour = Palette::of(ui).bad;
                ui.add(
                    Label::new(RichText::new(fault(*part, why, language).in_language(language)).color(colour)).wrap(),
                );
            }
            ui.horizontal_wrapped(|ui| {
                let new = read.ok().filter(|paths| *paths != model.objects);
                let set = ui.add_enabled(new.is_some(), egui::Button::new(tr!(language, "Use these objects")));
                if let Some(paths) = new.filter(|_| set.clicked()) {
                    outbox.send(connect::Command::SetObjects(paths));
                }
                if ui.button(tr!(language, "As in the public UR5 scene")).clicked() {
                    typed = written(&CellPaths::default());
                }
            });
            *draft = (typed != written(&model.objects)).then_some(typed);
        });
}

fn written(paths: &CellPaths) -> [String; CellPart::ALL.len()] {
    CellPart::ALL.map(|part| paths.get(part).to_owned())
}

fn read(typed: &[String]) -> Result<CellPaths, (CellPart, BadCellPath)> {
    let mut paths = CellPaths::default();
    for (part, path) in CellPart::ALL.into_iter().zip(typed) {
        paths.set(part, path.trim()).map_err(|why| (part, why))?;
    }
    Ok(paths)
}

fn name(part: CellPart, language: Language) -> &'static str {
    match part {
        CellPart::Arm => tr!(language, "Base of the arm"),
        CellPart::Joints => tr!(language, "Joints"),
        CellPart::Tip => tr!(language, "Tip (TCP)"),
        CellPart::Target => tr!(language, "Target of the tip"),
        CellPart::Camera => tr!(language, "Colour sensor"),
        CellPart::Depth => tr!(language, "Depth sensor"),
        CellPart::Board => tr!(language, "Board"),
    }
}

fn fault(part: CellPart, why: &BadCellPath, language: Language) -> Text {
    let BadCellPath::Path(path) = why else { return why.into() };
    text!("{part}: {path} is not the path of an object, which begins with /", part = name(part, language), path = path)
}

#[cfg(test)]
mod tests {
    use super::super::pane::connect_ui;
    use super::*;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::model::CellSource;
    use handeye_workbench::testing::sample;

    #[test]
    fn a_scene_with_another_arm_is_described_and_connected_to_again() {
        let mut model = sample::connected();
        model.source = CellSource::Address("tcp://127.0.0.1:23000".to_owned());
        let mut pane = Driven::new(connect_ui, model);
        assert!(!pane.sees("Tip (TCP)"), "the public scene needs nothing of it");
        pane.click("Objects of the scene");
        pane.steps();
        pane.retype("Path: Tip (TCP)", "Panda");
        assert!(pane.sees("is not the path of an object"));
        assert_eq!(pane.click("Use these objects"), [], "what is no path is not sent");
        pane.retype("Path: Tip (TCP)", "/Panda/Tip");
        let wanted = CellPaths { tip: "/Panda/Tip".to_owned(), ..CellPaths::default() };
        assert_eq!(pane.click("Use these objects"), [Command::Connect(connect::Command::SetObjects(wanted))]);
        assert!(pane.nothing_is_cut_off());
    }

    #[test]
    fn the_built_in_cell_has_its_own_objects() {
        let pane = Driven::new(connect_ui, sample::connected());
        assert!(!pane.sees("Objects of the scene"));
    }
}
