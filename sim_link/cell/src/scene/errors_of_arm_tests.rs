use handeye_arm::testing::{self as arms, PANDA, SCARA, XARM6_ON_TRACK};
use handeye_arm::{ArmKind, Joint, JointRange, JointValues};
use handeye_geometry::se3;
use nalgebra::Vector6;

use super::*;
use crate::scene::tests::{TAUGHT, taught};
use crate::scene::{ResolvedScene, RobotErrors, RobotSpec, Scene, ShippedScene};
use handeye_geometry::frames::Pose;

/// Levels under which nothing is lost in rounding.
const LARGE: ArmErrorsSpec = ArmErrorsSpec { angle_deg: 1.0, length_mm: 5.0, compliance_deg: 0.5 };

/// An arm on a slanted foot and with a tool.
fn resolved(arm: Arm, arm_errors: ArmErrorsSpec, seed: u64) -> ResolvedScene {
    let robot = RobotSpec { arm_errors, ..RobotSpec::default() };
    ResolvedScene {
        robot_errors: RobotErrors::new(&robot, &arm, seed),
        world_from_arm: se3::exp(&Vector6::new(0.4, -0.2, 0.7, 0.5, -0.8, 1.1)),
        connection_from_tip: se3::exp(&Vector6::new(0.02, -0.05, 0.2, 0.3, 0.1, 0.4)),
        arm,
        ..Scene::default().resolve(seed).unwrap()
    }
}

fn arms() -> impl Iterator<Item = Arm> {
    arms::ALL.iter().map(|file| file.arm().unwrap()).chain([ArmKind::Ur5Coppeliasim.arm()])
}

/// Values in the ranges of all joints, the same in every run.
fn places(arm: &Arm) -> Vec<JointValues> {
    // Multiples of irrational numbers are spread evenly.
    let part = |place: u32, i: usize| (f64::from(place + 1) * f64::from(i as u32 + 2).sqrt()).fract();
    let place = |place| arms::values_at(arm, (0..arm.joint_count()).map(|i| part(place, i)));
    (0..20).map(|i| JointValues::try_from(&place(i)[..]).unwrap()).collect()
}

/// Joint values at the reference poses.
fn at_taught_poses(scene: &ResolvedScene) -> Vec<JointValues> {
    let mut joints = scene.start_joints;
    let mut reach = |index| {
        let arm_from_connection =
            scene.world_from_arm.inverse() * taught(index).isometry() * scene.connection_from_tip.inverse();
        let found = scene.arm.inverse(&Pose::from_isometry(arm_from_connection), &joints).unwrap();
        joints = JointValues::try_from(&found[..]).unwrap();
        joints
    };
    (0..TAUGHT.len()).map(&mut reach).collect()
}

/// How far the true tip is from the reported one at the reference poses, millimetres.
fn errors_mm(scene: &ResolvedScene) -> Vec<f64> {
    let error = |joints: &JointValues| {
        1e3 * scene.true_tip(joints, 0).unwrap().distance_to(&scene.reported_tip(joints).unwrap()).0
    };
    at_taught_poses(scene).iter().map(error).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn the_nominal_scene_reports_nominal_poses_and_stands_about_a_millimetre_or_two_elsewhere() {
    let mut scene = ShippedScene::Nominal.scene().unwrap();
    (scene.robot.repeatability_mm, scene.robot.repeatability_deg) = (0.0, 0.0);
    let mut all = Vec::new();
    for seed in 0..50 {
        let resolved = scene.resolve(seed).unwrap();
        for joints in at_taught_poses(&resolved) {
            let nominal = resolved.arm.forward(&joints).unwrap();
            let expected = resolved.world_from_arm * nominal.isometry() * resolved.connection_from_tip;
            assert_eq!(*resolved.reported_tip(&joints).unwrap().isometry(), expected);
        }
        let of_seed = mean(&errors_mm(&resolved));
        // An arm of 1 m: 17 angles of 1.2 mm at most, 10 lengths of 0.25 mm and the compliance; a few times less or more by luck.
        assert!((0.3..6.0).contains(&of_seed), "seed {seed}: {of_seed} mm");
        all.push(of_seed);
    }
    assert!((1.0..3.0).contains(&mean(&all)), "{} mm", mean(&all));
}

#[test]
fn levels_twice_as_large_put_the_tip_twice_as_far_away() {
    let mut scene = Scene::default();
    scene.robot.arm_errors = ArmErrorsSpec::NOMINAL;
    let once = errors_mm(&scene.resolve(5).unwrap());
    let ArmErrorsSpec { angle_deg, length_mm, compliance_deg } = ArmErrorsSpec::NOMINAL;
    scene.robot.arm_errors =
        ArmErrorsSpec { angle_deg: 2.0 * angle_deg, length_mm: 2.0 * length_mm, compliance_deg: 2.0 * compliance_deg };
    for (twice, once) in errors_mm(&scene.resolve(5).unwrap()).into_iter().zip(once) {
        // The combined effect of two angles of 0.1° differs from their sum by a few thousandths.
        assert!((twice / once - 2.0).abs() < 0.05, "{twice} mm and {once} mm");
    }
}

#[test]
fn without_errors_every_arm_is_where_it_says() {
    for arm in arms() {
        let scene = resolved(arm, ArmErrorsSpec::NONE, 3);
        for joints in places(&scene.arm) {
            let (reported, real) = (scene.reported_tip(&joints).unwrap(), scene.true_tip(&joints, 0).unwrap());
            assert!((reported.isometry().to_homogeneous() - real.isometry().to_homogeneous()).amax() < 1e-12);
        }
    }
}

/// The true pose once more, as nominal frames with the error of each joint put in from the tip's side.
#[test]
fn the_true_tip_is_that_of_a_chain_in_which_each_joint_is_off() {
    for arm in arms() {
        let scene = resolved(arm, LARGE, 4);
        for joints in places(&scene.arm) {
            let frames = scene.arm.frames(&joints).unwrap();
            let down = scene.world_from_arm.rotation.inverse() * -Vector3::z();
            let shares = gravity(&scene.arm, &scene.connection_from_tip, &down, &joints).unwrap();
            let mut arm_from_tip = frames.base_from_flange * scene.arm.flange_from_tip * scene.connection_from_tip;
            for (i, joint) in scene.arm.joints().iter().enumerate().rev() {
                let error = scene.robot_errors.joints[i];
                let tilt = Vector3::new(error.tilt_rad[0], error.tilt_rad[1], 0.0);
                let about_z = Vector3::z() * (error.zero_rad + error.compliance_rad * shares[i]);
                let off = Isometry3::translation(error.shift_m[0], error.shift_m[1], 0.0)
                    * UnitQuaternion::from_scaled_axis(tilt)
                    * UnitQuaternion::from_scaled_axis(about_z);
                let arm_from_axis = frames.base_from_joint[i] * joint.joint_from_axis();
                arm_from_tip = arm_from_axis * off * arm_from_axis.inverse() * arm_from_tip;
            }
            let expected = scene.world_from_arm * arm_from_tip;
            let real = scene.true_tip(&joints, 0).unwrap();
            assert!((expected.to_homogeneous() - real.isometry().to_homogeneous()).amax() < 1e-12, "{joints:?}");
            let (off_m, _) = real.distance_to(&scene.reported_tip(&joints).unwrap());
            assert!(off_m > 1e-4, "{off_m} m");
        }
    }
}

#[test]
fn a_seed_decides_the_arm_and_nothing_else_of_the_scene_changes_with_it() {
    let exact = Scene::realistic().unwrap();
    let mut scene = exact.clone();
    scene.robot.arm_errors = ArmErrorsSpec::NOMINAL;
    let [first, again, other] = [3, 3, 4].map(|seed| scene.resolve(seed).unwrap());
    assert_eq!(first.robot_errors, again.robot_errors);
    assert_ne!(first.robot_errors.joints, other.robot_errors.joints);
    let joints = first.start_joints;
    assert_eq!(first.true_tip(&joints, 1), again.true_tip(&joints, 1));
    // Every random quantity has its own stream.
    let without = exact.resolve(3).unwrap();
    assert_eq!(first.robot_errors.settled(2), without.robot_errors.settled(2));
    let as_without = ResolvedScene { robot_errors: without.robot_errors.clone(), ..first.clone() };
    assert_eq!(as_without, without);
    scene.robot.arm_errors.length_mm = 0.0;
    let shorter = scene.resolve(3).unwrap();
    for (all, some) in first.robot_errors.joints.iter().zip(&shorter.robot_errors.joints) {
        assert_eq!(JointError { shift_m: [0.0; 2], ..*all }, *some);
    }
}

#[test]
fn the_first_joint_the_zero_of_the_last_and_the_value_of_a_prismatic_one_are_exact() {
    for arm in arms() {
        let errors = drawn(&LARGE, &arm, 1);
        assert_eq!((errors.len(), errors[0]), (arm.joint_count(), JointError::default()));
        for (i, (error, joint)) in errors.iter().zip(arm.joints()).enumerate().skip(1) {
            let turns = joint.kind == JointKind::Revolute;
            let across = error.tilt_rad.into_iter().chain(error.shift_m).all(|number| number != 0.0);
            assert!(across, "joint {}: {error:?}", i + 1);
            assert_eq!(error.zero_rad != 0.0, turns && i + 1 < errors.len(), "joint {}", i + 1);
            assert_eq!(error.compliance_rad != 0.0, turns, "joint {}", i + 1);
        }
    }
    assert!(SCARA.arm().unwrap().joints()[1..].iter().any(|joint| joint.kind == JointKind::Prismatic));
}

#[test]
fn what_is_drawn_has_the_standard_deviations_of_the_scene() {
    let arm = ArmKind::Ur5Coppeliasim.arm();
    let mut sums = [0.0; 4];
    let seeds = 500;
    for error in (0..seeds).flat_map(|seed| drawn(&LARGE, &arm, seed).into_iter().skip(1)) {
        assert!(error.compliance_rad >= 0.0);
        let squares = |numbers: &[f64]| numbers.iter().map(|number| number * number).sum::<f64>();
        let of_one = [
            squares(&error.tilt_rad),
            squares(&error.shift_m),
            squares(&[error.zero_rad]),
            squares(&[error.compliance_rad]),
        ];
        sums.iter_mut().zip(of_one).for_each(|(sum, square)| *sum += square);
    }
    let stated = [1f64.to_radians(), 5e-3, 1f64.to_radians(), 0.5f64.to_radians()];
    for ((sum, stated), of_one_arm) in sums.into_iter().zip(stated).zip([10, 10, 4, 5]) {
        let count = (seeds * of_one_arm) as f64;
        let sigma = (sum / count).sqrt();
        // Five standard deviations for this many draws.
        assert!((sigma / stated - 1.0).abs() < 5.0 / (2.0 * count).sqrt(), "{sigma} instead of {stated}");
    }
}

/// Three joints about y, 0.4 m and 0.3 m apart, with the tip 0.2 m behind.
fn planar() -> Arm {
    let joint = |i: usize, x: f64| Joint {
        name: format!("joint {}", i + 1),
        kind: JointKind::Revolute,
        previous_from_joint: Isometry3::translation(x, 0.0, 0.0),
        axis: Vector3::y_axis(),
        range: JointRange::ENDLESS,
    };
    let joints = [0.0, 0.4, 0.3].into_iter().enumerate().map(|(i, x)| joint(i, x)).collect();
    Arm::new(joints, Isometry3::translation(0.2, 0.0, 0.0)).unwrap()
}

#[test]
fn a_level_arm_gives_way_downwards_and_a_hanging_one_not_at_all() {
    let errors = ArmErrorsSpec { compliance_deg: 0.5, ..ArmErrorsSpec::NONE };
    let scene = ResolvedScene {
        world_from_arm: Isometry3::identity(),
        connection_from_tip: Isometry3::identity(),
        ..resolved(planar(), errors, 2)
    };
    let [_, second, third] = [0, 1, 2].map(|i| scene.robot_errors.joints[i].compliance_rad);
    let down = -Vector3::z();
    let level = JointValues::zeros(3);
    let shares = gravity(&scene.arm, &Isometry3::identity(), &down, &level).unwrap();
    assert!(shares.iter().all(|share| (share - 1.0).abs() < 1e-12), "{shares:?}");
    let drop_m = 0.3 * second.sin() + 0.2 * (second + third).sin();
    let tip = scene.true_tip(&level, 0).unwrap().translation();
    assert!((tip.z + drop_m).abs() < 1e-12 && drop_m > 1e-4, "{tip} instead of {drop_m} m down");
    // About y, a quarter turn takes x down.
    let hanging = JointValues::from([std::f64::consts::FRAC_PI_2, 0.0, 0.0]);
    let shares = gravity(&scene.arm, &Isometry3::identity(), &down, &hanging).unwrap();
    assert!(shares.iter().all(|share| share.abs() < 1e-12), "{shares:?}");
    let off_m = scene.true_tip(&hanging, 0).unwrap().distance_to(&scene.reported_tip(&hanging).unwrap()).0;
    assert!(off_m < 1e-12, "{off_m} m");
}

/// The torque about a joint is the rate at which all that it carries comes down.
#[test]
fn the_share_of_gravity_is_how_fast_the_weights_sink_over_the_largest_and_never_more_than_one() {
    // Half a step to either side: the third derivative times h²/24, and rounding over h.
    const STEP: f64 = 1e-5;
    for arm in arms() {
        let scene = resolved(arm, LARGE, 1);
        let down = scene.world_from_arm.rotation.inverse() * -Vector3::z();
        let weights = |joints: &JointValues| -> Vec<Vector3<f64>> {
            let frames = scene.arm.frames(joints).unwrap();
            let tip = scene.reported_tip(joints).unwrap().translation();
            let place = |frame: &Isometry3<f64>| (scene.world_from_arm * frame).translation.vector;
            frames.base_from_joint.iter().map(place).chain([tip]).collect()
        };
        for joints in places(&scene.arm) {
            let shares = gravity(&scene.arm, &scene.connection_from_tip, &down, &joints).unwrap();
            let at = weights(&joints);
            for (i, share) in shares.iter().enumerate() {
                assert!(share.abs() <= 1.0, "{share}");
                if scene.arm.joints()[i].kind == JointKind::Prismatic {
                    continue;
                }
                let height = |by: f64| {
                    let mut moved = joints;
                    moved[i] += by;
                    weights(&moved)[i + 1..].iter().map(|place| place.z).sum::<f64>()
                };
                let sinks = (height(-STEP / 2.0) - height(STEP / 2.0)) / STEP;
                let stretched = |k: usize| at[i..=k].windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum::<f64>();
                let largest: f64 = (i + 1..at.len()).map(stretched).sum();
                assert!((sinks - share * largest).abs() < 1e-8, "joint {}: {sinks}, {share}", i + 1);
            }
        }
    }
}

#[test]
fn values_that_are_not_those_of_the_arm_are_refused() {
    let scene = resolved(PANDA.arm().unwrap(), LARGE, 1);
    assert!(matches!(scene.true_tip(&JointValues::zeros(6), 0), Err(ArmError::WrongCount { got: 6, need: 7 })));
    let scene = resolved(XARM6_ON_TRACK.arm().unwrap(), LARGE, 1);
    let joints = JointValues::from_fn(7, |i| if i == 2 { f64::NAN } else { 0.0 });
    assert!(matches!(scene.true_tip(&joints, 0), Err(ArmError::NotFinite { joint: 3 })));
}
