use std::sync::Arc;

use egui::Key;
use egui_kittest::kittest::Queryable as _;
use handeye_dataset::taught_poses::{Goal, TaughtPose};
use handeye_geometry::frames::Pose;

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::{CapturePurpose, Dialog, LinkState, PoseSequence, StopOutcome};
use handeye_workbench::testing::sample;
use handeye_workbench::text::Text;
use handeye_workbench::{shell, taught};

/// Three poses: one of joints, two of the tip.
fn model() -> Model {
    let mut model = sample::connected();
    let document = Arc::make_mut(&mut model.session.document);
    let tip = Goal::Tip(Pose::from_translation_xyzw([0.3, 0.0, 0.4], [0.0, 0.0, 0.0, 1.0]));
    document.taught = vec![
        TaughtPose::new("front", Goal::Joints(vec![0.0, 0.5, -1.0, 0.0, 1.5, 0.0])),
        TaughtPose::new("left", tip.clone()),
        TaughtPose::new("right", tip),
    ];
    let cell = model.taught_on(model.document().meta.target);
    for pose in &mut Arc::make_mut(&mut model.session.document).taught {
        pose.cell.clone_from(&cell);
    }
    model
}

fn driven(model: Model) -> Driven {
    Driven::new(taught_ui, model)
}

#[test]
fn without_poses_it_says_how_to_get_some() {
    let mut pane = driven(sample::connected());
    assert!(pane.sees("No taught poses yet"));
    assert!(!pane.is_enabled("Capture at each"));
    assert_eq!(pane.click("Reference poses"), [Command::Taught(taught::Command::TeachReference)]);
    assert_eq!(pane.click("Teach here"), [Command::Taught(taught::Command::Teach { name: None })]);
    assert_eq!(pane.click("Import…"), [Command::Shell(shell::Command::SetDialog(Some(Dialog::ImportPoses)))]);
}

#[test]
fn a_pose_is_taught_under_the_name_that_was_typed() {
    let mut pane = driven(model());
    pane.type_into("Name of the new pose", "above");
    assert_eq!(pane.click("Teach here"), [Command::Taught(taught::Command::Teach { name: Some("above".to_owned()) })]);
    pane.type_into("Name of the new pose", "left");
    assert!(!pane.is_enabled("Teach here"), "that name is taken");
}

#[test]
fn a_pose_is_renamed_where_it_stands() {
    let mut pane = driven(model());
    pane.type_into("Name of pose 2", " side");
    let sent = pane.press(Key::Enter);
    assert_eq!(
        sent,
        [Command::Taught(taught::Command::Rename { from: "left".to_owned(), to: "left side".to_owned() })]
    );
    pane.type_into("Name of pose 2", "er");
    assert!(pane.press(Key::Escape).is_empty(), "Esc leaves the name as it is");
}

#[test]
fn a_name_that_is_taken_is_not_given_twice() {
    let mut model = model();
    Arc::make_mut(&mut model.session.document).taught[2].name = "left side".to_owned();
    let mut pane = driven(model);
    pane.type_into("Name of pose 2", " side");
    assert!(pane.press(Key::Enter).is_empty());
}

#[test]
fn poses_are_visited_removed_and_put_elsewhere() {
    let mut pane = driven(model());
    assert_eq!(pane.click("Go to right"), [Command::Taught(taught::Command::GoTo("right".to_owned()))]);
    assert_eq!(pane.click("Remove front"), [Command::Taught(taught::Command::Remove("front".to_owned()))]);
    assert_eq!(
        pane.click("Move right up"),
        [Command::Taught(taught::Command::Reorder { name: "right".to_owned(), to: 1 })]
    );
    assert_eq!(
        pane.click("Move front down"),
        [Command::Taught(taught::Command::Reorder { name: "front".to_owned(), to: 1 })]
    );
    assert!(!pane.is_enabled("Move front up") && !pane.is_enabled("Move right down"));
}

#[test]
fn a_pose_is_dragged_to_the_place_below_another() {
    let mut pane = driven(model());
    let from = pane.harness.get_by_label("Drag front to another place").rect().center();
    let last = pane.harness.get_by_label("Name of pose 3").rect();
    let to = egui::pos2(from.x, last.bottom() - 2.0);
    pane.harness.hover_at(from);
    pane.harness.step();
    pane.harness.drag_at(from);
    pane.steps();
    pane.harness.hover_at(to);
    pane.steps();
    assert!(pane.commands().is_empty());
    pane.harness.drop_at(to);
    pane.steps();
    assert_eq!(pane.commands(), [Command::Taught(taught::Command::Reorder { name: "front".to_owned(), to: 2 })]);
}

#[test]
fn all_poses_are_run_for_each_purpose() {
    let mut pane = driven(model());
    let calibrate = Command::Taught(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
    assert_eq!(pane.click("Capture at each"), [calibrate]);
    assert_eq!(
        pane.click("Verify at each"),
        [Command::Taught(taught::Command::RunSequence { purpose: Some(CapturePurpose::Verify) })]
    );
    assert_eq!(pane.click("Move only"), [Command::Taught(taught::Command::RunSequence { purpose: None })]);
    pane.model().mover = LinkState::Failed { why: Text::verbatim("gone") };
    pane.steps();
    assert!(!pane.is_enabled("Capture at each") && !pane.is_enabled("Go to front"));
}

#[test]
fn a_session_of_images_is_moved_through_and_captures_nothing() {
    let mut images = model();
    let of_images = sample::images_alone();
    Arc::make_mut(&mut images.session.document).captures.clone_from(&of_images.document().captures);
    let mut pane = driven(images);
    assert!(!pane.is_enabled("Capture at each") && !pane.is_enabled("Verify at each"));
    assert_eq!(pane.click("Move only"), [Command::Taught(taught::Command::RunSequence { purpose: None })]);
}

#[test]
fn a_sequence_says_how_each_pose_went_and_can_be_stopped() {
    let mut model = model();
    model.sequence_runs = true;
    model.sequence = Some(PoseSequence {
        names: ["front", "left", "right"].map(str::to_owned).into(),
        planned: None,
        purpose: Some(CapturePurpose::Calibrate),
        outcomes: vec![StopOutcome::Done, StopOutcome::Skipped(Text::verbatim("the board was not found"))],
        began_s: 90.0,
        guided: None,
    });
    let mut pane = driven(model);
    assert!(pane.sees("Pose 3 of 3: right"));
    assert!(pane.sees("Skipped: the board was not found"));
    assert!(!pane.is_enabled("Remove front"));
    assert_eq!(pane.click("Stop the sequence"), [Command::Taught(taught::Command::StopSequence)]);
    pane.model().sequence_runs = false;
    pane.steps();
    assert!(pane.sees("Last sequence: 1 of 3 done, 1 skipped, 1 not visited"));
    assert_eq!(pane.click("Continue the sequence"), [Command::Taught(taught::Command::ContinueSequence)]);
    let sequence = pane.model().sequence.as_mut().expect("it is still known");
    sequence.outcomes.push(StopOutcome::Done);
    pane.steps();
    assert!(!pane.sees("Continue the sequence"), "nothing is left");
}

#[test]
fn nothing_is_wider_than_the_tile() {
    assert!(driven(model()).nothing_is_cut_off());
}
