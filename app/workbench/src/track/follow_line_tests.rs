use handeye_geometry::frames::{Base, Pose, Tip};

use super::*;
use crate::testing::sample;
use handeye_estimate::corrected_arm::CorrectedArm;

/// What tracks the board of the sample, and its newest sight of it at 30 s.
fn line() -> (FollowLine, Update, Pose<Base, Tip>) {
    line_by(None)
}

fn line_by(arm: Option<std::sync::Arc<CorrectedArm>>) -> (FollowLine, Update, Pose<Base, Tip>) {
    let model = sample::tracking();
    let setup = Setup {
        target: model.document().meta.target,
        calibrated: model.calibrated().expect("calibrated").clone(),
        motion: handeye_track::MotionModel::default(),
    };
    let line = FollowLine::default();
    line.set_up(Some(TrackedBy { setup, arm }));
    let newest = model.track.newest.as_ref().expect("tracked").update.clone();
    (line, newest, model.robot.as_ref().expect("a robot").base_from_tip)
}

fn moment(sim_time_s: f64, base_from_tip: Pose<Base, Tip>) -> FollowMoment {
    FollowMoment { sim_time_s, joints: [0.0; 6].into(), base_from_tip, is_kept_off: false }
}

#[test]
fn an_arm_that_was_moved_waits_for_the_board_and_then_keeps_the_view_that_it_has_there() {
    let (line, seen, tip) = line();
    let lost = Update { state: State::Lost { since_s: 29.0 }, estimate: None, seen: None, ..seen.clone() };
    line.see(&lost);
    line.begin_elsewhere(FollowRequest::KeepViewWithRoom);
    assert_eq!(line.request(&moment(30.0, tip)), ArmRequest::Rest);
    line.see(&seen);
    let ArmRequest::Towards(goal) = line.request(&moment(30.05, tip)) else { panic!("it follows") };
    // The board is at 6 mm/s: after two passes the goal is still where the tip is.
    assert!(goal.base_from_tip.distance_to(&tip).0 < 1e-3);
}

/// An arm that goes where it is commanded comes to rest with its tip, as it really is, over the corner.
#[test]
fn an_arm_that_is_off_is_sent_where_its_tip_really_gets_to_the_goal() {
    let arm = sample::corrected_arm();
    let (line, seen, _) = line_by(Some(std::sync::Arc::new(arm.clone())));
    let mut joints = [0.1, 0.5, -1.0, 0.0, 1.5, 0.0];
    let over_corner = FollowRequest::Corner { index: 0, stand_off_m: 0.05 };
    line.see(&seen);
    line.begin(over_corner);
    let estimate = seen.estimate.as_ref().expect("seen").carried_to(30.0);
    let board = estimate.base_from_target;
    let corner = sample::tracking().document().meta.target.point(0) - nalgebra::Vector3::z() * 0.05;
    let mut off_m = [f64::INFINITY; 2];
    for _ in 0..10 {
        let reported = arm.arm.forward(&joints).expect("six joints");
        let now = FollowMoment { joints: joints.into(), ..moment(30.0, reported) };
        let ArmRequest::Towards(goal) = line.request(&now) else { panic!("it follows") };
        joints = arm.arm.inverse(&goal.base_from_tip, &joints).expect("in reach")[..].try_into().expect("six");
        let tips = [arm.actual(&joints).expect("six joints"), arm.arm.forward(&joints).expect("six joints")];
        off_m = tips.map(|tip| (tip.translation() - (board.isometry() * corner).coords).norm());
    }
    assert!(off_m[0] < 1e-6 && off_m[1] > 1e-4, "{off_m:?}");
}

#[test]
fn an_arm_that_loses_the_board_stands_and_goes_on_when_it_is_seen_again_in_time() {
    let (line, seen, tip) = line();
    let lost = Update { state: State::Lost { since_s: 29.0 }, estimate: None, seen: None, ..seen.clone() };
    line.see(&seen);
    line.begin(FollowRequest::KeepView);
    let is_followed = |at_s: f64| matches!(line.request(&moment(at_s, tip)), ArmRequest::Towards(_));
    assert!(is_followed(30.05));
    line.see(&lost);
    assert_eq!(line.request(&moment(30.1, tip)), ArmRequest::Rest);
    assert_eq!(line.take_status(), Some(FollowStatus::Waiting));
    line.see(&seen);
    assert!(is_followed(30.2));
    // The images stop: the newest one grows old.
    assert_eq!(line.request(&moment(30.2 + LONGEST_GUESS_S, tip)), ArmRequest::Rest);
    assert_eq!(line.request(&moment(30.1 + LONGEST_GUESS_S + PATIENCE_S, tip)), ArmRequest::Rest);
    assert_eq!(line.request(&moment(30.3 + LONGEST_GUESS_S + PATIENCE_S, tip)), ArmRequest::End);
    assert!(line.take_ended().is_some());
}

#[test]
fn an_arm_that_waits_in_vain_ends_and_one_that_was_not_moved_does_not_wait() {
    let (line, seen, tip) = line();
    let lost = Update { state: State::Searching, estimate: None, seen: None, ..seen };
    line.see(&lost);
    line.begin_elsewhere(FollowRequest::KeepView);
    assert_eq!(line.request(&moment(30.0, tip)), ArmRequest::Rest);
    assert_eq!(line.request(&moment(30.0 + PATIENCE_S - 0.01, tip)), ArmRequest::Rest);
    assert_eq!(line.request(&moment(30.0 + PATIENCE_S, tip)), ArmRequest::End);
    line.begin(FollowRequest::KeepView);
    assert_eq!(line.request(&moment(40.0, tip)), ArmRequest::End);
}
