use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;

use super::*;

fn reading(stamp_s: f64, x_m: f64, turn_rad: f64) -> Reading {
    let pose = Isometry3::new(Vector3::new(x_m, 0.0, 0.5), Vector3::z() * turn_rad);
    Reading {
        stamp_s,
        base_from_tip: Pose::from_isometry(pose),
        joints: Some(JointValues::from([turn_rad])),
        moving: Some(false),
    }
}

/// States of an arm that turns about the base at 1 rad/s, fifty a second.
fn turning(count: usize) -> States {
    let mut states = States::default();
    for i in 0..count {
        let stamp_s = 0.02 * i as f64;
        let pose = Isometry3::rotation(Vector3::z() * stamp_s) * Isometry3::translation(0.5, 0.0, 0.3);
        let joints = Some(JointValues::from([stamp_s]));
        let base_from_tip = Pose::from_isometry(pose);
        states.add(Reading { stamp_s, base_from_tip, joints, moving: Some(true) }).unwrap();
    }
    states
}

proptest! {
    #[test]
    fn a_turning_arm_is_where_it_was_at_any_instant_between_two_states(stamp_s in 0.001..1.9) {
        let at = turning(100).at(stamp_s).unwrap();
        let truth = Isometry3::rotation(Vector3::z() * stamp_s) * Isometry3::translation(0.5, 0.0, 0.3);
        let (off_m, off_rad) = at.base_from_tip.distance_to(&Pose::from_isometry(truth));
        // The screw between two poses of one turn is that turn: exact to rounding.
        prop_assert!(off_m < 1e-9 && off_rad < 1e-9, "{off_m} m, {off_rad} rad");
        prop_assert!((at.joints.unwrap()[0] - stamp_s).abs() < 1e-9);
        prop_assert!((at.turn_rad_s - 1.0).abs() < 1e-6 && at.moving == Some(true));
    }
}

#[test]
fn an_image_without_states_around_it_has_no_pose_and_says_why() {
    let mut states = States::default();
    assert_eq!(states.at(1.0), Err(NoPose::NoState));
    states.add(reading(1.0, 0.0, 0.0)).unwrap();
    assert_eq!(states.at(0.5), Err(NoPose::TooOld { by_s: 0.5 }));
    assert_eq!(states.at(1.5), Err(NoPose::TooNew { by_s: 0.5 }));
    assert!(states.at(1.0).is_ok(), "at the stamp of a state there is that state");
    states.add(reading(1.5, 0.1, 0.0)).unwrap();
    assert_eq!(states.at(1.2), Err(NoPose::Gap { gap_s: 0.5 }));
    assert!(states.at(1.5).is_err(), "what comes from the far side of a gap is no better");
}

#[test]
fn stamps_that_go_back_are_refused_and_equal_ones_are_not() {
    let mut states = States::default();
    states.add(reading(2.0, 0.0, 0.0)).unwrap();
    states.add(reading(2.0, 0.0, 0.0)).unwrap();
    let error = states.add(reading(1.999, 0.0, 0.0)).unwrap_err();
    assert!(error.to_string().contains("never go back"), "{error}");
}

#[test]
fn what_is_kept_is_bounded_by_number_and_by_time() {
    let mut fast = States::default();
    for i in 0..20_000 {
        fast.add(reading(1e-4 * f64::from(i), 0.0, 0.0)).unwrap();
    }
    assert_eq!(fast.readings.len(), MOST);
    let mut slow = States::default();
    for i in 0..2000 {
        slow.add(reading(0.1 * f64::from(i), 0.0, 0.0)).unwrap();
    }
    assert!(slow.readings.len() <= 102, "{}", slow.readings.len());
}

#[test]
fn the_tip_is_found_from_the_flange_and_its_tool_or_from_the_joints_of_a_known_chain() {
    let pose = |x| PoseMessage { translation_m: [x, 0.0, 0.0], rotation_xyzw: [0.0, 0.0, 0.0, 1.0] };
    let empty = StateMessage {
        stamp: 0.0,
        joints_rad: None,
        base_from_flange: None,
        flange_from_tcp: None,
        base_from_tip: None,
        moving: None,
    };
    let flange = StateMessage { base_from_flange: Some(pose(1.0)), flange_from_tcp: Some(pose(0.25)), ..empty.clone() };
    assert_eq!(Reading::of(&flange, 0, None).unwrap().base_from_tip.translation().x, 1.25);
    let both = StateMessage { base_from_tip: Some(pose(2.0)), ..flange };
    assert_eq!(Reading::of(&both, 0, None).unwrap().base_from_tip.translation().x, 2.0);
    assert!(Reading::of(&empty, 0, None).is_err());

    let arm = handeye_arm::ArmKind::Ur5e.arm();
    let joints = JointValues::from([0.1, -1.0, 1.2, -0.4, 0.3, 0.2]);
    let state = StateMessage { joints_rad: Some(joints), ..empty.clone() };
    let read = Reading::of(&state, 6, Some(&arm)).unwrap();
    assert_eq!(read.base_from_tip, arm.forward(&joints).unwrap());
    assert!(Reading::of(&state, 7, Some(&arm)).is_err(), "hello has another number of joints");
    assert!(Reading::of(&empty, 6, Some(&arm)).is_err(), "hello has joints");
}

#[test]
fn places_where_no_arm_is_and_tips_that_jump_are_named() {
    let state = |joint: f64, x_m: f64| StateMessage {
        stamp: 1.0,
        joints_rad: Some([joint].into()),
        base_from_flange: None,
        flange_from_tcp: None,
        base_from_tip: Some(PoseMessage::of(&Pose::<Base, Tip>::from_isometry(Isometry3::translation(x_m, 0.0, 0.0)))),
        moving: None,
    };
    assert!(Reading::of(&state(3.0, 0.5), 1, None).is_ok());
    let why = |joint, x_m| Reading::of(&state(joint, x_m), 1, None).unwrap_err().to_string();
    assert!(why(1e308, 0.5).contains("joint 1 at 1.000e308"), "{}", why(1e308, 0.5));
    assert!(why(0.1, 500.0).contains("500 m long"), "{}", why(0.1, 500.0));

    let mut states = States::default();
    states.add(reading(1.0, 0.4, 0.0)).unwrap();
    // A simulator that was reset, and a gap in which the arm moved.
    states.add(reading(1.02, -2.0, 0.0)).unwrap();
    let jump = states.add(reading(1.04, 8.0, 0.0)).unwrap_err().to_string();
    assert!(jump.contains("10.0 m from where it was 0.020 s before"), "{jump}");
    assert_eq!(states.newest().map(|reading| reading.stamp_s), Some(1.02), "nothing is driven by it");
}
