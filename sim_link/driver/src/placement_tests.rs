use handeye_arm::JointKind;

use super::*;
use crate::message::{Ability, JointMessage, PoseMessage};

const RESTS: [[f64; 6]; 5] = [
    [0.1, -1.2, 1.4, -0.3, 1.5, 0.0],
    [0.5, -1.0, 1.2, -0.6, 1.2, 0.4],
    [-0.4, -1.4, 1.6, 0.2, 1.9, -0.5],
    [0.0, -0.8, 1.0, 0.3, 1.1, 0.9],
    [0.9, -1.1, 0.9, -0.9, 1.7, 1.3],
];

fn hello(arm: ArmKind) -> Hello {
    let joint = |i| JointMessage { name: format!("joint {i}"), kind: JointKind::Revolute, min: None, max: Some(2.0) };
    Hello {
        protocol: 1,
        name: "arm".into(),
        version: String::new(),
        clock: String::new(),
        can: vec![Ability::State, Ability::Joints, Ability::MoveJoints],
        joints: (1..=6).map(joint).collect(),
        arm: Some(ArmMessage::Name(arm.name().into())),
        base_from_arm: None,
        camera: None,
        depth_limits_m: None,
    }
}

/// A controller that has its base somewhere, and a tool that only it knows.
fn base_from_arm() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.3, -0.7, 0.4), Vector3::new(0.0, 0.0, 2.0))
}

fn tool() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.02, -0.03, 0.17), Vector3::new(0.3, 0.2, -0.4))
}

fn message(pose: Isometry3<f64>) -> PoseMessage {
    PoseMessage::of(&Pose::<Base, Tip>::from_isometry(pose))
}

/// State of a controller that is an arm of this kind, with its poses for these joints.
fn state(of: ArmKind, joints: [f64; 6], stamp: f64) -> StateMessage {
    let flange = base_from_arm() * of.arm().forward(&joints).unwrap().isometry();
    StateMessage {
        stamp,
        joints_rad: Some(joints.into()),
        base_from_flange: Some(message(flange)),
        flange_from_tcp: None,
        base_from_tip: Some(message(flange * tool())),
        moving: None,
    }
}

/// Feeds states for a second of rest each.
fn add_rest(watch: &mut ChainWatch, state: &StateMessage, from_s: f64) {
    let arm = ArmKind::Ur5e.arm();
    for i in 0..10 {
        let state = StateMessage { stamp: from_s + 0.1 * f64::from(i), ..state.clone() };
        watch.take(&state, &Reading::of(&state, 6, Some(&arm)).unwrap());
    }
}

fn watch(hello: &Hello) -> ChainWatch {
    ChainWatch::new(hello, Some(&ArmKind::Ur5e.arm())).unwrap()
}

fn known(watch: &ChainWatch) -> &ArmKinematics {
    match watch.placement() {
        ChainPlacement::Known(kinematics) => kinematics,
        other => panic!("{other:?}"),
    }
}

fn assert_placed(watch: &ChainWatch) {
    let kinematics = known(watch);
    for joints in RESTS {
        let truth = base_from_arm() * ArmKind::Ur5e.arm().forward(&joints).unwrap().isometry() * tool();
        let (off_m, off_rad) = kinematics.tip(&joints).distance_to(&Pose::from_isometry(truth));
        assert!(off_m < 1e-9 && off_rad < 1e-7, "{off_m} m, {off_rad} rad");
    }
    let range = kinematics.arm().ranges()[0];
    assert_eq!((range.min, range.max), (ArmKind::Ur5e.ranges()[0].min, 2.0), "the narrower of chain and driver");
}

#[test]
fn the_flange_beside_the_tip_places_the_chain_at_once() {
    let hello = Hello { base_from_arm: Some(message(base_from_arm())), ..hello(ArmKind::Ur5e) };
    let mut watch = watch(&hello);
    let first = state(ArmKind::Ur5e, RESTS[0], 0.0);
    let arm = ArmKind::Ur5e.arm();
    watch.take(&first, &Reading::of(&first, 6, Some(&arm)).unwrap());
    assert_eq!(watch.placement(), &ChainPlacement::Open { places: 0 }, "nobody knows yet whether it stands");
    add_rest(&mut watch, &first, 0.1);
    assert_placed(&watch);
}

#[test]
fn a_flange_that_is_elsewhere_than_the_chain_has_it_is_said_with_the_number() {
    // The driver does not report where the arm is.
    let mut watch = watch(&hello(ArmKind::Ur5e));
    add_rest(&mut watch, &state(ArmKind::Ur5e, RESTS[0], 0.0), 0.0);
    let &ChainPlacement::Foreign { distance_m, angle_rad } = watch.placement() else {
        panic!("{:?}", watch.placement())
    };
    let computed = ArmKind::Ur5e.arm().forward(&RESTS[0]).unwrap();
    let expected = computed.distance_to(&Pose::from_isometry(base_from_arm() * computed.isometry()));
    assert!((distance_m - expected.0).abs() < 1e-9 && (angle_rad - expected.1).abs() < 1e-9);
    // It stays so: a chain that was wrong once is never used to drive.
    add_rest(&mut watch, &state(ArmKind::Ur5e, RESTS[1], 0.0), 5.0);
    assert!(matches!(watch.placement(), ChainPlacement::Foreign { .. }));
}

#[test]
fn without_a_flange_places_turned_about_two_axes_show_where_the_chain_stands() {
    let mut watch = watch(&hello(ArmKind::Ur5e));
    for (i, joints) in RESTS.into_iter().enumerate() {
        let state = StateMessage { base_from_flange: None, ..state(ArmKind::Ur5e, joints, 0.0) };
        add_rest(&mut watch, &state, 10.0 * i as f64);
        if i + 1 < NEED {
            assert_eq!(watch.placement(), &ChainPlacement::Open { places: i + 1 });
        }
    }
    assert_placed(&watch);
    // Another tool is set on the controller.
    let other = Isometry3::translation(0.0, 0.0, 0.05);
    let flange = base_from_arm() * ArmKind::Ur5e.arm().forward(&RESTS[2]).unwrap().isometry();
    let state = StateMessage {
        base_from_flange: None,
        base_from_tip: Some(message(flange * tool() * other)),
        ..state(ArmKind::Ur5e, RESTS[2], 0.0)
    };
    add_rest(&mut watch, &state, 90.0);
    let &ChainPlacement::Foreign { distance_m, .. } = watch.placement() else { panic!("{:?}", watch.placement()) };
    assert!((distance_m - 0.05).abs() < 1e-9, "{distance_m}");
}

/// All places turned about the axis of the first joint: the chain's place along and about it is not determined.
#[test]
fn turns_about_one_axis_show_nothing() {
    let mut watch = watch(&hello(ArmKind::Ur5e));
    for i in 0..6 {
        let mut joints = RESTS[0];
        joints[0] = -1.0 + 0.4 * f64::from(i);
        let state = StateMessage { base_from_flange: None, ..state(ArmKind::Ur5e, joints, 0.0) };
        add_rest(&mut watch, &state, 10.0 * f64::from(i));
    }
    assert_eq!(watch.placement(), &ChainPlacement::Open { places: 6 });
}

#[test]
fn the_chain_of_another_arm_is_never_known() {
    let mut watch = watch(&hello(ArmKind::Ur5e));
    for (i, joints) in RESTS.into_iter().enumerate() {
        let state = StateMessage { base_from_flange: None, ..state(ArmKind::Ur10e, joints, 0.0) };
        add_rest(&mut watch, &state, 10.0 * i as f64);
        assert!(!matches!(watch.placement(), ChainPlacement::Known(_)), "{i}");
    }
    assert!(matches!(watch.placement(), ChainPlacement::Foreign { .. }), "{:?}", watch.placement());
}

/// A tip that is computed from the joints agrees with them whatever they are, also where the arm is elsewhere.
#[test]
fn joints_alone_give_the_tip_of_the_chain() {
    let hello = Hello { base_from_arm: Some(message(base_from_arm())), ..hello(ArmKind::Ur5e) };
    let mut watch = watch(&hello);
    let arm = watch.placed(ArmKind::Ur5e.arm());
    let state = StateMessage {
        base_from_flange: None,
        base_from_tip: None,
        flange_from_tcp: Some(message(tool())),
        ..state(ArmKind::Ur5e, RESTS[0], 0.0)
    };
    for i in 0..4 {
        let state = StateMessage { stamp: 0.1 * f64::from(i), ..state.clone() };
        watch.take(&state, &Reading::of(&state, 6, Some(&arm)).unwrap());
    }
    assert_placed(&watch);
}

#[test]
fn an_arm_that_moves_shows_nothing() {
    let mut watch = watch(&Hello { base_from_arm: Some(message(base_from_arm())), ..hello(ArmKind::Ur5e) });
    let arm = ArmKind::Ur5e.arm();
    for i in 0..50 {
        let mut joints = RESTS[0];
        joints[0] += 0.01 * f64::from(i);
        let state = state(ArmKind::Ur5e, joints, 0.1 * f64::from(i));
        watch.take(&state, &Reading::of(&state, 6, Some(&arm)).unwrap());
        let moving = StateMessage { moving: Some(true), stamp: state.stamp, ..state.clone() };
        watch.take(&moving, &Reading::of(&moving, 6, Some(&arm)).unwrap());
    }
    assert_eq!(watch.placement(), &ChainPlacement::Open { places: 0 });
}

#[test]
fn a_driver_without_a_chain_or_joints_has_none_and_ranges_without_room_are_an_error() {
    let bare = Hello { arm: None, ..hello(ArmKind::Ur5e) };
    assert_eq!(ChainWatch::new(&bare, None).unwrap().placement(), &ChainPlacement::Unnamed);
    let no_joints = Hello { joints: Vec::new(), ..hello(ArmKind::Ur5e) };
    let arm = ArmKind::Ur5e.arm();
    assert_eq!(ChainWatch::new(&no_joints, Some(&arm)).unwrap().placement(), &ChainPlacement::Unnamed);
    let mut narrow = hello(ArmKind::Ur5e);
    narrow.joints[2].min = Some(100.0);
    narrow.joints[2].max = None;
    let why = ChainWatch::new(&narrow, Some(&arm)).unwrap_err();
    assert!(why.contains('3'), "{why}");
}
