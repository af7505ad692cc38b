use std::f64::consts::PI;

use nalgebra::Matrix3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
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

#[test]
fn at_zero_the_modelled_ur5_stands_straight_up_with_its_flange_towards_minus_x() {
    let tip = model_ur5().forward(&[0.0; 6]).expect("six joints");
    assert!((tip.translation() - Vector3::new(-0.184_95, 0.0, 0.986_55)).norm() < 1e-14);
    let axes = tip.rotation().to_rotation_matrix();
    let expected = Matrix3::new(0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
    assert!((axes.matrix() - expected).norm() < 1e-14);
}

#[test]
fn the_ur5_of_the_manufacturer_is_where_its_table_puts_it() {
    let arm = ArmModel::Kind(ArmKind::Ur5).arm().expect("built in");
    // At zero the arm is stretched along −x; the wrist goes down by d5 and to −y by d4 + d6.
    let tip = arm.forward(&[0.0; 6]).expect("six joints");
    let expected = Vector3::new(-0.425 - 0.392_25, -0.109_15 - 0.0823, 0.089_159 - 0.094_65);
    assert!((tip.translation() - expected).norm() < 1e-14, "{tip:?}");
    // Upright: the links and d5 add up above the shoulder, the wrist stays to the side.
    let up = arm.forward(&[0.0, -PI / 2.0, 0.0, -PI / 2.0, 0.0, 0.0]).expect("six joints");
    let expected = Vector3::new(0.0, -0.191_45, 0.089_159 + 0.425 + 0.392_25 + 0.094_65);
    assert!((up.translation() - expected).norm() < 1e-12, "{up:?}");
}

#[test]
fn a_joint_that_sits_elsewhere_takes_along_what_is_behind_it() {
    let arm = mounted();
    let off = se3::exp(&Vector6::new(0.01, -0.02, 0.03, 0.1, 0.2, -0.3));
    for q in configurations(5) {
        let (frames, tip) = (arm.frames(&q).expect("six joints"), arm.forward(&q).expect("six joints"));
        for joint in 0..6 {
            let displacements: Vec<_> = (0..6).map(|j| if j == joint { off } else { Isometry3::identity() }).collect();
            let displaced = arm.displaced(&displacements).expect("six joints").forward(&q).expect("six joints");
            let base_from_joint = frames.base_from_joint[joint] * arm.joints()[joint].joint_from_axis();
            let expected = base_from_joint * off * base_from_joint.inverse() * tip.isometry();
            assert!((expected.to_homogeneous() - displaced.isometry().to_homogeneous()).amax() < 1e-14, "{joint}");
        }
    }
    assert_eq!(arm.displaced(&[Isometry3::identity(); 6]), Ok(arm.clone()));
    assert_eq!(arm.displaced(&[off; 5]), Err(ArmError::WrongCount { got: 5, need: 6 }));
    let far = Isometry3::translation(0.0, f64::NAN, 0.0);
    assert!(matches!(arm.displaced(&[far; 6]), Err(ArmError::BadJoint { joint: 1, .. })));
}

#[test]
fn twists_are_the_central_differences_of_the_forward_kinematics() {
    // The error of a central difference is h²/6 times a third derivative of order one, and rounding over h.
    const STEP: f64 = 1e-5;
    let arm = mounted();
    for q in configurations(20) {
        let tip = arm.forward(&q).expect("six joints");
        let twists = arm.tip_by_joint(&q).expect("six joints");
        assert_eq!(twists.len(), 6);
        for (j, twist) in twists.iter().enumerate() {
            let moved = |step: f64| {
                let mut q = q.clone();
                q[j] += step;
                se3::log((tip.inverse() * arm.forward(&q).expect("six joints")).isometry())
            };
            let difference = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            assert!((difference - twist).norm() < 1e-9, "joint {}: {difference} is not {twist}", j + 1);
        }
    }
}

/// A chain with both kinds of joints, skew axes, and a tool.
fn askew() -> Arm {
    let place = |numbers: [f64; 6]| se3::exp(&Vector6::from(numbers));
    let joint = |kind, numbers, axis: [f64; 3]| Joint {
        name: format!("{kind}"),
        kind,
        previous_from_joint: place(numbers),
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
    let arm = Arm::new(joints, place([0.0, 0.0, 0.1, 0.5, 0.0, 0.0])).expect("an arm");
    arm.mounted(place([0.4, -0.2, 0.7, 0.3, -0.2, 1.1]), place([0.01, 0.03, 0.12, -0.4, 0.2, 0.5]))
}

#[test]
fn a_prismatic_joint_shifts_what_is_behind_it_along_its_axis_and_turns_nothing() {
    let arm = askew();
    let q = [0.1, -0.4, 0.8, 0.2, 1.3];
    let (here, frames) = (arm.forward(&q).expect("five joints"), arm.frames(&q).expect("five joints"));
    for (j, joint) in arm.joints().iter().enumerate().filter(|(_, joint)| joint.kind == JointKind::Prismatic) {
        let mut moved = q;
        moved[j] += 0.25;
        let there = arm.forward(&moved).expect("five joints");
        let way = frames.base_from_joint[j].rotation * joint.axis.into_inner() * 0.25;
        assert!((there.translation() - here.translation() - way).norm() < 1e-14, "joint {}", j + 1);
        assert!(there.rotation().angle_to(&here.rotation()) < 1e-7, "acos near 1 has half the digits");
    }
}

#[test]
fn twists_and_jacobian_of_both_kinds_of_joints_are_the_central_differences() {
    const STEP: f64 = 1e-5;
    let arm = askew();
    for q in configurations(20) {
        let q = &q[..5];
        let tip = arm.forward(q).expect("five joints");
        let (twists, jacobian) = (arm.tip_by_joint(q).expect("five joints"), arm.jacobian(q).expect("five joints"));
        for (j, twist) in twists.iter().enumerate() {
            let at = |step: f64| {
                let mut q = q.to_vec();
                q[j] += step;
                arm.forward(&q).expect("five joints")
            };
            let moved = |step: f64| se3::log((tip.inverse() * at(step)).isometry());
            let difference = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            assert!((difference - twist).norm() < 1e-9, "joint {}: {difference} is not {twist}", j + 1);
            let column = jacobian.column(j);
            let velocity = (at(STEP).translation() - at(-STEP).translation()) / (2.0 * STEP);
            assert!((column.fixed_rows::<3>(0) - velocity).norm() < 1e-9, "joint {}", j + 1);
            let turn = se3::rotation_vector(&(at(STEP).rotation() * at(-STEP).rotation().inverse())) / (2.0 * STEP);
            assert!((column.fixed_rows::<3>(3) - turn).norm() < 1e-9, "joint {}", j + 1);
        }
    }
}

#[test]
fn the_arms_of_universal_robots_are_where_the_maker_puts_them() {
    // The manufacturer's table again, in millimetres: shoulder height, upper arm, forearm, and the offsets of the wrist to
    // the side, below and in front. The resulting place of the tip is read off the arm's drawing.
    let published = [
        (ArmKind::Ur3, [151.9, 243.65, 213.25, 112.35, 85.35, 81.9]),
        (ArmKind::Ur5, [89.159, 425.0, 392.25, 109.15, 94.65, 82.3]),
        (ArmKind::Ur10, [127.3, 612.0, 572.3, 163.941, 115.7, 92.2]),
        (ArmKind::Ur3e, [151.85, 243.55, 213.2, 131.05, 85.35, 92.1]),
        (ArmKind::Ur5e, [162.5, 425.0, 392.2, 133.3, 99.7, 99.6]),
        (ArmKind::Ur10e, [180.7, 612.7, 571.55, 174.15, 119.85, 116.55]),
        (ArmKind::Ur16e, [180.7, 478.4, 360.0, 174.15, 119.85, 116.55]),
    ];
    for (kind, mm) in published {
        let [shoulder, upper, fore, beside, below, front] = mm.map(|mm| mm * 1e-3);
        let arm = kind.arm();
        let at = |q: [f64; 6]| arm.forward(&q).expect("six joints").translation();
        let flat = Vector3::new(-upper - fore, -beside - front, shoulder - below);
        assert!((at([0.0; 6]) - flat).norm() < 1e-12, "{}", kind.name());
        let bent = Vector3::new(-fore, -beside - front, shoulder + upper - below);
        assert!((at([0.0, -PI / 2.0, PI / 2.0, 0.0, 0.0, 0.0]) - bent).norm() < 1e-12, "{}", kind.name());
        assert!(arm.joints().iter().all(|joint| joint.range.contains(2.0 * PI) && joint.range.speed > 2.0));
        assert_eq!(arm.first_violation(&[0.0, 0.0, 6.5, 0.0, 0.0, 0.0]), Some(2));
    }
}

#[test]
fn joints_that_no_arm_has_are_refused_by_name() {
    let good = askew().joints()[1].clone();
    let refused = |joint: Joint| match Arm::new(vec![good.clone(), joint], Isometry3::identity()) {
        Err(ArmError::BadJoint { joint: 2, name, defect }) if name == "revolute" => defect,
        other => panic!("{other:?}"),
    };
    let far = Isometry3::translation(0.0, 425.0, 0.0);
    let defect = refused(Joint { previous_from_joint: far, ..good.clone() });
    assert!(defect.to_string().contains("lengths are in metres"), "{defect}");
    let lost = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert_eq!(refused(Joint { previous_from_joint: lost, ..good.clone() }), JointDefect::NotFinite);
    let none = nalgebra::UnitVector3::new_normalize(Vector3::zeros());
    assert_eq!(refused(Joint { axis: none, ..good.clone() }), JointDefect::Axis);
    let ranges = [(1.0, -1.0, 1.0), (f64::NAN, 1.0, 1.0), (f64::INFINITY, f64::INFINITY, 1.0), (-1.0, 1.0, 0.0)];
    for (min, max, speed) in ranges {
        let range = JointRange { min, max, speed };
        assert!(matches!(refused(Joint { range, ..good.clone() }), JointDefect::Range { .. }), "{range:?}");
        assert!(Arm::new(vec![good.clone()], Isometry3::identity()).expect("good").with_ranges(&[range]).is_err());
    }
    assert_eq!(Arm::new(Vec::new(), Isometry3::identity()), Err(ArmError::JointCount { got: 0 }));
}

#[test]
fn at_the_reported_tip_the_tool_of_the_arm_does_not_matter() {
    let arm = mounted();
    let other_tool = arm.clone().mounted(arm.base_from_first, Isometry3::translation(0.0, 5.0, 0.0));
    for q in configurations(5) {
        let tip = arm.forward(&q).expect("six joints");
        let at_tip = other_tool.tip_from_joints(&tip, &q).expect("six joints");
        for (a, b) in at_tip.iter().zip(arm.tip_by_joint(&q).expect("six joints")) {
            assert!((tip_by_joint(a) - b).norm() < 1e-12);
        }
    }
}

#[test]
fn rows_and_angles_that_no_arm_has_are_refused() {
    let row = |numbers| ArmModel::Dh(vec![numbers]).arm();
    assert!(row([0.4, PI / 2.0, 0.1, 0.0]).is_ok());
    assert!(matches!(row([425.0, 0.0, 0.0, 0.0]), Err(ArmError::BadRow { joint: 1, name: "a", .. })));
    assert!(matches!(row([0.0, 90.0, 0.0, 0.0]), Err(ArmError::BadRow { name: "alpha", .. })));
    assert!(matches!(row([0.0, 0.0, f64::NAN, 0.0]), Err(ArmError::BadRow { name: "d", .. })));
    assert_eq!(ArmModel::Dh(Vec::new()).arm(), Err(ArmError::JointCount { got: 0 }));
    assert_eq!(ArmModel::Dh(vec![[0.0; 4]; 13]).arm(), Err(ArmError::JointCount { got: 13 }));
    let arm = model_ur5();
    assert_eq!(arm.forward(&[0.0; 5]), Err(ArmError::WrongCount { got: 5, need: 6 }));
    assert_eq!(arm.tip_by_joint(&[0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0]), Err(ArmError::NotFinite { joint: 3 }));
}

#[test]
fn files_name_an_arm_by_its_kind_or_its_rows() {
    for kind in ArmKind::ALL {
        let text = serde_json::to_string(&ArmModel::Kind(kind)).expect("text");
        assert_eq!(text, format!("{{\"kind\":\"{}\"}}", kind.name()));
        assert_eq!(serde_json::from_str::<ArmModel>(&text).expect("read"), ArmModel::Kind(kind));
    }
    let rows = ArmModel::Dh(vec![[0.1, 0.0, 0.2, 1.0 / 3.0]]);
    let text = serde_json::to_string(&rows).expect("text");
    assert_eq!(text, "{\"dh\":[[0.1,0.0,0.2,0.3333333333333333]]}");
    assert_eq!(serde_json::from_str::<ArmModel>(&text).expect("read"), rows);
}
