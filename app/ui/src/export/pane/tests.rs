use std::path::PathBuf;

use egui::Key;
use egui_kittest::kittest::Queryable as _;

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::{Dialog, Written};
use handeye_workbench::testing::sample;
use handeye_workbench::{export, shell};

/// The sample with previews as the worker makes them.
fn model() -> Model {
    sample::previewed()
}

fn driven(model: Model) -> Driven {
    Driven::new(export_ui, model)
}

#[test]
fn without_an_answer_it_says_solve_first() {
    assert!(driven(sample::captured()).sees("Solve first"));
    let mut model = model();
    model.solve.fresh = false;
    let pane = driven(model);
    assert!(pane.sees("The result is from earlier captures"));
    assert!(!pane.is_enabled("Export 4 formats"));
}

#[test]
fn formats_are_chosen_and_left_out() {
    let mut pane = driven(model());
    let before = pane.model().export.chosen.clone();
    let sent = pane.click("json");
    let [Command::Export(export::Command::ChooseFormats(chosen))] = &sent[..] else { panic!("{sent:?}") };
    assert!(!chosen.contains("json") && chosen.len() + 1 == before.len());
    assert_eq!(
        pane.click("Choose none"),
        [Command::Export(export::Command::ChooseFormats(std::collections::BTreeSet::new()))]
    );
    assert_eq!(pane.click("Export 4 formats"), [Command::Export(export::Command::Export)]);
}

#[test]
fn a_format_that_cannot_hold_the_result_says_why_and_is_not_written() {
    let mut model = model();
    model
        .export
        .previews
        .insert("easy_handeye2".to_owned(), Err(handeye_workbench::text::Text::verbatim("it has no hand-eye")));
    let pane = driven(model);
    assert!(pane.sees("Not possible: it has no hand-eye"));
    assert!(!pane.is_enabled("easy_handeye2"));
    assert!(pane.sees("Export 3 formats"));
}

#[test]
fn the_text_of_a_format_is_read_before_it_is_written() {
    let mut pane = driven(model());
    assert_eq!(
        pane.click("Show opencv_yaml"),
        [Command::Export(export::Command::ShowFormat(Some("opencv_yaml".to_owned())))]
    );
    pane.model().export.shown = Some("opencv_yaml".to_owned());
    pane.steps();
    let file = match pane.model().export.previews.get("opencv_yaml") {
        Some(Ok(files)) => files[0].clone(),
        other => panic!("{other:?}"),
    };
    let label = format!("Text of {}", file.name);
    let row = pane.harness.get_by_label("opencv_yaml").rect();
    let field = pane.harness.get_by_label(&label);
    let below = field.rect().min.y - row.max.y;
    assert!((0.0..100.0).contains(&below), "{below} points below its name, with its description and file between");
    assert_eq!(field.value().as_deref(), Some(file.text.as_str()));
    let copy = format!("Copy {}", file.name);
    pane.harness.get_by_label(&copy).click();
    let mut copied = None;
    for _ in 0..3 {
        pane.harness.step();
        copied = copied.or(pane.harness.output().platform_output.commands.iter().find_map(|command| match command {
            egui::OutputCommand::CopyText(text) => Some(text.clone()),
            _ => None,
        }));
    }
    assert_eq!(copied.as_deref(), Some(file.text.as_str()));
}

#[test]
fn names_are_sent_when_they_are_complete_and_can_be_used() {
    let mut pane = driven(model());
    assert!(pane.sees("camera_color_optical_frame expressed in tool0: a point p in the camera is T·p in tool0"));
    pane.type_into("Robot tip", "_ee");
    assert!(pane.commands().is_empty(), "it is still being typed");
    let sent = pane.press(Key::Enter);
    let [Command::Export(export::Command::SetNames(names))] = &sent[..] else { panic!("{sent:?}") };
    assert_eq!(names.effector_frame, "tool0_ee");
    pane.type_into("Robot tip", " $");
    assert!(pane.sees("cannot be used as a name"));
    assert!(pane.press(Key::Enter).is_empty());
}

#[test]
fn the_folder_is_chosen_or_that_of_the_session() {
    let mut pane = driven(model());
    assert!(pane.sees("sessions/sample/exports"));
    assert_eq!(pane.click("Choose folder…"), [Command::Shell(shell::Command::SetDialog(Some(Dialog::ExportFolder)))]);
    pane.model().export.folder = Some(PathBuf::from("/elsewhere"));
    pane.steps();
    assert!(pane.sees("/elsewhere"));
    assert_eq!(pane.click("In the session"), [Command::Export(export::Command::SetFolder(None))]);
}

#[test]
fn every_file_is_named_as_read_back_or_the_reason_is_given() {
    let mut model = model();
    let folder = PathBuf::from("/out");
    model.export.written = Some(Written { folder: folder.clone(), files: Ok(vec![folder.join("a.yaml")]) });
    let mut pane = driven(model);
    assert!(pane.sees("a.yaml") && pane.sees("read back and compared"));
    assert!(pane.is_enabled("Copy path of a.yaml"));
    pane.model().export.written =
        Some(Written { folder, files: Err(handeye_workbench::text::Text::verbatim("the disk is full")) });
    pane.steps();
    assert!(pane.sees("Nothing was exported: the disk is full"));
}

#[test]
fn nothing_is_wider_than_the_tile() {
    assert!(driven(model()).nothing_is_cut_off());
}
