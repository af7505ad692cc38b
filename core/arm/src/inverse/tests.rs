use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;
use crate::ArmKind;

/// An arm as in practice: mounted somewhere, with a tool.
fn mounted(arm: Arm) -> Arm {
    let foot = se3::exp(&Vector6::new(0.4, -0.2, 0.7, 0.3, -0.2, 1.1));
    let tool = se3::exp(&Vector6::new(0.01, 0.03, 0.12, -0.4, 0.2, 0.5));
    let (first, flange) = (foot * arm.base_from_first, arm.flange_from_tip * tool);
    arm.mounted(first, flange)
}

/// The same arm without the knowledge that it has a closed form.
fn searched(arm: &Arm) -> Arm {
    Arm { ur: None, ..arm.clone() }
}

fn miss(arm: &Arm, joints: &[f64], goal: &Pose<Base, Tip>) -> f64 {
    pose_error(arm.forward(joints).expect("joints").isometry(), goal.isometry()).norm()
}

fn is_same(a: &[f64], b: &[f64], within: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| wrap(a - b).abs() < within)
}

fn any_ur() -> impl Strategy<Value = Arm> {
    (0..ArmKind::ALL.len()).prop_map(|i| mounted(ArmKind::ALL[i].arm()))
}

fn six(limit: f64) -> impl Strategy<Value = [f64; 6]> {
    proptest::array::uniform6(-limit..limit)
}

#[test]
fn every_arm_of_universal_robots_is_known_by_its_geometry_and_no_other_is_taken_for_one() {
    for kind in ArmKind::ALL {
        assert!(kind.arm().configurations(&kind.arm().forward(&[0.3; 6]).expect("six")).is_some(), "{}", kind.name());
    }
    // Turned joints and another zero are the same arm; a millimetre between axes that should cross is another.
    let mut joints = ArmKind::Ur5e.arm().joints().to_vec();
    for joint in &mut joints[1..4] {
        joint.axis = -joint.axis;
    }
    joints[4].previous_from_joint *= Isometry3::rotation(Vector3::z() * 0.8);
    let turned = Arm::new(joints.clone(), Isometry3::translation(0.0, 0.0, 0.0996)).expect("an arm");
    let q = [0.4, -0.9, 1.4, 0.5, 1.2, 0.7];
    let goal = turned.forward(&q).expect("six");
    let found = turned.inverse(&goal, &q.map(|v| v + 0.02)).expect("closed form");
    assert!(turned.configurations(&goal).is_some_and(|all| all.iter().any(|known| is_same(known, &q, 1e-9))));
    assert!(is_same(&found, &q, 1e-9), "{found:?}");
    joints[5].previous_from_joint.translation.x += 1e-3;
    let other = Arm::new(joints, Isometry3::identity()).expect("an arm");
    assert_eq!(other.configurations(&goal), None);
}

#[test]
fn a_joint_that_turns_twice_is_taken_at_the_turn_beside_where_it_is_and_never_outside_its_range() {
    let range = JointRange { min: -TAU, max: TAU, speed: 1.0 };
    assert_eq!(nearest_turn(0.5, 6.0, &range), Some(0.5), "a turn further is outside");
    assert!((nearest_turn(-0.5, 6.0, &range).expect("inside") - (TAU - 0.5)).abs() < 1e-12);
    assert!((nearest_turn(3.0, -5.0, &range).expect("inside") - (3.0 - TAU)).abs() < 1e-12);
    assert_eq!(nearest_turn(3.0, 0.0, &JointRange { min: -1.0, max: 1.0, speed: 1.0 }), None);
    assert!((nearest_turn(0.5, 100.0, &JointRange::ENDLESS).expect("endless") - 100.0).abs() <= PI);
}

#[test]
fn goals_and_values_that_are_none_are_refused() {
    let arm = ArmKind::Ur3.arm();
    let goal = arm.forward(&[0.3; 6]).expect("six");
    assert_eq!(arm.inverse(&goal, &[0.0; 5]), Err(IkError::WrongCount { got: 5, need: 6 }));
    assert_eq!(arm.inverse(&goal, &[f64::NAN; 6]), Err(IkError::NotFinite));
    let lost = Pose::from_isometry(Isometry3::translation(f64::NAN, 0.0, 0.0));
    assert_eq!(arm.inverse(&lost, &[0.0; 6]), Err(IkError::NotFinite));
    assert_eq!(searched(&arm).inverse(&lost, &[0.0; 6]), Err(IkError::NotFinite));
    assert!(arm.towards(&goal, &[0.0; 5], &DlsOptions::default()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, rng_seed: RngSeed::Fixed(2), ..ProptestConfig::default() })]

    #[test]
    fn all_configurations_reach_the_pose_and_the_one_that_made_it_is_among_them(arm in any_ur(), joints in six(PI)) {
        let goal = arm.forward(&joints).expect("six");
        let all = arm.configurations(&goal).expect("closed form");
        prop_assert!(!all.is_empty() && all.len() <= 8);
        for found in &all {
            prop_assert!(miss(&arm, found, &goal) < 1e-12, "misses by {}", miss(&arm, found, &goal));
        }
        prop_assert!(all.iter().any(|found| is_same(found, &joints, 1e-6)), "{all:?} lacks {joints:?}");
    }

    #[test]
    fn the_closed_form_finds_all_that_the_search_finds_and_never_a_farther_one(
        arm in any_ur(), joints in six(PI), near in six(PI),
    ) {
        // Close to a singularity a configuration is a valley, and the search stops anywhere in it.
        let jacobian = arm.jacobian(&joints).expect("six").fixed_columns::<6>(0).into_owned();
        prop_assume!(jacobian.determinant().abs() > 1e-4);
        let goal = arm.forward(&joints).expect("six");
        let all = arm.configurations(&goal).expect("closed form");
        let Ok(found) = searched(&arm).inverse(&goal, &near) else { return Ok(()) };
        prop_assert!(all.iter().any(|known| is_same(known, &found, 1e-5)), "{found:?} is not among {all:?}");
        let exact = arm.inverse(&goal, &near)?;
        let away = |joints: &[f64]| -> f64 { joints.iter().zip(&near).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt() };
        prop_assert!(away(&exact) < away(&found) + 1e-5, "{exact:?} is farther than {found:?}");
    }

    #[test]
    fn limits_are_kept_by_the_closed_form(
        arm in any_ur(), joints in six(PI), near in six(TAU), half in proptest::array::uniform6(0.3..4.0),
    ) {
        let ranges: Vec<JointRange> = joints
            .iter()
            .zip(half)
            .map(|(middle, half)| JointRange { min: middle - half, max: middle + 0.5 * half, speed: 1.0 })
            .collect();
        let arm = arm.with_ranges(&ranges).expect("room");
        let goal = arm.forward(&joints).expect("six");
        let found = arm.inverse(&goal, &near)?;
        prop_assert_eq!(arm.first_violation(&found), None);
        prop_assert!(miss(&arm, &found, &goal) < 1e-8);
    }
}
