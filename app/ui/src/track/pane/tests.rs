use std::sync::Arc;

use egui_kittest::kittest::Queryable as _;
use handeye_estimate::handeye::HandEye;
use handeye_geometry::frames::Pose;
use handeye_track::State;

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::{
    BoardMotion, BoardPath, FollowRequest, FollowStatus, LinkState, RotationFormat, Simulation, Solved, TrackState,
    Tracked,
};
use handeye_workbench::testing::sample;
use handeye_workbench::text::Text;
use handeye_workbench::track;
use handeye_workbench::worker::TrackedBy;

fn driven(model: Model) -> Driven {
    Driven::new(track_ui, model)
}

/// Tracked, and not followed.
fn tracked() -> Model {
    let mut model = sample::tracking();
    model.track.request = None;
    model.track.follow = FollowStatus::Off;
    model
}

fn newest(pane: &mut Driven, change: impl FnOnce(&mut Tracked)) {
    let track = &mut pane.model().track;
    let mut tracked = Tracked::clone(track.newest.as_ref().expect("tracked"));
    change(&mut tracked);
    track.newest = Some(Arc::new(tracked));
    pane.steps();
}

#[test]
fn tracking_is_started_and_stopped() {
    let mut model = sample::solved();
    model.track = TrackState::default();
    let mut pane = driven(model);
    assert!(pane.sees("The board is not tracked"));
    assert_eq!(pane.click("Start tracking"), [Command::Track(track::Command::SetTracking(true))]);
    pane.model().track.on = true;
    pane.steps();
    assert!(pane.sees("Waiting for the first image"));
    assert_eq!(pane.click("Stop tracking"), [Command::Track(track::Command::SetTracking(false))]);
}

#[test]
fn tracking_says_why_it_cannot_begin() {
    let mut pane = driven(sample::captured());
    assert!(pane.sees("There is no hand-eye calibration yet"));
    assert!(!pane.is_enabled("Start tracking") && !pane.is_enabled("Follow"));
    let mut model = sample::solved();
    model.camera = LinkState::Failed { why: Text::verbatim("gone") };
    pane = driven(model);
    assert!(pane.sees("Not connected: connect to the cell first"));
    assert!(!pane.is_enabled("Start tracking"));
}

#[test]
fn every_state_of_tracking_is_said_in_words() {
    let mut pane = driven(tracked());
    assert!(pane.sees("Tracking 68 of 70 corners"));
    assert!(pane.sees("20.0 Hz · 12 ms"));
    for (state, words) in [
        (State::Searching, "Searching for the board"),
        (State::Coasting { since_s: 29.6 }, "Not seen for 0.4 s: assumed to go on as it went"),
        (State::Lost { since_s: 26.8 }, "Lost 3.2 s ago: searching"),
    ] {
        newest(&mut pane, |tracked| {
            tracked.update.state = state;
            tracked.update.seen = None;
            tracked.update.by_depth = None;
        });
        assert!(pane.sees(words), "{words}");
        assert!(!pane.is_enabled("Follow"), "there is nothing to follow: {words}");
    }
    newest(&mut pane, |tracked| tracked.update.estimate = None);
    assert!(pane.sees("Where it is now is not known."));
    assert!(!pane.sees("Velocity [mm/s]"));
}

#[test]
fn the_pose_is_told_in_millimetres_with_how_sure_it_is_and_in_the_chosen_rotation() {
    let mut pane = driven(tracked());
    newest(&mut pane, |tracked| {
        let estimate = tracked.update.estimate.as_mut().expect("tracked");
        let quarter = std::f64::consts::FRAC_PI_4;
        estimate.base_from_target =
            Pose::from_translation_xyzw([-0.125, -0.4, 0.802], [0.0, 0.0, quarter.sin(), quarter.cos()]);
        // One tenth of a millimetre along x of the board, which is y of the base.
        estimate.covariance = nalgebra::Matrix6::zeros();
        estimate.covariance[(0, 0)] = 1e-8;
        estimate.covariance[(5, 5)] = 1e-6;
    });
    assert!(pane.sees("Position [mm]: −125.00 −400.00 802.00"));
    assert!(pane.sees("± 95 % [mm]: 0.00 0.20 0.00"));
    assert!(pane.sees("roll pitch yaw [°]: 0.00 0.00 90.00"));
    assert!(pane.sees("± 95 % [°]: 0.00 0.00 0.11"));
    assert!(pane.sees("Velocity [mm/s]: 0.0 −6.3 0.0"));
    assert!(pane.sees("± is the noise of images and motion alone"), "and nothing of the calibration");
    pane.model().view.rotation = RotationFormat::Quaternion;
    pane.steps();
    assert!(pane.sees("quaternion x y z w: 0.0000 0.0000 0.7071 0.7071"));
}

#[test]
fn corners_and_depth_are_told_side_by_side_with_the_distance_between_them() {
    let mut pane = driven(tracked());
    newest(&mut pane, |tracked| {
        let (seen, by_depth) = (tracked.update.seen.as_mut(), tracked.update.by_depth.as_mut());
        let pose = |x: f64| Pose::from_translation_xyzw([x, 0.2, 0.3], [0.0, 0.0, 0.0, 1.0]);
        seen.expect("seen").base_from_target = pose(0.1);
        by_depth.expect("depth").base_from_target = pose(0.102);
    });
    assert!(pane.sees("By corners [mm]: 100.00 200.00 300.00"));
    assert!(pane.sees("By depth [mm]: 102.00 200.00 300.00"));
    assert!(pane.sees("Apart: 2.00 mm, 0.00°"));
    newest(&mut pane, |tracked| tracked.update.by_depth = None);
    assert!(!pane.sees("Apart") && pane.sees("The image has no depth"));
}

#[test]
fn the_error_is_told_against_the_truth_of_the_simulator_and_only_where_there_is_one() {
    let mut pane = driven(tracked());
    assert!(pane.sees("Against the simulator's truth"));
    assert!(pane.sees("Position error [mm]: 0.310") && pane.sees("Rotation error [°]: 0.052"));
    assert!(pane.harness.query_by_label("Error of the position [mm]").is_some(), "a plot");
    assert!(pane.harness.query_by_label("x, y, z about their means [mm]").is_some());
    newest(&mut pane, |tracked| tracked.error = None);
    assert!(!pane.sees("Against the simulator's truth"));
}

#[test]
fn what_the_calibration_is_off_by_is_told_beside_the_noise() {
    let says = |answer: Model, mm: &str| {
        let mut model = tracked();
        model.solve = answer.solve;
        driven(model).sees(mm)
    };
    assert!(says(sample::with_errors_of_the_arm(), "alone: a tool arrives within 2.91 mm (95 %)."), "as it is tracked");
    assert!(says(sample::connected(), "the error of the calibration is not known."));
    let answer = sample::solved();
    let solved = answer.solve.current().expect("solved");
    let point_mm = solved.result.quality.tip_error_95_mm.expect("stated");
    assert!(says(answer, &format!("the calibration puts a point within {point_mm:.2} mm (95 %).")));
}

#[test]
fn where_the_errors_of_the_arm_are_known_a_person_chooses_whether_they_are_corrected() {
    const SWITCH: &str = "Correct for the errors of the arm";
    let mut model = tracked();
    assert!(!driven(model.clone()).sees(SWITCH));
    let known = sample::with_errors_of_the_arm();
    (model.solve, model.robot) = (known.solve, known.robot);
    let mut pane = driven(model);
    assert!(!pane.sees("By tip poses corrected for the errors of the arm"), "it is not tracked by them yet");
    assert_eq!(pane.click(SWITCH), [Command::Track(track::Command::SetCorrected(false))]);
    pane.model().track.wants_corrected = Some(false);
    pane.steps();
    assert_eq!(pane.click(SWITCH), [Command::Track(track::Command::SetCorrected(true))]);
    let by = pane.model().track.by.as_ref().map(|by| TrackedBy::clone(by)).expect("tracked");
    let by = TrackedBy { arm: Some(Arc::new(sample::corrected_arm())), ..by };
    pane.model().track.by = Some(Arc::new(by));
    pane.steps();
    assert!(pane.sees("By tip poses corrected for the errors of the arm"));
}

#[test]
fn the_arm_keeps_its_view_or_goes_to_a_corner_and_is_stopped() {
    let mut pane = driven(tracked());
    assert_eq!(
        pane.click("Follow"),
        [Command::Track(track::Command::SetFollow(Some(FollowRequest::KeepViewWithRoom)))]
    );
    pane.click("Make room first where it is needed");
    assert_eq!(pane.click("Follow"), [Command::Track(track::Command::SetFollow(Some(FollowRequest::KeepView)))]);
    pane.click("Tip to a corner");
    pane.type_into("Corner to go to", "12");
    pane.press(egui::Key::Enter);
    pane.type_into("Stand-off in mm", "80");
    pane.press(egui::Key::Enter);
    let sent = pane.click("Follow");
    assert_eq!(
        sent,
        [Command::Track(track::Command::SetFollow(Some(FollowRequest::Corner { index: 11, stand_off_m: 0.08 })))]
    );
    pane.model().track.request = Some(FollowRequest::KeepView);
    pane.steps();
    assert!(pane.sees("Starting to follow"));
    pane.model().track.follow = FollowStatus::MakingRoom;
    pane.steps();
    assert!(pane.sees("Moving to where the arm has room to follow") && pane.sees("Stop following"));
    pane.model().track.follow = FollowStatus::Following { distance_m: 0.0012, angle_rad: 0.01, is_kept_off: false };
    pane.steps();
    assert!(pane.sees("Following: 1.2 mm and 0.57° from the goal"));
    assert!(!pane.is_enabled("Keep this view"), "it is chosen before");
    assert_eq!(pane.click("Stop following"), [Command::Track(track::Command::SetFollow(None))]);
    pane.model().track.follow = FollowStatus::Ended(Text::verbatim("joint 3 is at its limit"));
    pane.steps();
    assert!(pane.sees("The arm does not follow the board: joint 3 is at its limit"));
    let again = FollowRequest::Corner { index: 11, stand_off_m: 0.08 };
    assert_eq!(pane.click("Follow again"), [Command::Track(track::Command::SetFollow(Some(again)))]);
}

#[test]
fn the_arm_says_why_it_cannot_follow() {
    let blocked = |change: fn(&mut Model), words: &str| {
        let mut model = tracked();
        change(&mut model);
        let pane = driven(model);
        assert!(pane.sees(words), "{words}");
        assert!(!pane.is_enabled("Follow"), "{words}");
    };
    blocked(|model| model.track.on = false, "Start tracking first");
    blocked(|model| model.mover = LinkState::Failed { why: Text::verbatim("gone") }, "the arm cannot be moved until");
    blocked(|model| model.sequence_runs = true, "A sequence is under way");
    let unknown = |model: &mut Model| model.cell.iter_mut().for_each(|cell| cell.arm = None);
    blocked(unknown, "This arm's kinematics is not known");
    let rests = |model: &mut Model| model.robot.iter_mut().for_each(|it| it.simulation = Simulation::Stopped);
    blocked(rests, "The simulation is stopped");
    let on_the_arm = |model: &mut Model| {
        let mut solved = Solved::clone(model.solve.solved.as_ref().expect("solved"));
        if let Some(calibrated) = &mut solved.calibrated {
            calibrated.hand_eye =
                HandEye::EyeToHand { base_from_camera: Pose::identity(), tip_from_target: Pose::identity() };
        }
        model.solve.solved = Some(Arc::new(solved));
    };
    blocked(on_the_arm, "The board is on the arm");
}

#[test]
fn the_board_of_a_simulated_cell_is_moved_and_hidden() {
    let mut model = tracked();
    model.track.board = BoardMotion::default();
    let mut pane = driven(model);
    for (label, path) in [
        ("Circle", BoardPath::Circle),
        ("Eight", BoardPath::FigureEight),
        ("Random", BoardPath::RandomWalk),
        ("Jumps", BoardPath::Step),
    ] {
        assert_eq!(
            pane.click(label),
            [Command::Track(track::Command::MoveBoard(BoardMotion { path, speed_m_s: 0.05 }))]
        );
    }
    pane.model().track.board = BoardMotion { path: BoardPath::Circle, speed_m_s: 0.05 };
    pane.steps();
    pane.commands();
    pane.type_into("Speed of the board in m/s", "0.2");
    let mut sent = pane.commands();
    sent.extend(pane.press(egui::Key::Enter));
    assert_eq!(
        sent.last(),
        Some(&Command::Track(track::Command::MoveBoard(BoardMotion { path: BoardPath::Circle, speed_m_s: 0.2 })))
    );
    let sent = pane.click("Still");
    assert!(
        matches!(sent[..], [Command::Track(track::Command::MoveBoard(BoardMotion { path: BoardPath::Still, .. }))]),
        "{sent:?}"
    );
    assert_eq!(pane.click("Hide the board"), [Command::Track(track::Command::HideBoard(true))]);
    pane.model().track.board_hidden = true;
    pane.steps();
    assert_eq!(pane.click("Hide the board"), [Command::Track(track::Command::HideBoard(false))]);
}

#[test]
fn a_cell_that_does_not_say_where_its_board_is_has_no_controls_for_it() {
    let mut model = tracked();
    model.cell.iter_mut().for_each(|cell| cell.truth = None);
    let pane = driven(model);
    assert!(!pane.sees("Board of the simulated cell") && !pane.sees("Hide the board"));
}

#[test]
fn nothing_is_wider_than_the_tile() {
    for model in [tracked, sample::tracking, sample::captured] {
        assert!(driven(model()).nothing_is_cut_off());
    }
}

#[test]
fn no_row_of_numbers_breaks_into_two_lines_whatever_the_width_of_the_tile() {
    for rotation in [RotationFormat::RollPitchYaw, RotationFormat::Quaternion] {
        let mut model = tracked();
        model.view.rotation = rotation;
        let mut pane = driven(model);
        // The widest values within reach of an arm.
        newest(&mut pane, |tracked| {
            let far = Pose::from_translation_xyzw([-1.125, -1.4, -1.802], [0.5, 0.5, -0.5, 0.5]);
            tracked.update.estimate.as_mut().expect("tracked").base_from_target = far;
        });
        for width in (430..=1100).step_by(30) {
            pane.widen(width as f32);
            for row in
                ["Position [mm]: −1125.00", "± 95 % [mm]:", "± 95 % [°]:", "By corners [mm]:", "Velocity [mm/s]:"]
            {
                let heights: Vec<f32> =
                    pane.harness.query_all_by_label_contains(row).map(|node| node.rect().height()).collect();
                assert!(!heights.is_empty(), "{row} at {width}");
                // A line of figures is 15 high, two are over 25.
                assert!(heights.iter().all(|height| *height < 22.0), "{row} at {width}, {rotation:?}: {heights:?}");
            }
            assert!(pane.nothing_is_cut_off(), "{width}");
        }
    }
}
