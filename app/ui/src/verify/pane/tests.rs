use handeye_capture::Wait;
use handeye_estimate::verify::{Verification, VerifyError};
use handeye_session::{CaptureId, Role};
use nalgebra::Vector2;
use std::sync::Arc;

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::{
    CaptureUnderWay, CaptureWait, Home, ImagePoint, LinkState, MeasuredTwice, Pane, PickedPoint, PoseSequence,
    Severity, StopOutcome,
};
use handeye_workbench::testing::sample;
use handeye_workbench::text::Text;
use handeye_workbench::{capture, live, session, taught};

fn driven(model: Model) -> Driven {
    Driven::new(verify_ui, model)
}

#[test]
fn a_capture_for_verification_is_asked_for_and_cancelled() {
    let mut pane = driven(sample::connected());
    assert!(pane.sees("There is no calibration to verify yet"));
    assert_eq!(
        pane.click("Capture for verification"),
        [Command::Capture(capture::Command::Take(CapturePurpose::Verify))]
    );
    pane.model().capture = Some(CaptureUnderWay {
        number: 1,
        purpose: CapturePurpose::Verify,
        wait: CaptureWait::Images(Wait::RobotMoves),
        since_s: 99.0,
    });
    pane.steps();
    assert!(!pane.is_enabled("Capture for verification"));
    assert_eq!(pane.click("Cancel capture"), [Command::Capture(capture::Command::Cancel)]);
    pane.model().capture = None;
    pane.model().camera = LinkState::Failed { why: Text::verbatim("gone") };
    pane.steps();
    assert!(pane.sees("Not connected"));
}

#[test]
fn errors_are_stated_in_millimetres_degrees_and_pixels_and_judged() {
    let mut pane = driven(sample::with_answer(|solved| {
        if let Some(Ok(verification)) = &mut solved.verification {
            verification.centre_rms_m = 0.000_123;
            verification.orientation_rms_rad = 0.1_f64.to_radians();
            verification.rms_px = 0.456;
            verification.origin_scatter_m = None;
        }
    }));
    assert!(pane.sees("Errors of prediction over 2 captures, RMS"));
    assert!(pane.sees("Middle of the board: 0.123 mm"));
    assert!(pane.sees("Its orientation: 0.100°"));
    assert!(pane.sees("Its corners: 0.456 px"));
    assert!(pane.sees("Scatter of its position: –"));
    assert!(pane.sees("The errors are of the size that the calibration states"));
    assert_eq!(pane.click("Capture 12"), [Command::Session(session::Command::Select(vec![CaptureId(12)]))]);
}

#[test]
fn errors_that_are_too_large_are_said_to_be() {
    let pane = driven(sample::with_answer(|solved| {
        if let Some(Ok(verification)) = &mut solved.verification {
            verification.consistency.as_mut().expect("stated").ratio = 50.0;
        }
    }));
    assert!(pane.sees("The errors are larger than the calibration states: their mean square is 50.00 times"));
    assert!(pane.nothing_is_cut_off());
}

/// As on an exact cell, whose errors are what rounding leaves.
#[test]
fn errors_next_to_nothing_are_not_said_with_zeros() {
    let pane = driven(sample::with_answer(|solved| {
        if let Some(Ok(verification)) = &mut solved.verification {
            verification.consistency.as_mut().expect("stated").ratio = 1e-5;
        }
    }));
    assert!(pane.sees("their mean square is <0.01 times the expected one"));
}

#[test]
fn a_verification_without_an_answer_says_why() {
    let pane = driven(sample::with_answer(|solved| {
        solved.verification = Some(Err(VerifyError::PredictedBehind { name: "images/0011.png".to_owned() }));
    }));
    assert!(pane.sees("behind the camera"));
}

#[test]
fn it_says_why_there_is_no_verification() {
    let mut model = sample::with_answer(|solved| solved.verification = None);
    model.solve.fresh = false;
    let mut pane = driven(model);
    assert!(pane.sees("The captures for verification are being evaluated"));
    pane.model().solve.fresh = true;
    pane.steps();
    assert!(pane.sees("The board was not found in any capture for verification"));
    let document = Arc::make_mut(&mut pane.model().session.document);
    document.captures.retain(|capture| capture.role == Role::Calibration);
    pane.steps();
    assert!(pane.sees("No captures for verification yet"));
}

#[test]
fn a_picked_point_is_measured_twice_and_the_difference_is_stated() {
    let mut model = sample::solved();
    let calibrated = model.calibrated().expect("calibrated").clone();
    let base_from_tip = model.robot.as_ref().expect("a robot").base_from_tip;
    let px = Vector2::new(320.0, 240.0);
    let near = calibrated.point_at_depth(&base_from_tip, &px, 0.3).expect("a point");
    let far = calibrated.point_at_depth(&base_from_tip, &px, 0.31).expect("a point");
    let pixel = ImagePoint { column: 320, row: 240 };
    let as_reported = MeasuredTwice { from_depth: Ok(near), from_board: Ok(far) };
    model.picked = Some(PickedPoint { pixel, as_reported, corrected: None });
    let mut pane = driven(model);
    assert!(pane.sees("Pixel 320, 240"));
    assert!(pane.sees("± 1 σ [mm]"));
    // Ten millimetres deeper along a ray that is almost the optical axis.
    assert!(pane.sees("Its length [mm]: 10.00"));
    assert_eq!(pane.click("Clear the point"), [Command::Live(live::Command::Pick(None))]);
    let without = Text::verbatim("No depth at this pixel");
    if let Some(picked) = &mut pane.model().picked {
        picked.as_reported.from_depth = Err(without);
    }
    pane.steps();
    assert!(pane.sees("No depth at this pixel"));
    assert!(!pane.sees("Difference"));
}

#[test]
fn where_the_errors_of_the_arm_are_known_predictions_and_points_are_also_by_corrected_tip_poses() {
    let mut model = sample::with_errors_of_the_arm();
    let calibrated = model.calibrated().expect("calibrated").clone();
    let base_from_tip = model.robot.as_ref().expect("a robot").base_from_tip;
    let at =
        |depth_m| calibrated.point_at_depth(&base_from_tip, &Vector2::new(320.0, 240.0), depth_m).expect("a point");
    let twice = |depth_m| MeasuredTwice { from_depth: Ok(at(depth_m)), from_board: Ok(at(depth_m)) };
    let pixel = ImagePoint { column: 320, row: 240 };
    model.picked = Some(PickedPoint { pixel, as_reported: twice(0.3), corrected: Some(twice(0.31)) });
    // Reported tip poses have larger errors than the calibration states for them, corrected ones do not.
    let mut worse = sample::with_errors_of_the_arm();
    let solved = Arc::make_mut(worse.solve.solved.as_mut().expect("solved"));
    let Some(Ok(verification)) = &mut solved.verification else { panic!("verified") };
    verification.consistency.as_mut().expect("stated").ratio = 9.0;
    assert_eq!(solved.verification_in_use().and_then(Verification::is_as_stated), Some(true));
    let pane = driven(worse);
    assert!(pane.sees("As reported:") && pane.sees("Corrected tip poses do not have them: they are those of the arm"));
    assert!(!pane.sees("The board may have been moved"));
    assert!(pane.nothing_is_cut_off());
    let solved = model.solve.solved.as_ref().expect("solved");
    let reported = solved.verification.as_ref().and_then(|it| it.as_ref().ok()).expect("verified").centre_rms_m;
    let pane = driven(model.clone());
    assert!(pane.sees("By the tip poses that the robot reports → by tip poses corrected for the errors of the arm"));
    let (mm, by_arm_mm) = (reported * 1e3, reported / 8.0 * 1e3);
    assert!(pane.sees(&format!("Middle of the board: {mm:.3} mm → {by_arm_mm:.3} mm")) && pane.sees("Corrected:"));
    assert!(pane.sees("From depth, corrected [mm]"));
    assert!(pane.sees("for commands that are corrected as well, and no others"));
    assert!(pane.nothing_is_cut_off());
}

const PLANNED: &str = "Verify at planned poses";

#[test]
fn captures_at_planned_poses_are_offered_where_they_can_be_taken_and_say_what_is_in_the_way() {
    let mut pane = driven(sample::solved());
    assert_eq!(pane.click(PLANNED), [Command::Taught(taught::Command::VerifyAtPlanned)]);
    let is_blocked = |change: fn(&mut Model)| {
        let mut model = sample::solved();
        change(&mut model);
        assert!(!driven(model).is_enabled(PLANNED));
    };
    is_blocked(|model| model.solve.solved = None);
    is_blocked(|model| model.mover = LinkState::Failed { why: Text::verbatim("gone") });
    is_blocked(|model| model.camera = LinkState::Failed { why: Text::verbatim("gone") });
    is_blocked(|model| model.cell.iter_mut().for_each(|cell| cell.arm = None));
    is_blocked(|model| {
        model.motion =
            handeye_workbench::model::Motion::Jogging(handeye_workbench::model::Jog::Joint { index: 0, forward: true });
    });
}

#[test]
fn captures_at_planned_poses_show_how_far_they_are_and_are_stopped_from_the_pane() {
    let mut model = sample::solved();
    model.planning = true;
    let mut pane = driven(model);
    assert!(pane.sees("Planning poses that are not in the fit"));
    assert!(!pane.is_enabled("Capture for verification"));
    pane.model().planning = false;
    pane.model().sequence_runs = true;
    pane.model().sequence = Some(PoseSequence {
        names: vec!["V1".to_owned(), "V2".to_owned(), "V3".to_owned()],
        planned: Some(vec![[0.0; 6].into(); 3]),
        purpose: Some(CapturePurpose::Verify),
        outcomes: vec![StopOutcome::Done, StopOutcome::Skipped(Text::verbatim("the board was not found"))],
        began_s: 90.0,
        guided: None,
    });
    pane.steps();
    assert!(pane.sees("Pose 3 of 3: V3"));
    assert_eq!(pane.click("Stop the sequence"), [Command::Taught(taught::Command::StopSequence)]);
    pane.model().sequence_runs = false;
    let why = Text::verbatim("it was broken off");
    pane.model().messages.notify_at(Home::Pane(Pane::Verify), Severity::Warning, why, 99.0);
    pane.steps();
    assert!(pane.sees("Last sequence: 1 of 3 done, 1 skipped, 1 not visited"));
    assert!(pane.sees("Skipped V2: the board was not found") && pane.sees("it was broken off"));
    assert!(pane.is_enabled(PLANNED) && pane.nothing_is_cut_off());
}
