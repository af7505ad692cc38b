//! A stop at any instant of any motion leaves an arm that can be moved again, whatever moves its joints.

use handeye_cell::scene::{JointModeSpec, Scene};
use handeye_coppeliasim::cell::{
    ArmJog, CellClient, FollowEnd, FollowGoal, FollowLimits, FollowRequest, MotionTolerance,
};
use handeye_coppeliasim::{CancelToken, LinkError, MotionLimits};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_server::{CellConfig, CellServer};
use nalgebra::{Translation3, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::sync::{Arc, Mutex};

use crate::arm::watched;

/// What ends the motion under way, this many passes from now.
type Trigger = Arc<Mutex<Option<(u32, CancelToken)>>>;

fn cell_with_trigger(server: &CellServer) -> (CellClient, Trigger) {
    let trigger = Trigger::default();
    let pulled = Arc::clone(&trigger);
    let cell = watched(server, move || {
        let mut trigger = pulled.lock().expect("no panic");
        match &mut *trigger {
            Some((0, cancel)) => cancel.cancel(),
            Some((passes, _)) => *passes -= 1,
            None => {}
        }
    });
    (cell, trigger)
}

fn stop_and_go_on(joint_mode: JointModeSpec) {
    let mut scene = Scene::reference().expect("valid");
    scene.robot.joint_mode = joint_mode;
    let server = CellServer::start(CellConfig { real_time: Some(false), ..CellConfig::new(scene) }).expect("a port");
    let (mut cell, trigger) = cell_with_trigger(&server);
    cell.arm().sim().start_simulation().expect("a call");
    let home = cell.arm().base_from_tip().expect("a call");
    let moved = |x: f64, y: f64, z: f64| -> Pose<Base, Tip> {
        Pose::from_isometry(Translation3::new(x, y, z) * home.isometry())
    };
    let (joint_limits, tip_limits) =
        (MotionLimits::uniform(6, 1.0, 4.0, 40.0), MotionLimits::uniform(4, 0.3, 2.0, 20.0));
    let start = cell.arm().joint_values().expect("a call");
    let kinematics = cell.arm().kinematics().expect("calls").expect("a UR5");
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for round in 0..100 {
        let cancel = CancelToken::default();
        *trigger.lock().expect("no panic") = Some((rng.random_range(0..25), cancel.clone()));
        let stopped = match round % 4 {
            0 => cell.arm().move_to_joints(&start.map(|angle| angle + 0.4), &joint_limits, &cancel),
            1 => cell.arm().move_to_pose(&moved(0.1, -0.05, 0.05), &tip_limits, &MotionTolerance::default(), &cancel),
            2 => {
                let velocity_m_s = Vector3::new(0.1, 0.0, if round % 8 == 2 { 0.05 } else { -0.05 });
                let base_from_tip = cell.arm().base_from_tip().expect("a call");
                let angular_velocity_rad_s = Vector3::zeros();
                let mut goal = FollowGoal { base_from_tip, velocity_m_s, angular_velocity_rad_s };
                let end = cell.arm().follow(&kinematics, &FollowLimits::default(), &mut |_| {
                    goal = goal.after(0.05);
                    if cancel.is_cancelled() { FollowRequest::End } else { FollowRequest::Towards(goal) }
                });
                end.map(|end| assert_eq!(end, FollowEnd::Released, "{round}"))
            }
            _ => {
                let jog = ArmJog::Joint { index: 1, forward: round % 8 == 3 };
                let mut held = || (!cancel.is_cancelled()).then_some(1.0);
                cell.arm().jog(&jog, Some(0.3), &mut held).map(drop)
            }
        };
        assert!(matches!(stopped, Ok(()) | Err(LinkError::Cancelled { .. })), "{round}: {stopped:?}");
        *trigger.lock().expect("no panic") = None;
        cell.arm().stop().expect("a call");

        let goal = moved(-0.02 * f64::from(round % 4), -0.04, 0.01);
        cell.arm()
            .move_to_pose(&goal, &tip_limits, &MotionTolerance::default(), &CancelToken::default())
            .unwrap_or_else(|error| panic!("{round}: {error}"));
        let (distance_m, _) = cell.arm().base_from_tip().expect("a call").distance_to(&goal);
        assert!(distance_m < 1e-4, "{round}: {distance_m} m from its goal");
    }
}

#[test]
fn an_arm_that_is_put_from_place_to_place_goes_on_after_a_stop_at_a_hundred_instants() {
    stop_and_go_on(JointModeSpec::Kinematic);
}

#[test]
fn an_arm_that_controllers_move_goes_on_after_a_stop_at_a_hundred_instants() {
    stop_and_go_on(JointModeSpec::Dynamic);
}
