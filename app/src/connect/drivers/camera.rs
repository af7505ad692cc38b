//! Images from a driver, each with the robot at its instant.

use std::time::Duration;

use handeye_core::geometry::arm::JointValues;
use handeye_sim_link::client::CancelToken;
use handeye_sim_link::driver::message::Ability;
use handeye_sim_link::driver::{DriverCell, NoPose};

use super::{TypedPose, port_error};
use crate::worker::{CameraPort, PortError, RawFrame};

/// Longest wait for an image in one call: the camera worker has other tasks, too.
const PATIENCE: Duration = Duration::from_millis(100);

/// Depths \[m\] of a camera whose driver says nothing of them.
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
    fn newest(&mut self, seen_s: Option<f64>) -> Result<Option<RawFrame>, PortError> {
        self.cell.check().map_err(port_error)?;
        let after = seen_s.and(self.seen_stamp_s);
        let Some(frame) = self.cell.frame(after, PATIENCE, &self.shutdown).map_err(port_error)? else {
            return Ok(None);
        };
        self.seen_stamp_s = Some(frame.stamp_s);
        let robot = match &self.typed {
            Some(typed) => typed.get().map(|pose| (pose, None)),
            None => frame.robot.inspect_err(complain).ok().map(|robot| (robot.base_from_tip, robot.joints)),
        };
        let clocks = self.cell.clock_difference();
        Ok(Some(RawFrame {
            rgb: frame.rgb,
            depth: frame.depth,
            sim_time_s: frame.time_s.unwrap_or(frame.stamp_s),
            image_age_s: frame.time_uncertainty_s,
            base_from_tip: robot.map(|(pose, _)| pose),
            joints_rad: robot.and_then(|(_, joints)| joints).unwrap_or_else(|| JointValues::zeros(0)),
            base_from_target_true: None,
            clocks: clocks.map(|clocks| [clocks.robot_from_camera_s, clocks.uncertainty_s]),
        }))
    }

    fn depth_limits_m(&self) -> [f32; 2] {
        let camera = self.cell.camera().filter(|camera| camera.hello().can(Ability::Depth));
        let limits = camera.and_then(|camera| camera.hello().depth_limits_m);
        limits.unwrap_or(USUAL_DEPTHS_M)
    }
}

fn complain(why: &NoPose) {
    tracing::debug!(%why, "an image has no pose");
}
