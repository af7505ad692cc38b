use nalgebra::{Matrix6, Vector6};

use super::*;
use crate::moving_board::{base_from_tip, board_at, calibrated, tip_from_camera};
use handeye_geometry::testing::GRID;

fn estimate() -> Estimate {
    Estimate {
        time_s: 1.0,
        base_from_target: board_at(Vector3::new(0.02, 0.01, 0.0), Vector3::new(0.1, 0.2, 0.3)),
        covariance: Matrix6::identity(),
        velocity_m_s: Vector3::new(0.1, -0.05, 0.02),
        angular_velocity_rad_s: Vector3::new(0.2, 0.1, -0.4),
    }
}

fn target() -> TargetSpec {
    TargetSpec::Chessboard(GRID)
}

/// Pose of the board `t` later: its origin and its axes go on evenly.
fn later(estimate: &Estimate, t: f64) -> Pose<Base, Target> {
    let turn = UnitQuaternion::from_scaled_axis(estimate.angular_velocity_rad_s * t);
    let origin = estimate.base_from_target.translation() + estimate.velocity_m_s * t;
    Pose::from_isometry(Isometry3::from_parts(origin.into(), turn * estimate.base_from_target.rotation()))
}

#[test]
fn the_tip_at_its_goal_has_the_view_that_is_kept() {
    let estimate = estimate();
    let seen_now = tip_from_camera().inverse() * base_from_tip().inverse() * estimate.base_from_target;
    let goal = Keep::View(seen_now).tip_goal(&estimate, &calibrated(), &target()).expect("a goal");
    let (shift, turn) = goal.base_from_tip.distance_to(&base_from_tip());
    assert!(shift < 1e-12 && turn < 1e-7, "{shift} m {turn} rad");
    let other = seen_now.perturbed(&Vector6::new(0.01, 0.02, 0.1, 0.1, 0.2, 0.3));
    let goal = Keep::View(other).tip_goal(&estimate, &calibrated(), &target()).expect("a goal");
    let (shift, turn) = (goal.base_from_tip * tip_from_camera() * other).distance_to(&estimate.base_from_target);
    assert!(shift < 1e-12 && turn < 1e-7, "{shift} m {turn} rad");
}

#[test]
fn velocities_of_a_goal_are_those_of_the_goals_that_follow() {
    let estimate = estimate();
    let camera_from_target =
        Pose::from_isometry(Isometry3::new(Vector3::new(0.01, 0.0, 0.4), Vector3::new(0.1, 0.0, 0.2)));
    let corner = Keep::Corner { index: 69, stand_off_m: 0.1, base_from_tip_orientation: base_from_tip().rotation() };
    for keep in [Keep::View(camera_from_target), corner] {
        let goal_at = |t: f64| {
            let there = Estimate { base_from_target: later(&estimate, t), ..estimate.clone() };
            keep.tip_goal(&there, &calibrated(), &target()).expect("a goal")
        };
        let h = 1e-5;
        let (before, goal, after) = (goal_at(-h).base_from_tip, goal_at(0.0), goal_at(h).base_from_tip);
        let velocity = (after.translation() - before.translation()) / (2.0 * h);
        let spin = (after.rotation() * before.rotation().inverse()).scaled_axis() / (2.0 * h);
        assert!((goal.velocity_m_s - velocity).norm() < 1e-7, "{keep:?}: {} {velocity}", goal.velocity_m_s);
        assert!((goal.angular_velocity_rad_s - spin).norm() < 1e-7, "{keep:?}: {spin}");
    }
}

#[test]
fn the_tip_at_a_corner_stands_off_towards_the_viewer() {
    let estimate = estimate();
    let orientation = base_from_tip().rotation();
    let keep = |index| Keep::Corner { index, stand_off_m: 0.1, base_from_tip_orientation: orientation };
    let goal = keep(11).tip_goal(&estimate, &calibrated(), &target()).expect("a goal");
    let on_board = estimate.base_from_target.isometry().inverse() * goal.base_from_tip.isometry();
    assert!((on_board.translation.vector - Vector3::new(0.015, 0.015, -0.1)).norm() < 1e-12);
    assert!(goal.base_from_tip.rotation().angle_to(&orientation) < 1e-7);
    let camera = (base_from_tip() * tip_from_camera()).translation();
    let corner = estimate.base_from_target.isometry() * GRID.point(11);
    assert!((goal.base_from_tip.translation() - camera).norm() < (corner.coords - camera).norm());
    assert_eq!(keep(70).tip_goal(&estimate, &calibrated(), &target()), None);
}

#[test]
fn a_camera_beside_the_robot_and_numbers_that_are_none_have_no_goal() {
    let mut beside = calibrated();
    beside.hand_eye = HandEye::EyeToHand { base_from_camera: Pose::identity(), tip_from_target: Pose::identity() };
    let keep = Keep::View(Pose::identity());
    assert_eq!(keep.tip_goal(&estimate(), &beside, &target()), None);
    let mut wild = estimate();
    wild.velocity_m_s.x = f64::NAN;
    assert_eq!(keep.tip_goal(&wild, &calibrated(), &target()), None);
}
