use std::f64::consts::PI;

use nalgebra::{Isometry3, Vector6};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use handeye_arm::{ArmKind, ArmModel, DhRow, Joint, JointRange};
use handeye_geometry::se3;
use handeye_geometry::targets::observation::tip_by_joint;

fn model_ur5() -> Arm {
    ArmModel::Kind(ArmKind::Ur5Coppeliasim).arm().expect("built in")
}

/// An arm on a table with a tool, neither of which is at an origin.
fn mounted() -> Arm {
    let foot = se3::exp(&Vector6::new(0.4, -0.2, 0.7, 0.3, -0.2, 1.1));
    let tool = se3::exp(&Vector6::new(0.01, 0.03, 0.12, -0.4, 0.2, 0.5));
    let arm = model_ur5();
    let (first, flange) = (foot * arm.base_from_first, arm.flange_from_tip * tool);
    arm.mounted(first, flange)
}

fn configurations(count: usize) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    (0..count).map(|_| (0..6).map(|_| rng.random_range(-1.5..1.5)).collect()).collect()
}

fn views<'a>(arm: &Arm, joints: &'a [Vec<f64>]) -> Vec<JointView<'a>> {
    joints.iter().map(|q| JointView { base_from_tip: arm.forward(q).expect("six joints"), joints_rad: q }).collect()
}

/// Two prismatic and three revolute joints.
fn gantry() -> Arm {
    let joint = |kind, numbers: [f64; 6], axis: [f64; 3]| Joint {
        name: format!("{kind}"),
        kind,
        previous_from_joint: se3::exp(&Vector6::from(numbers)),
        axis: nalgebra::UnitVector3::new_normalize(axis.into()),
        range: JointRange::ENDLESS,
    };
    let joints = vec![
        joint(JointKind::Prismatic, [0.1, 0.0, 0.2, 0.3, -0.2, 0.1], [1.0, 1.0, 0.0]),
        joint(JointKind::Revolute, [0.0, 0.1, 0.3, -0.5, 0.2, 0.9], [0.0, 1.0, 0.2]),
        joint(JointKind::Revolute, [0.4, 0.0, 0.0, 0.1, 1.2, -0.3], [1.0, -1.0, 0.5]),
        joint(JointKind::Prismatic, [0.0, -0.2, 0.1, 0.7, 0.1, 0.2], [0.0, 0.0, -1.0]),
        joint(JointKind::Revolute, [0.2, 0.1, 0.0, -1.0, 0.4, 0.0], [0.3, 0.0, 1.0]),
    ];
    Arm::new(joints, Isometry3::identity()).expect("an arm")
}

#[test]
fn an_arm_with_a_prismatic_joint_is_placed_and_checked_but_has_no_errors_estimated() {
    let arm = gantry();
    let joints: Vec<Vec<f64>> = configurations(10).iter().map(|q| q[..5].to_vec()).collect();
    let views = views(&arm, &joints);
    let placement = place(&gantry(), &views).expect("placed");
    placement.check().expect("they belong together");
    let refused = PlacementError::PrismaticOffset { joint: 1, name: "prismatic".to_owned() };
    assert_eq!(place_checked(&gantry(), &views).expect_err("metres"), refused);
    assert_eq!(placement.tip_from_joints(&views[0]).expect_err("metres"), refused);
}

#[test]
fn poses_and_joint_angles_tell_where_the_arm_stands_and_what_its_tool_is() {
    let arm = mounted();
    let joints = configurations(8);
    let placement = place(&model_ur5(), &views(&arm, &joints)).expect("placed");
    let apart = |a: &Isometry3<f64>, b: &Isometry3<f64>| se3::log(&a.inv_mul(b)).norm();
    assert!(apart(&placement.arm.base_from_first, &arm.base_from_first) < 1e-9);
    assert!(apart(&placement.arm.flange_from_tip, &arm.flange_from_tip) < 1e-9);
    let (rms_m, worst_rad) = (placement.rms_m(), placement.misses.iter().map(|miss| miss.1).fold(0.0, f64::max));
    assert!(rms_m < 1e-9 && worst_rad < 1e-7, "acos near 1 has half the digits");
    assert_eq!(placement.arm_of_poses(), Some(&placement.arm));
    placement.check().expect("they belong together");

    let (_, frames) = place_checked(&model_ur5(), &views(&arm, &joints)).expect("they belong together");
    for (q, found) in joints.iter().zip(&frames) {
        for (a, b) in found.iter().zip(arm.tip_by_joint(q).expect("six joints")) {
            assert!((tip_by_joint(a) - b).norm() < 1e-8);
        }
    }
}

#[test]
fn the_nominal_arm_passes_for_one_with_its_own_calibration() {
    // Half a millimetre and a tenth of a degree in every row is more than a factory's calibration changes.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut off = |size: f64| rng.random_range(-size..size);
    let nominal = model_ur5();
    let rows = ArmKind::Ur5Coppeliasim.rows().map(|row| DhRow {
        a_m: row.a_m + off(0.5e-3),
        alpha_rad: row.alpha_rad + off(0.0017),
        d_m: row.d_m + off(0.5e-3),
        theta_offset_rad: row.theta_offset_rad + off(0.0017),
    });
    let real = Arm::from_dh(&rows).expect("an arm");
    let joints = configurations(15);
    let placement = place(&nominal, &views(&real, &joints)).expect("placed");
    assert!(placement.rms_m() > 1e-4, "the arms differ");
    placement.check().expect("close enough for derivatives");
    assert_eq!(placement.arm_of_poses(), None, "its controller counts with another chain");
}

#[test]
fn angles_in_another_order_unit_or_sense_and_poses_turned_over_are_not_taken() {
    type Edit = fn(&mut [f64]);
    let arm = mounted();
    let joints = configurations(12);
    let edits: [(&str, Edit); 4] = [
        ("degrees", |q| q.iter_mut().for_each(|v| *v = v.to_degrees())),
        ("reversed", |q| q.reverse()),
        ("the third joint turns the other way", |q| q[2] = -q[2]),
        ("the zero of the second joint is elsewhere", |q| q[1] += PI / 2.0),
    ];
    for (what, edit) in edits {
        let mut wrong = joints.clone();
        for q in &mut wrong {
            edit(q);
        }
        let mixed: Vec<JointView<'_>> =
            views(&arm, &joints).iter().zip(&wrong).map(|(view, q)| JointView { joints_rad: q, ..*view }).collect();
        let error = place_checked(&model_ur5(), &mixed).expect_err(what);
        assert!(matches!(error, PlacementError::Foreign { .. }), "{what}: {error}");
    }
    let inverted: Vec<JointView<'_>> = views(&arm, &joints)
        .iter()
        .map(|view| JointView { base_from_tip: view.base_from_tip.inverse().relabel(), ..*view })
        .collect();
    assert!(matches!(place_checked(&model_ur5(), &inverted), Err(PlacementError::Foreign { .. })));
}

#[test]
fn the_view_whose_angles_are_of_another_one_is_named() {
    let arm = mounted();
    let joints = configurations(12);
    let mut rows = views(&arm, &joints);
    rows[7].joints_rad = &joints[2];
    match place_checked(&model_ur5(), &rows) {
        Err(PlacementError::Foreign { view: 8, views: 12, .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn poses_that_do_not_determine_where_the_arm_stands_are_not_used() {
    let arm = mounted();
    let joints: Vec<Vec<f64>> = (0..6).map(|i| vec![0.2 * f64::from(i), 0.5, -1.0, 0.2, 1.4, 0.3]).collect();
    let error = place(&arm, &views(&arm, &joints)).expect_err("one axis alone");
    assert!(matches!(error, PlacementError::NotPlaced(HandEyeError::ParallelAxes { .. })), "{error}");
    let error = place(&arm, &views(&arm, &joints[..2])).expect_err("two views");
    assert!(matches!(error, PlacementError::NotPlaced(HandEyeError::TooFewViews { .. })), "{error}");
}
