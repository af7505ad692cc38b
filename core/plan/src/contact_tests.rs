use nalgebra::{Isometry3, Vector3};

use super::*;
use crate::{ArmBody, Carried, SpeedLimits, WorkVolume};
use handeye_arm::ArmKind;
use handeye_geometry::frames::Pose;
use handeye_geometry::testing::BOARD;

const CLEARANCE_M: f64 = 0.02;

fn arm(carried: Vec<Carried>) -> Arm {
    let chain = ArmKind::Ur5e.arm();
    Arm {
        body: ArmBody::of(&chain),
        chain,
        world_from_arm: Isometry3::identity(),
        connection_from_tip: Isometry3::identity(),
        carried,
    }
}

/// Over a table in front, from where a turn of the first joint swings the hand to the side.
fn start() -> Vec<f64> {
    vec![std::f64::consts::PI, -1.6, 1.9, -1.9, -1.57, 0.0]
}

fn turned(by_rad: f64) -> Vec<f64> {
    let mut joints = start();
    joints[0] += by_rad;
    joints
}

/// A post where the hand arrives when the first joint has turned by this angle.
fn post(arm: &Arm, at_rad: f64) -> Surroundings {
    let at = arm.tip(&turned(at_rad)).expect("its joints").translation();
    Surroundings::of(vec![Obstacle::new("post", Isometry3::from(at), [0.04, 0.04, 0.6])])
}

#[test]
fn what_is_in_the_way_is_named_and_a_path_is_checked_between_its_ends() {
    let arm = arm(vec![Carried::camera(&Isometry3::identity())]);
    let around = post(&arm, 0.5);
    let guard = Guard::strict(&arm, &around, CLEARANCE_M);
    assert_eq!(guard.contact(&turned(0.0)), None);
    assert_eq!(guard.contact(&turned(1.0)), None);
    let named = Some(Contact::Box { name: "post".to_owned() });
    assert_eq!(guard.contact(&turned(0.5)), named);
    assert_eq!(guard.contact_on_path(&turned(0.0), &turned(1.0)), named);
    assert_eq!(guard.contact_on_path(&turned(0.0), &turned(-1.0)), None);
    assert!(named.is_some_and(|contact| contact.to_string().contains("post")));
    assert_eq!(guard.contact(&[0.0; 3]), Some(Contact::NoConfiguration));
}

/// However thin it is: a wire is met between any two configurations of a coarse grid.
#[test]
fn a_thin_wire_is_not_stepped_over() {
    let arm = arm(vec![Carried::camera(&Isometry3::identity())]);
    let mut around = post(&arm, 0.0);
    for k in 0..40 {
        let at_rad = 0.6 + 0.01 * f64::from(k);
        let at = arm.tip(&turned(at_rad)).expect("its joints").translation();
        around.obstacles[0] = Obstacle::new("wire", Isometry3::from(at), [1e-4, 1e-4, 0.6]);
        assert!(!arm.path_is_free(&turned(0.0), &turned(1.6), &around, 1e-4), "at {at_rad}");
    }
}

#[test]
fn an_arm_that_touches_something_gets_away_from_it_and_not_further_in() {
    let arm = arm(vec![Carried::camera(&Isometry3::identity())]);
    let around = post(&arm, 0.5);
    for inside_rad in [0.35, 0.42, 0.48] {
        let guard = Guard::from(&arm, &around, &turned(inside_rad), CLEARANCE_M);
        assert!(!arm.is_free(&turned(inside_rad), &around, CLEARANCE_M), "it begins too near");
        assert_eq!(guard.contact(&turned(inside_rad)), None);
        assert_eq!(guard.contact_on_path(&turned(inside_rad), &turned(-0.5)), None, "from {inside_rad}");
        assert!(guard.contact(&turned(inside_rad + 0.01)).is_some(), "from {inside_rad}");
        assert!(guard.contact_on_path(&turned(inside_rad), &turned(inside_rad + 0.1)).is_some());
    }
    // A motion that begins in free space keeps the whole clearance.
    let guard = Guard::from(&arm, &around, &turned(0.0), CLEARANCE_M);
    assert!(guard.contact(&turned(0.5)).is_some());
}

#[test]
fn a_board_on_the_tip_keeps_away_from_what_stands_around_by_its_edge() {
    let on_tip = Isometry3::new(Vector3::new(0.0, 0.0, 0.05), Vector3::x() * std::f64::consts::PI)
        * nalgebra::Translation3::from(-BOARD.centre().coords);
    let with_board = arm(vec![Carried::board(&BOARD, &Pose::from_isometry(on_tip), 0.0)]);
    let bare = arm(Vec::new());
    let joints = start();
    let tip = *with_board.tip(&joints).expect("its joints").isometry();
    // Its half edge is 10 cm; 8 cm to the side of the tip and 5 cm in front of it there is only the board.
    let beside = tip * nalgebra::Translation3::new(0.08, 0.0, 0.05);
    let around = Surroundings::of(vec![Obstacle::new("pin", beside, [0.01; 3])]);
    assert!(bare.is_free(&joints, &around, CLEARANCE_M));
    assert!(!with_board.is_free(&joints, &around, CLEARANCE_M));
    // The flange that holds it does not count, nor does the wrist in any position of its last joint.
    for k in 0..12 {
        let mut turned = joints.clone();
        turned[5] = f64::from(k) * 0.5;
        assert!(with_board.is_free(&turned, &Surroundings::default(), CLEARANCE_M), "{turned:?}");
    }
    // Bent back at the wrist the hand alone clears the forearm and the board does not.
    let hits = |arm: &Arm| -> usize {
        let bent = (0..60).filter(|k| {
            let mut bent = joints.clone();
            bent[3] = -f64::from(*k) * 0.1;
            !arm.is_free(&bent, &Surroundings::default(), CLEARANCE_M)
        });
        bent.count()
    };
    assert!(hits(&with_board) > hits(&bare), "{} {}", hits(&with_board), hits(&bare));
}

#[test]
fn tip_and_camera_stay_in_the_work_volume() {
    let camera = Isometry3::translation(0.1, 0.0, 0.0);
    let arm = arm(vec![Carried::camera(&camera)]);
    let joints = start();
    let tip = *arm.tip(&joints).expect("its joints").isometry();
    let eye = tip * camera;
    let about = |half_m: f64, centre: &Isometry3<f64>| {
        let half = Vector3::repeat(half_m);
        let middle = centre.translation.vector;
        let volume = WorkVolume { min_m: (middle - half).into(), max_m: (middle + half).into() };
        Surroundings { volume: Some(volume), ..Surroundings::default() }
    };
    assert!(arm.is_free(&joints, &about(0.11, &tip), CLEARANCE_M));
    assert!(!arm.is_free(&joints, &about(0.05, &tip), CLEARANCE_M), "the camera is outside");
    assert!(!arm.is_free(&joints, &about(0.05, &eye), CLEARANCE_M), "the tip is outside");
    let around = about(0.11, &tip);
    let guard = Guard::from(&arm, &around, &joints, CLEARANCE_M);
    assert_eq!(guard.contact_on_path(&joints, &turned(1.0)), Some(Contact::Volume));
    // An arm that is outside comes back in, and goes no further out.
    let guard = Guard::from(&arm, &around, &turned(1.0), CLEARANCE_M);
    assert_eq!(guard.contact(&turned(0.9)), None);
    assert_eq!(guard.contact(&turned(1.1)), Some(Contact::Volume));
}

#[test]
fn limits_of_tip_and_joints_bound_the_speed_of_a_path() {
    let arm = arm(Vec::new());
    let (from, mut to) = (start(), turned(1.2));
    to[1] += 0.5;
    let limits =
        |tip_m_s, joint_rad_s| Surroundings { limits: SpeedLimits { tip_m_s, joint_rad_s }, ..Surroundings::default() };
    assert_eq!(arm.joint_speed(&from, &to, &limits(None, None), 3.0), 3.0);
    assert_eq!(arm.joint_speed(&from, &to, &limits(None, Some(0.4)), 3.0), 0.4);
    let rad_s = arm.joint_speed(&from, &to, &limits(Some(0.25), Some(2.0)), 3.0);
    // Driven at that speed the tip is as fast as allowed at its fastest, by differences of its places.
    let parts_per_s = rad_s / travel(&from, &to);
    let tip = |part: f64| {
        let joints: Vec<f64> = from.iter().zip(&to).map(|(a, b)| a + part * (b - a)).collect();
        arm.tip(&joints).expect("its joints").translation()
    };
    let fastest = (0..1000)
        .map(|k| (tip(f64::from(k + 1) / 1000.0) - tip(f64::from(k) / 1000.0)).norm() * 1000.0 * parts_per_s)
        .fold(0.0, f64::max);
    assert!((0.24..0.2501).contains(&fastest), "{fastest} m/s");
}
