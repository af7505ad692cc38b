use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::testing::{self as arms, PANDA, SCARA, UR5, XARM6, XARM6_ON_TRACK};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3;

fn arm(file: arms::ArmFile) -> Arm {
    file.arm().expect("a good file")
}

fn miss(arm: &Arm, joints: &[f64], goal: &Pose<Base, Tip>) -> f64 {
    pose_error(arm.forward(joints).expect("joints").isometry(), goal.isometry()).norm()
}

fn draw(rng: &mut ChaCha8Rng, arm: &Arm) -> Vec<f64> {
    let parts: Vec<f64> = (0..arm.joint_count()).map(|_| rng.random_range(0.0..1.0)).collect();
    arms::values_at(arm, parts)
}

#[test]
fn of_a_thousand_goals_in_reach_of_each_arm_five_at_most_are_missed_and_no_limit_is_broken() {
    for file in [PANDA, XARM6, XARM6_ON_TRACK, SCARA] {
        let arm = arm(file);
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut missed = 0;
        for _ in 0..1000 {
            let (goal, near) = (arm.forward(&draw(&mut rng, &arm)).expect("joints"), draw(&mut rng, &arm));
            match arm.inverse(&goal, &near) {
                Ok(found) => {
                    assert!(miss(&arm, &found, &goal) < 3e-8, "{}: {}", file.name, miss(&arm, &found, &goal));
                    assert_eq!(arm.first_violation(&found), None, "{}: {found:?}", file.name);
                }
                Err(IkError::NotFound { .. }) => missed += 1,
                Err(other) => panic!("{}: {other}", file.name),
            }
        }
        assert!(missed <= 5, "{}: {missed} of 1000 missed", file.name);
    }
}

#[test]
fn a_goal_nearby_is_found_without_a_search_as_with_one_and_one_out_of_reach_is_not() {
    for file in [UR5, PANDA, XARM6, XARM6_ON_TRACK] {
        let arm = arm(file);
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let (mut found, mut same) = (0, 0);
        for _ in 0..100 {
            let near = draw(&mut rng, &arm);
            let goal: Vec<f64> = near.iter().map(|q| q + rng.random_range(-0.2..0.2)).collect();
            if arm.first_violation(&goal).is_some() {
                continue;
            }
            let goal = arm.forward(&goal).expect("joints");
            let Some(joints) = arm.inverse_nearby(&goal, &near) else { continue };
            assert!(miss(&arm, &joints, &goal) < 3e-8, "{}", file.name);
            found += 1;
            same += usize::from(arm.inverse(&goal, &near).is_ok_and(|searched| searched == joints));
        }
        assert!(found > 40 && 10 * same >= 9 * found, "{}: {same} of {found}", file.name);
        let far = Pose::from_isometry(Isometry3::translation(5.0, 0.0, 0.4));
        assert_eq!(arm.inverse_nearby(&far, &draw(&mut rng, &arm)), None);
        assert_eq!(arm.inverse_nearby(&far, &[0.0]), None);
    }
}

#[test]
fn a_goal_beyond_the_stretched_arm_is_answered_with_how_far_the_tip_stays_away() {
    let arm = arm(XARM6);
    let near = [0.0, 0.0, -1.0, 0.0, 1.0, 0.0];
    let far = Pose::from_isometry(Isometry3::translation(2.0, 0.0, 0.4));
    let Err(IkError::NotFound { distance_mm, starts, .. }) = arm.inverse(&far, &near) else { panic!("out of reach") };
    // The arm reaches some 0.76 m from its shoulder; turned as the goal asks, less.
    assert!((1100.0..1700.0).contains(&distance_mm), "{distance_mm}");
    assert_eq!(starts, STARTS as usize + 1);
}

#[test]
fn the_same_question_has_the_same_answer_to_the_bit() {
    let arm = arm(PANDA);
    let goal = arm.forward(&[0.5, 0.3, -0.4, -1.5, 0.2, 1.8, 0.9]).expect("seven");
    let near = [-1.0, -1.0, 1.0, -2.5, 1.0, 3.0, -2.0];
    let first = arm.inverse(&goal, &near).expect("in reach");
    assert_eq!(first, arm.inverse(&goal, &near).expect("in reach"));
}

#[test]
fn a_joint_without_end_stays_at_its_turn() {
    let arm = arm(SCARA);
    let goal = arm.forward(&[0.5, 1.0, 0.1, 20.0]).expect("four");
    let found = arm.inverse(&goal, &[0.3, 0.8, 0.05, 21.0]).expect("in reach");
    assert!((found[3] - 20.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn a_goal_with_joints_at_their_stops_is_reached() {
    let arm = arm(PANDA);
    let mut stops: Vec<f64> = arm.joints().iter().map(|joint| joint.range.max).collect();
    stops[1] = arm.joints()[1].range.min;
    let goal = arm.forward(&stops).expect("seven");
    let near: Vec<f64> = stops.iter().map(|q| q - 0.1).collect();
    let found = arm.inverse(&goal, &near).expect("it was there");
    assert_eq!(arm.first_violation(&found), None, "{found:?}");
    assert!(miss(&arm, &found, &goal) < 3e-8);
}

#[test]
fn the_seventh_joint_keeps_an_arm_away_from_its_limits_along_a_path() {
    let arm = arm(PANDA);
    // Joint 3 is at 96 % of its range, and joint 1 next to it could do the same.
    let start = vec![-0.9, 0.25, 2.78, -1.6, 0.4, 1.9, 0.5];
    let from = arm.forward(&start).expect("seven");
    let used = |joints: &[f64]| {
        let part = |(joint, q): (&crate::Joint, &f64)| {
            let middle = f64::midpoint(joint.range.min, joint.range.max);
            (q - middle).abs() / (joint.range.max - middle)
        };
        arm.joints().iter().zip(joints).map(part).fold(0.0, f64::max)
    };
    assert!(used(&start) > 0.95);
    let (mut joints, mut largest_step, mut second_round) = (start.clone(), 0.0_f64, 0.0_f64);
    // Twice around a circle of 80 mm and back to the start, like jogging by hand.
    for n in 1..=200 {
        let angle = std::f64::consts::TAU * f64::from(n) / 100.0;
        let shift = nalgebra::Vector3::new(angle.cos() - 1.0, angle.sin(), 0.0) * 0.08;
        let goal = Pose::from_isometry(nalgebra::Translation3::from(shift) * from.isometry());
        let next = arm.inverse(&goal, &joints).expect("in reach");
        assert!(miss(&arm, &next, &goal) < 3e-8);
        largest_step = next.iter().zip(&joints).map(|(a, b)| (a - b).abs()).fold(largest_step, f64::max);
        joints = next;
        second_round = if n > 100 { second_round.max(used(&joints)) } else { 0.0 };
    }
    // Without regard to limits 95 % are used in the second round, and more in the first.
    assert!(second_round < 0.85, "{second_round} of a range is used");
    // Five millimetres of the tip are some hundredths of a radian; no step is a jump to another posture.
    assert!(largest_step < 0.1, "{largest_step}");
    // With nothing to do it stays at its place.
    let rest = arm.inverse(&from, &joints).expect("it is there");
    assert!(rest.iter().zip(&joints).all(|(a, b)| (a - b).abs() < 1e-6), "{rest:?} is not {joints:?}");
}

#[test]
fn a_ur5_out_of_a_file_has_the_closed_form_although_its_quarter_turns_are_rounded() {
    let arm = arm(UR5);
    let goal = arm.forward(&[0.4, -0.9, 1.4, 0.5, 1.2, 0.7]).expect("six");
    let all = arm.configurations(&goal).expect("closed form");
    assert!(all.len() >= 4, "{all:?}");
    assert!(all.iter().all(|found| miss(&arm, found, &goal) < 1e-12));
    for other in [PANDA, XARM6, XARM6_ON_TRACK, SCARA] {
        assert_eq!(self::arm(other).configurations(&goal), None, "{}", other.name);
    }
}

fn any_arm() -> impl Strategy<Value = Arm> {
    (0..4_usize).prop_map(|i| arm([PANDA, XARM6, XARM6_ON_TRACK, SCARA][i]))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, rng_seed: RngSeed::Fixed(3), ..ProptestConfig::default() })]

    #[test]
    fn a_goal_beside_where_the_arm_is_is_reached_beside_it(
        arm in any_arm(),
        parts in proptest::collection::vec(0.05..0.95_f64, 7),
        nudge in proptest::collection::vec(-0.01..0.01_f64, 7),
    ) {
        let joints = arms::values_at(&arm, parts);
        // The weakest motion of the tip per motion of the joints; near a singularity a small motion of the tip is a
        // large turn.
        let singular = arm.jacobian(&joints).expect("joints").svd(false, false).singular_values;
        let weakest = singular[joints.len().min(6) - 1];
        prop_assume!(weakest > 0.05);
        let goal = arm.forward(&joints).expect("joints");
        let near: Vec<f64> = joints.iter().zip(&nudge).map(|(q, d)| q + d).collect();
        let found = arm.inverse(&goal, &near)?;
        prop_assert!(miss(&arm, &found, &goal) < 3e-8);
        // The nudge moves the tip by less than 0.05 m and rad, the motion back is that over the weakest motion, and the
        // redundant joint goes no farther.
        let moved = found.iter().zip(&near).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        prop_assert!(moved < 2.0 * 0.05 / weakest, "{near:?} went to {found:?}");
    }

    #[test]
    fn the_jacobian_of_an_arm_out_of_a_file_is_the_derivative(
        file in proptest::sample::select(arms::ALL.to_vec()), parts in proptest::collection::vec(0.0..1.0_f64, 7),
    ) {
        const H: f64 = 1e-6;
        let arm = arm(file);
        let joints = arms::values_at(&arm, parts);
        let jacobian = arm.jacobian(&joints).expect("joints");
        let tip = arm.forward(&joints).expect("joints");
        let twists = arm.tip_by_joint(&joints).expect("joints");
        for i in 0..joints.len() {
            let at = |delta: f64| {
                let mut moved = joints.clone();
                moved[i] += delta;
                arm.forward(&moved).expect("joints")
            };
            // Central differences: H² times a third derivative of about one, and rounding over 2 H.
            let numeric = pose_error(at(-H).isometry(), at(H).isometry()) / (2.0 * H);
            prop_assert!((jacobian.column(i) - numeric).norm() < 1e-8);
            let on_the_right = |delta: f64| se3::log((tip.inverse() * at(delta)).isometry());
            prop_assert!((twists[i] - (on_the_right(H) - on_the_right(-H)) / (2.0 * H)).norm() < 1e-8);
        }
    }
}
