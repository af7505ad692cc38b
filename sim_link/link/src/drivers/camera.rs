//! Images from a driver, each with the robot at its instant.

use std::time::Duration;

use handeye_arm::JointValues;
use handeye_coppeliasim::CancelToken;
use handeye_driver::message::Ability;
use handeye_driver::{DriverCell, NoPose, limits};

use super::{TypedPose, port_error};
use crate::{CameraPort, Newest, PortError, RawFrame};
use handeye_wording::Text;
use handeye_wording::text;

/// Longest wait for an image in one call: the camera worker has other tasks, too.
const PATIENCE: Duration = Duration::from_millis(100);

/// Depths \[m\] of a camera whose driver does not report them.
const USUAL_DEPTHS_M: [f32; 2] = [0.1, 10.0];

pub(super) struct DriverCamera {
    cell: DriverCell,
    typed: Option<TypedPose>,
    shutdown: CancelToken,
    /// The camera's stamp of the last image.
    seen_stamp_s: Option<f64>,
}

impl DriverCamera {
    pub fn new(cell: DriverCell, typed: Option<TypedPose>, shutdown: CancelToken) -> Self {
        Self { cell, typed, shutdown, seen_stamp_s: None }
    }
}

impl CameraPort for DriverCamera {
    fn newest(&mut self, seen_s: Option<f64>) -> Result<Newest, PortError> {
        self.cell.check().map_err(port_error)?;
        let after = seen_s.and(self.seen_stamp_s);
        let Some(frame) = self.cell.frame(after, PATIENCE, &self.shutdown).map_err(port_error)? else {
            return Ok(Newest::Awaited);
        };
        self.seen_stamp_s = Some(frame.stamp_s);
        let robot = match &self.typed {
            Some(typed) => typed.get().map(|pose| (pose, None)).ok_or_else(nothing_typed),
            None => frame.robot.map(|robot| (robot.base_from_tip, robot.joints)).map_err(|why| no_pose(&why)),
        };
        let (robot, no_pose) = match robot {
            Ok(robot) => (Some(robot), None),
            Err(why) => (None, Some(why)),
        };
        let clocks = self.cell.clock_difference();
        Ok(Newest::Frame(Box::new(RawFrame {
            rgb: frame.rgb,
            depth: frame.depth,
            sim_time_s: frame.time_s.unwrap_or(frame.stamp_s),
            image_age_s: frame.time_uncertainty_s,
            base_from_tip: robot.map(|(pose, _)| pose),
            no_pose,
            joints_rad: robot.and_then(|(_, joints)| joints).unwrap_or_else(|| JointValues::zeros(0)),
            base_from_target_true: None,
            clocks: clocks.map(|clocks| [clocks.robot_from_camera_s, clocks.uncertainty_s]),
        })))
    }

    fn depth_limits_m(&self) -> [f32; 2] {
        let camera = self.cell.camera().filter(|camera| camera.hello().can(Ability::Depth));
        let limits = camera.and_then(|camera| camera.hello().depth_limits_m);
        limits.unwrap_or(USUAL_DEPTHS_M)
    }
}

/// Freehand, and no pose of the robot was entered.
fn nothing_typed() -> Text {
    text!("type the pose that its pendant shows, and capture again")
}

/// Why the states of a driver do not give the robot's pose at an image.
fn no_pose(why: &NoPose) -> Text {
    let seconds = |s: f64| format!("{s:.3}");
    match *why {
        NoPose::NoRobot => text!("its driver sends no states: connect a driver of the robot, or choose Freehand"),
        NoPose::NoState => text!("its driver has not sent a state yet"),
        NoPose::NoClock => {
            text!("its clock and that of the camera are not related yet: a driver has not answered a ping")
        }
        NoPose::TooOld { by_s } => text!(
            "the image is {by} s older than the oldest state that is kept: the camera's driver is late, or the time stamps of \
             robot and camera are not of one clock",
            by = seconds(by_s)
        ),
        NoPose::TooNew { by_s } => text!(
            "its driver has sent no state after the image, the newest is {by} s older: states have to go on while the camera \
             works",
            by = seconds(by_s)
        ),
        NoPose::Gap { gap_s } => text!(
            "its states before and after the image are {gap} s apart, more than {most} s: states have to go on while the camera \
             works",
            gap = seconds(gap_s),
            most = limits::STATES_APART_S
        ),
        _ => why.into(),
    }
}
