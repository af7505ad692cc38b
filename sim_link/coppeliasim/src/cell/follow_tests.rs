use nalgebra::{Point3, Vector3};

use super::super::follow_goal::Workspace;
use super::*;

#[test]
fn limits_that_make_no_sense_are_named() {
    FollowLimits::default().validate().expect("the defaults make sense");
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = FollowLimits { turn_rad_s: bad, ..FollowLimits::default() }.validate().expect_err("no limit");
        assert!(error.to_string().contains("the angular speed of the tip"), "{error}");
    }
    let Workspace { min, max } = Workspace::default();
    for workspace in [Workspace { min: max, max: min }, Workspace { min, max: Point3::new(1.0, f64::NAN, 1.0) }] {
        let error = FollowLimits { workspace, ..FollowLimits::default() }.validate().expect_err("no room");
        assert!(error.to_string().contains("the workspace along"), "{error}");
    }
}

#[test]
fn a_goal_moves_on_by_its_velocities_in_the_axes_of_the_base() {
    let turned = [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2];
    let goal = FollowGoal {
        base_from_tip: Pose::from_translation_xyzw([1.0, 2.0, 3.0], turned),
        velocity_m_s: Vector3::new(0.1, 0.0, 0.0),
        angular_velocity_rad_s: Vector3::new(0.0, 0.4, 0.0),
    };
    let later = goal.after(0.5).base_from_tip;
    assert!((later.translation() - Vector3::new(1.05, 2.0, 3.0)).norm() < 1e-12);
    let turn = later.rotation() * goal.base_from_tip.rotation().inverse();
    assert!((turn.scaled_axis() - Vector3::new(0.0, 0.2, 0.0)).norm() < 1e-12);
}
