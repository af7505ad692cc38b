//! CoppeliaSim's UR5: its geometry as in the model, and its configurations in closed form.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::inverse::{pose_error, wrap};
use super::{Arm, ArmKind, DlsOptions, IkError, JointRange, Obstacle};
use handeye_geometry::frames::Pose;

type JointAngles = [f64; 6];

static ARM: LazyLock<Arm> = LazyLock::new(|| ArmKind::Ur5Coppeliasim.arm());

/// Poses of all parts in the frame of the model, 14.65 mm above the mounting plane.
#[expect(clippy::struct_field_names, reason = "all of it is in the frame of the arm")]
struct ArmPose {
    arm_from_joint: Vec<Isometry3<f64>>,
    arm_from_link: Vec<Isometry3<f64>>,
    arm_from_connection: Isometry3<f64>,
}

fn forward(joints: &JointAngles) -> ArmPose {
    let frames = ARM.frames(joints).unwrap();
    ArmPose {
        arm_from_joint: frames.base_from_joint,
        arm_from_link: frames.base_from_link,
        arm_from_connection: frames.base_from_flange * ARM.flange_from_tip,
    }
}

fn inverse_all(goal: &Isometry3<f64>) -> Vec<JointAngles> {
    let found = ARM.configurations(&Pose::from_isometry(*goal)).expect("it has a closed form");
    found.into_iter().map(|joints| joints.try_into().unwrap()).collect()
}

/// One revolution either way for every joint, as in the stock model.
fn turns() -> [JointRange; 6] {
    ArmKind::Ur5Coppeliasim.ranges()
}

fn inverse_nearest(
    goal: &Isometry3<f64>,
    seed: &JointAngles,
    ranges: &[JointRange; 6],
) -> Result<JointAngles, IkError> {
    let found = ARM.clone().with_ranges(ranges).unwrap().inverse(&Pose::from_isometry(*goal), seed)?;
    Ok(found.try_into().unwrap())
}

/// Rounding of a chain of a dozen products of numbers around one.
const ROUNDING: f64 = 1e-14;
/// Accuracy of a closed form.
const EXACT: f64 = 1e-12;

fn miss(joints: &JointAngles, goal: &Isometry3<f64>) -> f64 {
    pose_error(&forward(joints).arm_from_connection, goal).norm()
}

/// Result of [`Arm::descend`] for a tool on the connection.
fn descend(
    goal: &Isometry3<f64>,
    tool: &Isometry3<f64>,
    seed: &JointAngles,
    options: &DlsOptions,
) -> Option<JointAngles> {
    let arm = ARM.clone().mounted(ARM.base_from_first, ARM.flange_from_tip * tool);
    let found = arm.descend(&Pose::from_isometry(*goal), seed, options).unwrap();
    found.map(|joints| JointAngles::try_from(joints).unwrap())
}

/// Velocity of the origin of a tool on the connection, and rate of turn, by the velocity of each joint.
fn jacobian_at(joints: &JointAngles, tool: &Isometry3<f64>) -> Matrix6<f64> {
    let arm = ARM.clone().mounted(ARM.base_from_first, ARM.flange_from_tip * tool);
    arm.jacobian(joints).unwrap().fixed_columns::<6>(0).into_owned()
}

fn jacobian(joints: &JointAngles) -> Matrix6<f64> {
    jacobian_at(joints, &Isometry3::identity())
}

fn any_joints() -> impl Strategy<Value = JointAngles> {
    proptest::array::uniform6(-TAU..TAU)
}

#[test]
fn the_arm_stands_straight_up_at_zero() {
    let pose = forward(&[0.0; 6]).arm_from_connection;
    assert!((pose.translation.vector - Vector3::new(-0.18495, 0.0, 0.98655)).norm() < ROUNDING);
    let axes = [(Vector3::x(), Vector3::z()), (Vector3::y(), Vector3::y()), (Vector3::z(), -Vector3::x())];
    for (axis, in_arm) in axes {
        assert!((pose.rotation * axis - in_arm).norm() < ROUNDING);
    }
}

#[test]
fn joint_axes_at_zero_are_those_of_the_model() {
    let pose = forward(&[0.0; 6]);
    let up = Vector3::z();
    let side = -Vector3::x();
    // Point on each axis; along the axis it is arbitrary, so only the distance across is compared.
    let model = [
        (Vector3::zeros(), up),
        (Vector3::new(0.0, 0.0, 0.07455), side),
        (Vector3::new(0.0, 0.0, 0.49965), side),
        (Vector3::new(0.0, 0.0, 0.8918), side),
        (Vector3::new(-0.11, 0.0, 0.0), up),
        (Vector3::new(0.0, 0.0, 0.98655), side),
    ];
    for (i, (point, axis)) in model.into_iter().enumerate() {
        let joint = pose.arm_from_joint[i];
        assert!((joint.rotation * Vector3::z() - axis).norm() < ROUNDING, "direction of joint {}", i + 1);
        let across = (joint.translation.vector - point).cross(&axis).norm();
        assert!(across < ROUNDING, "joint {} is {across} m beside its axis", i + 1);
    }
}

#[test]
fn a_joint_turns_what_follows_it_about_its_own_z() {
    let joints = [0.3, -0.7, 1.1, 0.4, -0.9, 2.0];
    let before = forward(&joints);
    for i in 0..6 {
        let mut turned = joints;
        turned[i] += 0.25;
        let after = forward(&turned);
        let spin = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.25);
        let expected =
            before.arm_from_joint[i] * spin * before.arm_from_joint[i].inverse() * before.arm_from_connection;
        assert!(pose_error(&after.arm_from_connection, &expected).norm() < ROUNDING);
        assert_eq!(after.arm_from_joint[i], before.arm_from_joint[i], "the fixed frame does not move");
        assert!(
            (after.arm_from_link[i].translation.vector - before.arm_from_link[i].translation.vector).norm() < ROUNDING
        );
    }
}

/// The connection of the public scene's start configuration, from an independent chain of revolute axes read off the
/// model's zero pose.
#[test]
fn the_start_configuration_agrees_with_a_product_of_exponentials() {
    let joints = [0.0_f64, 45.0, -60.0, 0.0, 90.0, 0.0].map(f64::to_radians);
    let axes = [
        (Vector3::z(), Point3::new(0.0, 0.0, 0.0)),
        (-Vector3::x(), Point3::new(0.0, 0.0, 0.07455)),
        (-Vector3::x(), Point3::new(0.0, 0.0, 0.49965)),
        (-Vector3::x(), Point3::new(0.0, 0.0, 0.8918)),
        (Vector3::z(), Point3::new(-0.11, 0.0, 0.0)),
        (-Vector3::x(), Point3::new(0.0, 0.0, 0.98655)),
    ];
    let mut expected = Isometry3::identity();
    for ((axis, point), angle) in axes.into_iter().zip(joints) {
        let spin = UnitQuaternion::from_scaled_axis(axis * angle);
        expected *= Translation3::from(point.coords) * spin * Translation3::from(-point.coords);
    }
    let zero = Isometry3::from_parts(
        Translation3::new(-0.18495, 0.0, 0.98655),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -FRAC_PI_2),
    );
    assert!(miss(&joints, &(expected * zero)) < ROUNDING);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn every_branch_reaches_the_pose_and_one_is_the_way_it_was_made(joints in any_joints()) {
        let goal = forward(&joints).arm_from_connection;
        let branches = inverse_all(&goal);
        prop_assert!(!branches.is_empty() && branches.len() <= 8);
        for branch in &branches {
            prop_assert!(miss(branch, &goal) < EXACT, "misses by {}", miss(branch, &goal));
            prop_assert!(branch.iter().all(|q| *q > -PI && *q <= PI));
        }
        let original = branches.iter().any(|b| b.iter().zip(&joints).all(|(a, b)| wrap(a - b).abs() < 1e-6));
        prop_assert!(original, "{branches:?} lacks {joints:?}");
        for (i, a) in branches.iter().enumerate() {
            for b in &branches[i + 1..] {
                prop_assert!(a.iter().zip(b).any(|(a, b)| wrap(a - b).abs() > 1e-7), "two branches are one");
            }
        }
    }

    #[test]
    fn the_nearest_configuration_to_a_seed_beside_it_is_itself(
        joints in any_joints(), nudge in proptest::array::uniform6(-0.01..0.01),
    ) {
        // Close to a singularity two branches are as close as the nudge; neither is the better choice.
        prop_assume!(jacobian(&joints).determinant().abs() > 1e-3);
        let goal = forward(&joints).arm_from_connection;
        let seed: JointAngles = std::array::from_fn(|i| f64::clamp(joints[i] + nudge[i], -TAU, TAU));
        let found = inverse_nearest(&goal, &seed, &turns())?;
        for (a, b) in found.iter().zip(&joints) {
            prop_assert!((a - b).abs() < 1e-9, "{found:?} is not {joints:?}");
        }
    }

    #[test]
    fn the_jacobian_is_the_derivative(joints in any_joints(), offset in proptest::array::uniform3(-0.3..0.3_f64)) {
        const H: f64 = 1e-6;
        let tool = Isometry3::from_parts(Translation3::from(offset), UnitQuaternion::from_euler_angles(0.3, 1.0, -2.0));
        let analytic = jacobian_at(&joints, &tool);
        for i in 0..6 {
            let at = |delta: f64| {
                let mut moved = joints;
                moved[i] += delta;
                forward(&moved).arm_from_connection * tool
            };
            let numeric: Vector6<f64> = pose_error(&at(-H), &at(H)) / (2.0 * H);
            // Central differences: H² times a third derivative of about one, and rounding over 2 H.
            prop_assert!((analytic.column(i) - numeric).norm() < 1e-8);
        }
    }

    #[test]
    fn damped_least_squares_ends_within_its_precision(
        joints in any_joints(), nudge in proptest::array::uniform6(-0.05..0.05),
    ) {
        prop_assume!(jacobian(&joints).determinant().abs() > 3e-3);
        let tool = Isometry3::translation(0.0, 0.0, 0.017);
        let goal = forward(&joints).arm_from_connection * tool;
        let seed: JointAngles = std::array::from_fn(|i| f64::clamp(joints[i] + nudge[i], -TAU, TAU));
        let options = DlsOptions::default();
        let found = descend(&goal, &tool, &seed, &options);
        prop_assert!(found.is_some());
        if let Some(found) = found {
            let error = pose_error(&(forward(&found).arm_from_connection * tool), &goal);
            prop_assert!(error.fixed_rows::<3>(0).norm() <= options.precision_m);
            prop_assert!(error.fixed_rows::<3>(3).norm() <= options.precision_rad);
        }
    }
}

#[test]
fn a_generic_pose_has_eight_configurations() {
    let goal = forward(&[0.4, 0.3, -1.4, 0.5, 1.2, 0.7]).arm_from_connection;
    assert_eq!(inverse_all(&goal).len(), 8);
}

#[test]
fn a_straight_wrist_keeps_the_sixth_joint_of_the_seed() {
    // Joint 5 at zero makes axes 4 and 6 parallel.
    let joints = [0.2, 0.6, -1.3, 0.4, 0.0, 1.1];
    let goal = forward(&joints).arm_from_connection;
    for branch in inverse_all(&goal) {
        assert!(miss(&branch, &goal) < EXACT);
    }
    let found = inverse_nearest(&goal, &joints, &turns()).unwrap();
    for (a, b) in found.iter().zip(&joints) {
        assert!((a - b).abs() < 1e-9, "{found:?}");
    }
}

#[test]
fn near_the_wrist_singularity_solutions_stay_exact() {
    for exponent in 1..14 {
        let joints = [0.2, 0.6, -1.3, 0.4, 10f64.powi(-exponent), 1.1];
        let goal = forward(&joints).arm_from_connection;
        let found = inverse_nearest(&goal, &joints, &turns()).unwrap();
        assert!(miss(&found, &goal) < EXACT, "joint 5 at 1e-{exponent}");
        // The closer the singularity the less the pose determines joint 6, but it must not jump away.
        assert!((found[5] - joints[5]).abs() < 1e-2, "joint 5 at 1e-{exponent}: {found:?}");
    }
}

#[test]
fn a_stretched_arm_is_reached() {
    let joints = [0.2, 0.6, 0.0, 0.4, 0.9, 1.1];
    let goal = forward(&joints).arm_from_connection;
    let found = inverse_nearest(&goal, &joints, &turns()).unwrap();
    assert!(miss(&found, &goal) < 1e-8);
}

#[test]
fn goals_out_of_reach_say_by_how_much() {
    let at = |x: f64, y: f64, z: f64| Isometry3::translation(x, y, z);
    let seed = [0.0; 6];
    let error = |goal: &Isometry3<f64>| inverse_nearest(goal, &seed, &turns()).unwrap_err();
    let far = error(&at(1.5, 0.0, 0.3));
    assert!(matches!(far, IkError::Unreachable { obstacle: Obstacle::TooFar { .. } }), "{far}");
    assert!(far.to_string().contains("closer to the robot"), "{far}");
    let column = error(&at(0.01, 0.0, 0.5));
    assert!(matches!(column, IkError::Unreachable { obstacle: Obstacle::InColumn { .. } }), "{column}");
    assert_eq!(error(&at(f64::NAN, 0.0, 0.0)), IkError::NotFinite);
    assert!(inverse_all(&at(1.5, 0.0, 0.3)).is_empty());
    assert!(inverse_all(&at(f64::INFINITY, 0.0, 0.3)).is_empty());
}

#[test]
fn moving_a_far_goal_by_the_stated_amount_brings_it_into_reach() {
    let base = forward(&[0.0, 0.9, 0.0, 0.3, 1.2, 0.0]).arm_from_connection;
    // Outwards along the stretched arm, in its plane.
    let outwards = (forward(&[0.0, 0.9, 0.0, 0.3, 1.2, 0.0]).arm_from_joint[3].translation.vector
        - Vector3::new(0.0, 0.0, 0.07455))
    .normalize();
    let far = Translation3::from(outwards * 0.05) * base;
    let error = inverse_nearest(&far, &[0.0; 6], &turns()).unwrap_err();
    let IkError::Unreachable { obstacle: Obstacle::TooFar { needed_m, reach_m } } = error else {
        panic!("{error}");
    };
    let back = Translation3::from(-outwards * (needed_m - reach_m + 1e-6)) * far;
    assert!(inverse_nearest(&back, &[0.0; 6], &turns()).is_ok());
}

#[test]
fn limits_that_exclude_every_branch_name_the_joint() {
    let joints = [0.4, 0.3, -1.4, 0.5, 1.2, 0.7];
    let goal = forward(&joints).arm_from_connection;
    let mut limits = turns();
    (limits[5].min, limits[5].max) = (3.0, 3.05);
    let error = inverse_nearest(&goal, &joints, &limits).unwrap_err();
    let IkError::OutsideLimits { joint, needed_deg, min_deg, max_deg } = error else { panic!("{error}") };
    assert_eq!(joint, 5);
    assert!(needed_deg < min_deg || needed_deg > max_deg);
    assert!(error.to_string().contains("joint 6"), "{error}");
}

#[test]
fn a_joint_range_of_its_own_is_filled_by_a_full_turn() {
    // The public scene's joint 6 runs from 0 to two turns.
    let joints = [0.4, 0.3, -1.4, 0.5, 1.2, -0.7];
    let goal = forward(&joints).arm_from_connection;
    let mut limits = turns();
    (limits[5].min, limits[5].max) = (0.0, 2.0 * TAU);
    let mut seed = joints;
    seed[5] = 5.0;
    let found = inverse_nearest(&goal, &seed, &limits).unwrap();
    assert!((found[5] - (TAU - 0.7)).abs() < 1e-9, "{found:?}");
}

/// One pass of the simulation moves the goal by little; the arm must follow it in a few iterations.
#[test]
fn damped_least_squares_converges_at_once_when_the_goal_is_near() {
    let seed = [0.0_f64, 45.0, -60.0, 0.0, 90.0, 0.0].map(f64::to_radians);
    let tool = Isometry3::translation(0.0, 0.0, 0.017);
    let turn = UnitQuaternion::from_euler_angles(0.02, -0.03, 0.02);
    let start = forward(&seed).arm_from_connection * tool;
    let goal = start * Isometry3::from_parts(Translation3::new(0.01, -0.02, 0.01), turn);
    let options = DlsOptions { iterations: 3, precision_m: 1e-4, precision_rad: 1e-3, ..DlsOptions::default() };
    assert!(descend(&goal, &tool, &seed, &options).is_some());
}

#[test]
fn damped_least_squares_gives_up_on_a_goal_out_of_reach() {
    let goal = Isometry3::translation(1.5, 0.0, 0.3);
    let tool = Isometry3::identity();
    let seed = [0.0, 0.7, -1.0, 0.0, 1.5, 0.0];
    assert_eq!(descend(&goal, &tool, &seed, &DlsOptions::default()), None);
}
