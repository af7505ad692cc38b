//! Arms without six joints, or with prismatic ones, driven over the real socket: a Panda, and an arm on a track.

use std::path::Path;
use std::sync::mpsc::channel;
use std::time::Duration;

use handeye_arm::{JointKind, JointValues};
use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{
    Arm, ArmJog, CellPaths, FollowEnd, FollowGoal, FollowLimits, FollowRequest, JogAxes, JogEnd, JogObstacle,
    MotionTolerance,
};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, LinkError, MotionLimits};
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::other_arms::Bench;

/// Only a failure takes this long.
const PATIENCE: Duration = Duration::from_mins(1);
/// How far from its line a jog or a motion may be: what a dial gauge at the tip shows.
const STRAIGHT_M: f64 = 0.2e-3;
/// A searched pose agrees to 1e-8 m and rad.
const SEARCHED_M: f64 = 1e-7;

fn panda() -> Bench {
    Bench::shipped("panda.toml")
}

/// An arm on a track: a rail of 1.6 m, on which an xArm is mounted.
fn on_track() -> Bench {
    let folder = tempfile::tempdir().expect("a folder");
    let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/arms/xarm6.urdf");
    let rail = r#"<link name="rail"/>
      <joint name="track" type="prismatic">
        <parent link="rail"/><child link="link_base"/>
        <origin xyz="0 0 0" rpy="0 0 0"/><axis xyz="0 1 0"/>
        <limit lower="-0.8" upper="0.8" velocity="1.0" effort="100"/>
      </joint>
    </robot>"#;
    let text = std::fs::read_to_string(arm).expect("it is shipped").replacen("</robot>", rail, 1);
    std::fs::write(folder.path().join("arm.urdf"), text).expect("written");
    let scene = "[robot]\nmodel = { urdf = \"arm.urdf\", base = \"rail\", tip = \"link6\" }\n\
                 start_joints_deg = [0.1, 0, -30, -60, 0, 90, 0]\n";
    std::fs::write(folder.path().join("scene.toml"), scene).expect("written");
    Bench::start(Scene::load(&folder.path().join("scene.toml")).unwrap_or_else(|error| panic!("{error}")))
}

/// How far the tip is from a line, and how far it has turned.
fn off_line(start: &Pose<Base, Tip>, along: &Vector3<f64>, now: &Pose<Base, Tip>) -> (f64, f64) {
    let moved = now.translation() - start.translation();
    ((moved - along * moved.dot(along)).norm(), start.distance_to(now).1)
}

/// Jogs the tip there and back, watched by another client in every pass.
fn jog_there_and_back(bench: &mut Bench, along: Vector3<f64>, length_m: f64) {
    let kinematics = bench.kinematics();
    let endpoint = bench.server.endpoint().parse().expect("an address");
    let mut watch = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("whole");
    let start = bench.tip();
    for sign in [1.0, -1.0] {
        let from = bench.tip();
        let jog = ArmJog::Line { kinematics: &kinematics, axes: JogAxes::Base, along: along * sign };
        let (mut worst_m, mut passes) = (0.0_f64, 0);
        let end = bench.arm.jog(&jog, Some(length_m), &mut || {
            let (off_m, turned_rad) = off_line(&start, &along, &watch.base_from_tip().expect("a call"));
            assert!(turned_rad < 1e-4, "{turned_rad} rad");
            (worst_m, passes) = (worst_m.max(off_m), passes + 1);
            Some(1.0)
        });
        assert_eq!(end, Ok(JogEnd::Arrived));
        assert!(worst_m < STRAIGHT_M && passes > 5, "{worst_m} m off in {passes} passes");
        let moved = bench.tip().translation() - from.translation();
        assert!((moved - along * sign * length_m).norm() < SEARCHED_M, "{moved}");
    }
}

#[test]
fn seven_joints_are_found_by_walking_and_their_chain_says_where_the_tip_goes() {
    let mut bench = panda();
    assert_eq!(bench.arm.info().joints.len(), 7);
    let kinematics = bench.kinematics();
    for (i, joint) in bench.truth.arm.joints().iter().enumerate() {
        let read = kinematics.arm().joints()[i].range;
        assert!((read.min - joint.range.min).abs() + (read.max - joint.range.max).abs() < 1e-12, "joint {}", i + 1);
    }
    bench.assert_known(&kinematics);
}

#[test]
fn a_panda_goes_to_joints_and_along_a_line_to_a_pose() {
    let mut bench = panda();
    let start = bench.arm.joint_values().expect("a call");
    let mut goal = start;
    (goal[2], goal[6]) = (0.4, -0.3);
    bench.move_joints(&goal);
    assert_eq!(bench.arm.joint_values(), Ok(goal));
    let six = bench.arm.move_to_joints(&goal[..6], &MotionLimits::uniform(6, 1.0, 1.0, 1.0), &CancelToken::default());
    assert_eq!(six, Err(LinkError::JointCount { got: 6, need: 7 }));

    let tip = bench.tip();
    let turn = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3);
    let shift = Vector3::new(-0.05, 0.08, 0.06);
    let goal = Pose::from_isometry(Isometry3::from_parts(
        Translation3::from(tip.translation() + shift),
        tip.rotation() * turn,
    ));
    let limits = MotionLimits::uniform(4, 0.5, 2.0, 20.0);
    let tolerance = MotionTolerance { distance_m: SEARCHED_M, angle_rad: 1e-6 };
    bench.arm.sim().set_stepping(false).expect("a call");
    bench.arm.move_to_pose(&goal, &limits, &tolerance, &CancelToken::default()).expect("there");
}

#[test]
fn the_tip_of_a_panda_is_jogged_straight_both_ways() {
    let mut bench = panda();
    jog_there_and_back(&mut bench, Vector3::y(), 0.15);
    jog_there_and_back(&mut bench, Vector3::new(1.0, 0.0, 1.0).normalize(), 0.08);
}

#[test]
fn joint_seven_of_a_panda_is_jogged_alone_to_the_end_of_its_range() {
    let mut bench = panda();
    let before = bench.arm.joint_values().expect("a call");
    let jog = ArmJog::Joint { index: 6, forward: true };
    assert_eq!(bench.arm.jog(&jog, Some(0.2), &mut || Some(1.0)), Ok(JogEnd::Arrived));
    let mut expected = before;
    expected[6] += 0.2;
    let after = bench.arm.joint_values().expect("a call");
    assert!(after.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{after:?}");
    let end = bench.arm.jog(&jog, None, &mut || Some(1.0)).expect("calls");
    let range = bench.truth.arm.joints()[6].range;
    let JogEnd::Obstacle(JogObstacle::JointRange { joint: 7, limit }) = end else { panic!("{end:?}") };
    assert!((limit.value - range.max).abs() < 1e-12 && limit.kind == JointKind::Revolute, "{limit}");
    let none = bench.arm.jog(&ArmJog::Joint { index: 7, forward: true }, None, &mut || Some(1.0));
    assert!(matches!(none, Err(LinkError::BadMotion { what: "the joint", .. })), "{none:?}");
}

#[test]
fn a_panda_that_moves_is_stopped_by_another_client() {
    let mut bench = panda();
    bench.arm.sim().set_stepping(false).expect("a call");
    let endpoint = bench.server.endpoint().parse().expect("an address");
    let mut other = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("whole");
    let (began, begun) = channel();
    let start = bench.arm.joint_values().expect("a call");
    let stopping = std::thread::spawn(move || {
        begun.recv_timeout(PATIENCE).expect("it begins");
        while other.joint_values().expect("a call")[0] == start[0] {}
        other.stop()
    });
    began.send(()).expect("it waits");
    let mut goal = start;
    goal[0] = 2.5;
    let slow = MotionLimits::uniform(7, 0.2, 1.0, 10.0);
    let outcome = bench.arm.move_to_joints(&goal, &slow, &CancelToken::default());
    stopping.join().expect("no panic").expect("a call");
    assert_eq!(outcome, Err(LinkError::MotionStopped { task: "moving the joints" }));
    let here = bench.arm.joint_values().expect("a call");
    assert!((here[0] - goal[0]).abs() > 0.1, "{here:?}");
}

/// Follows a goal that moves in a circle and rotates, at 50 mm/s.
fn follow(bench: &mut Bench, limits: &FollowLimits) -> f64 {
    let (kinematics, start) = (bench.kinematics(), bench.tip());
    let begin_s = bench.arm.sim().get_simulation_time().expect("a call");
    let time_step_s = bench.arm.info().time_step_s;
    let at = |sim_time_s: f64| {
        let angle = (sim_time_s - begin_s) * 50.0 / 60.0;
        let (radius_m, speed_m_s) = (0.06, 0.05);
        let on_circle = Vector3::new(radius_m * (angle.cos() - 1.0), radius_m * angle.sin(), 0.0);
        let pose = Isometry3::from_parts((start.translation() + on_circle).into(), start.rotation());
        FollowGoal {
            base_from_tip: Pose::from_isometry(pose),
            velocity_m_s: Vector3::new(-angle.sin(), angle.cos(), 0.0) * speed_m_s,
            angular_velocity_rad_s: Vector3::zeros(),
        }
    };
    let mut worst_m = 0.0_f64;
    let end = bench.arm.follow(&kinematics, limits, &mut |moment| {
        let now_s = moment.sim_time_s;
        // In the first second it catches up with a goal that did not wait, and after the last one it brakes; the moment is
        // one pass ahead of the joints.
        if (1.0..8.0).contains(&(now_s - begin_s)) {
            let here = at(now_s - time_step_s).base_from_tip;
            worst_m = worst_m.max(moment.base_from_tip.distance_to(&here).0);
        }
        if now_s - begin_s > 8.0 { FollowRequest::End } else { FollowRequest::Towards(at(now_s)) }
    });
    assert_eq!(end, Ok(FollowEnd::Released));
    worst_m
}

#[test]
fn a_panda_follows_a_goal_round_a_circle() {
    let worst_m = follow(&mut panda(), &FollowLimits::default());
    assert!(worst_m < 1e-3, "{worst_m} m");
}

#[test]
fn an_arm_on_a_track_is_moved_jogged_and_follows_with_its_track_in_metres() {
    let mut bench = on_track();
    let kinds: Vec<JointKind> = bench.arm.info().joint_kinds().collect();
    assert_eq!((kinds.len(), kinds[0], kinds[1]), (7, JointKind::Prismatic, JointKind::Revolute));
    let kinematics = bench.kinematics();
    bench.assert_known(&kinematics);

    let start = bench.arm.joint_values().expect("a call");
    let mut goal = start;
    (goal[0], goal[1]) = (-0.4, 0.3);
    bench.move_joints(&goal);
    assert_eq!(bench.arm.joint_values(), Ok(goal));
    goal[0] = 0.9;
    let limits = MotionLimits::uniform(7, 3.0, 9.0, 90.0);
    let error = bench.arm.move_to_joints(&goal, &limits, &CancelToken::default()).expect_err("the rail is 0.8 m long");
    assert!(
        error.to_string().contains("joint 1 cannot go to 900.00 mm: its range is -800.0 mm to 800.0 mm"),
        "{error}"
    );

    let tip = bench.tip();
    let rail = ArmJog::Joint { index: 0, forward: true };
    assert_eq!(bench.arm.jog(&rail, Some(0.3), &mut || Some(1.0)), Ok(JogEnd::Arrived));
    assert!((bench.arm.joint_values().expect("a call")[0] + 0.1).abs() < 1e-9);
    assert!((bench.tip().translation() - tip.translation()).norm() - 0.3 < 1e-9, "the tip goes along");
    let end = bench.arm.jog(&rail, None, &mut || Some(1.0)).expect("calls");
    assert!(
        matches!(end, JogEnd::Obstacle(JogObstacle::JointRange { joint: 1, limit }) if limit.value == 0.8),
        "{end:?}"
    );

    bench.move_joints(&start);
    jog_there_and_back(&mut bench, Vector3::y(), 0.3);
    // One at the origin would have the goal out of reach.
    let worst_m = follow(&mut bench, &FollowLimits::default());
    assert!(worst_m < 1e-3, "{worst_m} m");
}

/// The arm alone reaches 0.7 m to the side, and the track extends that.
#[test]
fn a_tip_that_goes_further_than_the_arm_reaches_takes_the_track_along() {
    let mut bench = on_track();
    let kinematics = bench.kinematics();
    let (start, far) = (bench.tip(), Vector3::new(0.0, 0.7, 0.0));
    let goal = Pose::from_isometry(Translation3::from(far) * start.isometry());
    let tolerance = MotionTolerance { distance_m: 1e-6, angle_rad: 1e-6 };
    bench.arm.sim().set_stepping(false).expect("a call");
    let limits = MotionLimits::uniform(4, 0.5, 2.0, 20.0);
    bench.arm.move_to_pose(&goal, &limits, &tolerance, &CancelToken::default()).expect("there");
    let joints: JointValues = bench.arm.joint_values().expect("a call");
    assert!(joints[0] > 0.2, "{joints:?}");
    assert_eq!(kinematics.arm().first_violation(&joints), None);
}
