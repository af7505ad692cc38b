use super::*;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Relative slack on limits: the planner works with roots of polynomials of degree six.
const LIMIT_SLACK: f64 = 1e-6;

fn run(motion: &mut JointMotion, dt: f64) -> Vec<MotionStep> {
    let mut steps = Vec::new();
    loop {
        let step = motion.step(dt);
        let finished = step.finished;
        steps.push(step);
        if finished || steps.len() > 200_000 {
            return steps;
        }
    }
}

/// Velocity and acceleration within the limits, and the acceleration no steeper than the jerk between samples.
fn assert_within_limits(steps: &[MotionStep], start: &MotionState, limits: &MotionLimits, dt: f64) {
    let mut last_accel = start.accel.clone();
    for step in steps {
        for i in 0..start.pos.len() {
            let least_vel = limits.min_vel.as_ref().map_or(-limits.max_vel[i], |m| m[i]);
            let least_accel = limits.min_accel.as_ref().map_or(-limits.max_accel[i], |m| m[i]);
            assert!(step.vel[i] <= limits.max_vel[i] + LIMIT_SLACK && step.vel[i] >= least_vel - LIMIT_SLACK);
            assert!(step.accel[i] <= limits.max_accel[i] + LIMIT_SLACK && step.accel[i] >= least_accel - LIMIT_SLACK);
            let jerk = (step.accel[i] - last_accel[i]).abs() / dt;
            assert!(jerk <= limits.max_jerk[i] * (1.0 + LIMIT_SLACK) + LIMIT_SLACK, "jerk {jerk}");
        }
        last_accel.clone_from(&step.accel);
    }
}

#[test]
fn a_move_from_rest_to_rest_takes_the_known_shortest_time() {
    // Rest to rest over 4 rad with v = 1, a = 1, j = 1 reaches both limits: ramps of v/a + a/j = 2 s cover 1 rad each,
    // 2 rad are left at full speed.
    let limits = MotionLimits::uniform(1, 1.0, 1.0, 1.0);
    let motion = JointMotion::new(MotionState::at_rest(vec![0.0]), &[4.0], &[0.0], Some(&limits), Sync::Phase).unwrap();
    assert!((motion.duration_s() - 6.0).abs() < 1e-9, "{}", motion.duration_s());
    // Jerk alone limits a move of 2 j t³ with four ramps of t.
    let motion =
        JointMotion::new(MotionState::at_rest(vec![0.0]), &[0.25], &[0.0], Some(&limits), Sync::Phase).unwrap();
    assert!((motion.duration_s() - 2.0).abs() < 1e-9, "{}", motion.duration_s());
}

#[test]
fn the_end_is_exact_and_steps_tile_the_duration() {
    let limits = MotionLimits::uniform(2, 1.0, 1.0, 1.0);
    let start = MotionState::at_rest(vec![0.1, -0.2]);
    let target = [1.234_567_89, -2.345_678_9];
    let mut motion = JointMotion::new(start, &target, &[0.0; 2], Some(&limits), Sync::Phase).unwrap();
    let steps = run(&mut motion, 0.05);
    let last = steps.last().unwrap();
    assert_eq!(last.pos, target);
    assert_eq!(last.vel, [0.0; 2]);
    assert_eq!(last.accel, [0.0; 2]);
    assert_eq!(last.time_left, 0.0);
    assert_eq!(steps.len(), (motion.duration_s() / 0.05).ceil() as usize);
    assert_eq!(motion.step(0.05).pos, target, "it stays there");
}

#[test]
fn phase_synchronisation_is_straight_and_time_synchronisation_arrives_together() {
    let mut limits = MotionLimits::uniform(3, 1.0, 1.0, 2.0);
    limits.max_vel[1] = 0.3;
    let start = MotionState::at_rest(vec![0.0, 1.0, -1.0]);
    let target = [1.0, -1.0, 0.5];
    let plan = |sync| JointMotion::new(start.clone(), &target, &[0.0; 3], Some(&limits), sync).unwrap();
    for step in run(&mut plan(Sync::Phase), 0.01) {
        let part = (step.pos[0] - start.pos[0]) / (target[0] - start.pos[0]);
        for ((pos, from), to) in step.pos.iter().zip(&start.pos).zip(&target) {
            assert!((pos - from - part * (to - from)).abs() < 1e-9);
        }
    }
    // Alone the first joint arrives early; together all of them still move just before the end.
    let late = |sync| {
        let mut motion = plan(sync);
        let duration = motion.duration_s();
        motion.step(duration * 0.95).vel
    };
    assert!(late(Sync::Time).iter().all(|v| v.abs() > 0.0));
    assert_eq!(late(Sync::None)[0], 0.0);
}

#[test]
fn a_move_of_no_length_is_finished_at_once() {
    let limits = MotionLimits::uniform(6, 1.0, 1.0, 1.0);
    let here = vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    for sync in [Sync::Phase, Sync::Time, Sync::None] {
        let mut motion =
            JointMotion::new(MotionState::at_rest(here.clone()), &here, &[0.0; 6], Some(&limits), sync).unwrap();
        assert_eq!(motion.duration_s(), 0.0);
        let step = motion.step(0.05);
        assert!(step.finished);
        assert_eq!(step.pos, here);
    }
}

#[test]
fn without_limits_the_first_step_arrives() {
    let mut motion =
        JointMotion::new(MotionState::at_rest(vec![0.0; 6]), &[1.0; 6], &[0.0; 6], None, Sync::Phase).unwrap();
    let step = motion.step(0.05);
    assert!(step.finished);
    assert_eq!(step.pos, [1.0; 6]);
}

#[test]
fn a_target_velocity_is_reached_and_kept() {
    let limits = MotionLimits::uniform(1, 2.0, 1.0, 4.0);
    let mut motion =
        JointMotion::new(MotionState::at_rest(vec![0.0]), &[1.0], &[0.5], Some(&limits), Sync::Phase).unwrap();
    let duration = motion.duration_s();
    let end = motion.step(duration + 0.1);
    assert!(end.finished);
    assert_eq!(end.vel, [0.5]);
    assert!((end.pos[0] - 1.05).abs() < 1e-9, "it goes on with that velocity");
}

#[test]
fn stopping_brakes_from_full_speed_within_the_limits() {
    let limits = MotionLimits::uniform(2, 1.0, 1.0, 2.0);
    let start = MotionState::at_rest(vec![0.0, 0.0]);
    let mut moving = JointMotion::new(start, &[3.0, -2.0], &[0.0; 2], Some(&limits), Sync::Phase).unwrap();
    let duration = moving.duration_s();
    for part in [0.05, 0.2, 0.5, 0.8, 0.97] {
        let state = moving.at(duration * part).state();
        let mut stop = JointMotion::stop(state.clone(), &limits).unwrap();
        let rest = stop.target_pos().to_vec();
        let steps = run(&mut stop, 0.01);
        assert_within_limits(&steps, &state, &limits, 0.01);
        let last = steps.last().unwrap();
        assert_eq!(last.vel, [0.0; 2]);
        assert_eq!(last.pos, rest);
        // A full stop from 1 rad/s takes v/a + a/j; one that is still accelerating first has to lose that.
        assert!(stop.duration_s() <= 1.0 + 0.5 + 0.5 + 1e-9, "{}", stop.duration_s());
    }
    let mut still =
        JointMotion::stop(MotionState::at_rest(vec![0.4]), &MotionLimits::uniform(1, 1.0, 1.0, 1.0)).unwrap();
    let step = still.step(0.05);
    assert!(step.finished);
    assert_eq!(step.pos, [0.4]);
    assert_eq!(moving.step(duration).pos, [3.0, -2.0]);
}

#[test]
fn a_start_outside_the_limits_returns_into_them() {
    let limits = MotionLimits::uniform(1, 1.0, 1.0, 10.0);
    let start = MotionState { pos: vec![0.0], vel: vec![3.0], accel: vec![0.0] };
    let mut motion = JointMotion::new(start, &[1.0], &[0.0], Some(&limits), Sync::Phase).unwrap();
    let steps = run(&mut motion, 0.01);
    assert_eq!(steps.last().unwrap().pos, [1.0]);
    // Three seconds suffice to lose 2 rad/s at 1 rad/s².
    assert!(steps.iter().skip(300).all(|s| s.vel[0].abs() <= 1.0 + LIMIT_SLACK));
}

#[test]
fn unusable_numbers_are_named() {
    let rest = || MotionState::at_rest(vec![0.0; 2]);
    let limits = MotionLimits::uniform(2, 1.0, 1.0, 1.0);
    let plan = |target: &[f64], limits: &MotionLimits| {
        JointMotion::new(rest(), target, &[0.0; 2], Some(limits), Sync::Phase).unwrap_err()
    };
    assert_eq!(plan(&[1.0], &limits), MotionError::WrongLength { what: "target position", got: 1, need: 2 });
    assert!(matches!(plan(&[1.0, f64::NAN], &limits), MotionError::NotFinite { dof: 1, .. }));
    let mut zero = limits.clone();
    zero.max_jerk[1] = 0.0;
    let error = plan(&[1.0, 1.0], &zero);
    assert!(matches!(error, MotionError::BadLimit { what: "maximum jerk", dof: 1, .. }), "{error}");
    let mut wrong_sign = limits.clone();
    wrong_sign.min_vel = Some(vec![0.5, -0.5]);
    assert!(matches!(plan(&[1.0, 1.0], &wrong_sign), MotionError::BadLimit { what: "minimum velocity", dof: 0, .. }));
    let too_fast = JointMotion::new(rest(), &[1.0, 1.0], &[2.0, 0.0], Some(&limits), Sync::Phase).unwrap_err();
    assert!(matches!(too_fast, MotionError::NoProfile { .. }), "{too_fast}");
}

#[test]
fn cyclic_joints_take_the_shortest_way() {
    let tau = std::f64::consts::TAU;
    let target = shortest_way(&[3.0, 3.0, 0.0], &[-3.0, -3.0, 20.0], &[true, false]);
    assert!((target[0] - (tau - 3.0)).abs() < 1e-12);
    assert_eq!(target[1..], [-3.0, 20.0]);
}

fn any_state(dofs: usize) -> impl Strategy<Value = MotionState> {
    let list = |range: f64| proptest::collection::vec(-range..range, dofs);
    (list(6.0), list(1.0), list(1.0)).prop_map(|(pos, vel, accel)| MotionState { pos, vel, accel })
}

fn any_limits(dofs: usize) -> impl Strategy<Value = MotionLimits> {
    let list = |least: f64, most: f64| proptest::collection::vec(least..most, dofs);
    // High enough that no start of `any_state` is beyond them: v + a²/(2 j) < 2.
    (list(2.0, 6.0), list(1.0, 8.0), list(1.0, 40.0)).prop_map(|(max_vel, max_accel, max_jerk)| MotionLimits {
        max_vel,
        max_accel,
        max_jerk,
        min_vel: None,
        min_accel: None,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn every_move_keeps_its_limits_and_arrives(
        start in any_state(6),
        target in proptest::collection::vec(-6.0..6.0_f64, 6),
        limits in any_limits(6),
        sync in prop_oneof![Just(Sync::Phase), Just(Sync::Time), Just(Sync::None)],
        dt in 0.005..0.1_f64,
    ) {
        let mut motion = JointMotion::new(start.clone(), &target, &[0.0; 6], Some(&limits), sync)?;
        let steps = run(&mut motion, dt);
        assert_within_limits(&steps, &start, &limits, dt);
        prop_assert_eq!(&steps.last().expect("a motion has a last step").pos, &target);
        // The last sample of the profile itself must already be there, else the end would be a jump.
        let before = motion.at(motion.duration_s() - 2e-9);
        for (a, b) in before.pos.iter().zip(&target) {
            prop_assert!((a - b).abs() < 1e-6, "jumps by {}", (a - b).abs());
        }
    }

    #[test]
    fn every_state_can_be_stopped(start in any_state(6), limits in any_limits(6)) {
        let mut stop = JointMotion::stop(start.clone(), &limits)?;
        let steps = run(&mut stop, 0.01);
        assert_within_limits(&steps, &start, &limits, 0.01);
        prop_assert_eq!(&steps.last().expect("a motion has a last step").vel, &vec![0.0; 6]);
    }

    #[test]
    fn pose_moves_end_on_the_goal_and_keep_to_the_line(
        shift in proptest::array::uniform3(-0.5..0.5_f64),
        turn in proptest::array::uniform3(-1.5..1.5_f64),
        metric in proptest::option::of(Just([1.0, 1.0, 1.0, 0.1])),
    ) {
        let start = Isometry3::from_parts(Translation3::new(0.1, -0.3, 0.7), UnitQuaternion::from_euler_angles(2.0, 0.3, -1.0));
        let goal = Isometry3::from_parts(
            Translation3::from(start.translation.vector + Vector3::from(shift)),
            start.rotation * UnitQuaternion::from_scaled_axis(Vector3::from(turn)),
        );
        let limits = MotionLimits::uniform(if metric.is_some() { 1 } else { 4 }, 30.0, 1.0, 1.0);
        let mut motion = PoseMotion::new(&start, &goal, Some(&limits), metric, Sync::Phase)?;
        let total = motion.angle_rad();
        prop_assert!((total - Vector3::from(turn).norm()).abs() < 1e-9);
        let length = Vector3::from(shift).norm();
        loop {
            let step = motion.step(0.05);
            let travelled = (step.pose.translation.vector - start.translation.vector).norm() / length;
            let turned = step.pose.rotation.angle_to(&start.rotation) / total;
            prop_assert!((travelled - turned).abs() < 1e-6, "turns {turned} while travelling {travelled}");
            if step.finished {
                prop_assert_eq!(step.pose, goal);
                break;
            }
        }
    }
}

#[test]
fn a_pure_turn_and_a_pure_shift_and_nothing_at_all_move_too() {
    let start = Isometry3::translation(0.1, 0.2, 0.3);
    let turned = Isometry3::from_parts(start.translation, UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0));
    let shifted = Isometry3::translation(0.1, 0.2, 0.8);
    for goal in [turned, shifted, start] {
        for metric in [None, Some([1.0, 1.0, 1.0, 0.1])] {
            let limits = MotionLimits::uniform(if metric.is_some() { 1 } else { 4 }, 1.0, 1.0, 1.0);
            let mut motion = PoseMotion::new(&start, &goal, Some(&limits), metric, Sync::Phase).unwrap();
            let mut steps = 0;
            let end = loop {
                let step = motion.step(0.05);
                assert!(step.pose.translation.vector.iter().all(|v| v.is_finite()));
                steps += 1;
                if step.finished {
                    break step.pose;
                }
            };
            assert_eq!(end, goal);
            assert_eq!(steps == 1, goal == start);
        }
    }
}

#[test]
fn a_half_turn_goes_one_way_without_a_jump() {
    let start = Isometry3::identity();
    let goal = Isometry3::rotation(Vector3::new(0.0, 0.0, std::f64::consts::PI));
    let limits = MotionLimits::uniform(4, 1.0, 1.0, 1.0);
    let mut motion = PoseMotion::new(&start, &goal, Some(&limits), None, Sync::Phase).unwrap();
    let mut last = start;
    loop {
        let step = motion.step(0.05);
        assert!(step.pose.rotation.angle_to(&last.rotation) <= 0.05 * 1.0 + 1e-9, "faster than its limit");
        last = step.pose;
        if step.finished {
            break;
        }
    }
}

#[test]
fn pose_limits_of_the_wrong_length_and_a_bad_metric_are_errors() {
    let (start, goal) = (Isometry3::identity(), Isometry3::translation(0.1, 0.0, 0.0));
    let four = MotionLimits::uniform(4, 1.0, 1.0, 1.0);
    let error = PoseMotion::new(&start, &goal, Some(&four), Some([1.0; 4]), Sync::Phase).unwrap_err();
    assert_eq!(error, MotionError::WrongLength { what: "maximum velocity", got: 4, need: 1 });
    let error = PoseMotion::new(&start, &goal, None, Some([1.0, -1.0, 1.0, 1.0]), Sync::Phase).unwrap_err();
    assert!(matches!(error, MotionError::BadLimit { what: "metric", dof: 1, .. }), "{error}");
}

#[test]
fn a_target_that_needs_the_largest_acceleration_for_no_time_is_reached() {
    // 2 a³ / j² is 0.04.
    let limits = MotionLimits::uniform(4, 0.3, 2.0, 20.0);
    let target = [0.1199999999999998, -0.0100000000000004, 0.04, 0.000000000000001];
    let motion = JointMotion::new(MotionState::at_rest(vec![0.0; 4]), &target, &[0.0; 4], Some(&limits), Sync::Phase);
    let end = motion.expect("there is a profile").step(10.0);
    assert!(end.finished && end.pos == target);
}
