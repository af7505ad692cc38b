//! The camera: frames in which everything belongs to the same instant.

use std::sync::Arc;

use handeye_core::camera::Intrinsics;
use handeye_core::frames::{Base, Camera, Pose, Sensor, Tip};
use handeye_core::image::RgbImage;

use super::truth::{GroundTruth, PublishedTruth, TRUTH_FUNCTION};
use super::{CellInfo, CellObjects, JointAngles, read_joint_angles};
use crate::axes::sensor_from_camera;
use crate::client::convert::DepthFrame;
use crate::client::error::LinkError;
use crate::client::sim::{ObjectHandle, Sim};

/// How often a frame is read again because the simulation moved on meanwhile.
const ATTEMPTS: u32 = 10;

/// Everything about one instant of the cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Colour image, row 0 on top.
    pub rgb: RgbImage,
    /// Depth image, row 0 on top.
    pub depth: DepthFrame,
    /// Simulated time (s).
    pub sim_time_s: f64,
    /// The tip as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Positions of the joints (rad).
    pub joints: JointAngles,
}

/// The camera of a cell, over a connection of its own.
pub struct CameraFeed {
    sim: Sim,
    objects: Arc<CellObjects>,
    info: Arc<CellInfo>,
    can_hold: bool,
}

impl CameraFeed {
    pub(super) fn new(sim: Sim, objects: Arc<CellObjects>, info: Arc<CellInfo>) -> Self {
        Self { sim, objects, info, can_hold: true }
    }

    /// What is known about the cell.
    pub fn info(&self) -> &CellInfo {
        &self.info
    }

    /// The typed calls, for what has no method here.
    pub fn sim(&mut self) -> &mut Sim {
        &mut self.sim
    }

    /// Images, poses and time of one instant.
    ///
    /// The simulation is held for the few milliseconds that it takes. A server that cannot be held is read until the
    /// clock says the same before and after. Images are those of the last complete pass: after a motion they show the
    /// arm at rest only once it has settled, see [`super::Arm::settle`]; while the simulation is stopped they are not
    /// renewed at all.
    ///
    /// # Errors
    /// [`LinkError::MixedInstants`] when the simulation is never still for long enough; otherwise as for any call.
    pub fn grab(&mut self) -> Result<Frame, LinkError> {
        if self.can_hold {
            match self.sim.acquire_lock() {
                Ok(()) => return self.grab_held(),
                Err(error) if error.is_unknown_function() => self.can_hold = false,
                Err(error) => {
                    // The request may still reach the server, which would then be held with nobody to let go.
                    self.sim.connection().renew();
                    return Err(error);
                }
            }
        }
        for _ in 0..ATTEMPTS {
            let frame = self.read()?;
            if self.sim.get_simulation_time()? == frame.sim_time_s {
                return Ok(frame);
            }
        }
        Err(LinkError::MixedInstants { attempts: ATTEMPTS })
    }

    fn grab_held(&mut self) -> Result<Frame, LinkError> {
        let epoch = self.sim.connection().epoch();
        let outcome = self.read();
        if self.sim.connection().epoch() == epoch {
            match self.sim.release_lock() {
                Ok(()) => return outcome,
                Err(error) => {
                    self.sim.connection().renew();
                    return outcome.and(Err(error));
                }
            }
        }
        // The conversation broke: a server that is still there must not stay held.
        self.sim.connection().renew();
        outcome
    }

    fn read(&mut self) -> Result<Frame, LinkError> {
        // Time first: without a hold it is compared with the time after everything else.
        Ok(Frame {
            sim_time_s: self.sim.get_simulation_time()?,
            base_from_tip: self.sim.get_object_pose(self.objects.tip, ObjectHandle::WORLD)?,
            joints: read_joint_angles(&mut self.sim, &self.objects.joints)?,
            rgb: self.sim.get_vision_sensor_image(self.objects.camera)?,
            depth: self.sim.get_vision_sensor_depth(self.objects.depth)?,
        })
    }

    /// Where the camera of a simulated cell really is and what it really does. For comparison with a result; a solver
    /// that sees this is worth nothing.
    ///
    /// The pose comes from the scene: `tip_from_camera = tip_from_sensor * sensor_from_camera`. Intrinsics are those that
    /// the cell publishes through [`TRUTH_FUNCTION`], or else those of the sensor's settings, which are exact for
    /// CoppeliaSim's own renderer.
    ///
    /// # Errors
    /// [`LinkError::BadTruth`] when something is published that cannot be read; otherwise as for any call.
    pub fn ground_truth(&mut self) -> Result<GroundTruth, LinkError> {
        let published = match self.sim.connection().call(TRUTH_FUNCTION, Vec::new()) {
            Ok(reply) => PublishedTruth::parse(&reply.into_map(0)?)?,
            Err(error) if error.is_unknown_function() => PublishedTruth::default(),
            Err(error) => return Err(error),
        };
        let tip_from_sensor: Pose<Tip, Sensor> = self.sim.get_object_pose(self.objects.camera, self.objects.tip)?;
        let tip_from_camera: Pose<Tip, Camera> = tip_from_sensor * sensor_from_camera();
        Ok(GroundTruth {
            tip_from_camera: published.tip_from_camera.unwrap_or(tip_from_camera),
            base_from_target: published.base_from_target,
            intrinsics: published.intrinsics.unwrap_or_else(|| self.camera_intrinsics_nominal()),
            intrinsics_published: published.intrinsics.is_some(),
        })
    }

    /// See [`CellInfo::camera_intrinsics_nominal`].
    pub fn camera_intrinsics_nominal(&self) -> Intrinsics {
        self.info.camera_intrinsics_nominal()
    }
}
