//! The camera: frames in which everything belongs to the same instant.

use std::sync::Arc;

use handeye_core::camera::Intrinsics;
use handeye_core::depth::DepthImage;
use handeye_core::frames::{Base, Pose, Target, Tip};
use handeye_core::image::RgbImage;

use super::hold::Hold;
use super::truth::{self, GroundTruth, ShownMoment};
use super::{CellInfo, CellObjects, CellPaths, JointAngles, discover, read_joint_angles};
use crate::client::endpoint::Endpoint;
use crate::client::error::LinkError;
use crate::client::options::ConnectionOptions;
use crate::client::sim::{ObjectHandle, Sim};

/// How often a frame is read again because the simulation moved on meanwhile.
const ATTEMPTS: u32 = 10;

/// Everything about one instant of the cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Colour image, row 0 on top.
    pub rgb: RgbImage,
    /// Depth image, row 0 on top.
    pub depth: DepthImage,
    /// Simulated time (s).
    pub sim_time_s: f64,
    /// The tip as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Positions of the joints (rad).
    pub joints: JointAngles,
    /// Where the board is in these images, if the cell publishes it. For comparison only.
    pub base_from_target_true: Option<Pose<Base, Target>>,
}

/// The camera of a cell, over a connection of its own.
pub struct CameraFeed {
    sim: Sim,
    objects: Arc<CellObjects>,
    info: Arc<CellInfo>,
    hold: Hold,
    /// Whether the server tells what its images show, as far as is known.
    tells_moment: bool,
}

impl CameraFeed {
    pub(super) fn new(sim: Sim, objects: Arc<CellObjects>, info: Arc<CellInfo>) -> Self {
        let tells_moment = info.is_handeye_cell;
        Self { sim, objects, info, hold: Hold::default(), tells_moment }
    }

    /// Connects once, for a camera without its arm.
    ///
    /// # Errors
    /// As [`super::CellClient::connect`].
    pub fn connect(endpoint: &Endpoint, options: &ConnectionOptions, paths: &CellPaths) -> Result<Self, LinkError> {
        let (sim, objects, info) = discover(endpoint, options, paths)?;
        Ok(Self::new(sim, objects, info))
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
    /// A built-in cell tells what it was that the images show, and all of the frame is of that pass. Elsewhere, and
    /// before the first pass, poses and time are those of now: a joint that was put elsewhere since the last pass is
    /// there already, and not yet in the images.
    ///
    /// # Errors
    /// [`LinkError::MixedInstants`] when the simulation is never still for long enough; otherwise as for any call.
    pub fn grab(&mut self) -> Result<Frame, LinkError> {
        if let Some(held) = self.hold.acquire(&mut self.sim)? {
            let outcome = self.read();
            return held.release(&mut self.sim, outcome);
        }
        for _ in 0..ATTEMPTS {
            let frame = self.read()?;
            if self.sim.get_simulation_time()? == frame.sim_time_s {
                return Ok(frame);
            }
        }
        Err(LinkError::MixedInstants { attempts: ATTEMPTS })
    }

    fn read(&mut self) -> Result<Frame, LinkError> {
        let Some(shown) = self.shown()? else { return self.read_present() };
        Ok(Frame {
            rgb: self.sim.get_vision_sensor_image(self.objects.camera)?,
            depth: self.sim.get_vision_sensor_depth(self.objects.depth)?,
            sim_time_s: shown.sim_time_s,
            base_from_tip: shown.base_from_tip,
            joints: shown.joints,
            base_from_target_true: shown.base_from_target,
        })
    }

    fn shown(&mut self) -> Result<Option<ShownMoment>, LinkError> {
        if !self.tells_moment {
            return Ok(None);
        }
        match truth::shown_moment(&mut self.sim) {
            Err(error) if error.is_unknown_function() => {
                self.tells_moment = false;
                Ok(None)
            }
            outcome => outcome,
        }
    }

    fn read_present(&mut self) -> Result<Frame, LinkError> {
        // Time first: without a hold it is compared with the time after everything else.
        Ok(Frame {
            sim_time_s: self.sim.get_simulation_time()?,
            base_from_tip: self.sim.get_object_pose(self.objects.tip, ObjectHandle::WORLD)?,
            joints: read_joint_angles(&mut self.sim, &self.objects.joints)?,
            rgb: self.sim.get_vision_sensor_image(self.objects.camera)?,
            depth: self.sim.get_vision_sensor_depth(self.objects.depth)?,
            base_from_target_true: None,
        })
    }

    /// Where the camera of a simulated cell really is and what it really does. For comparison with a result; a solver
    /// that sees this is worth nothing.
    ///
    /// The pose comes from the scene: `tip_from_camera = tip_from_sensor * sensor_from_camera`. Intrinsics are those that
    /// the cell publishes through [`super::TRUTH_FUNCTION`], or else those of the sensor's settings, which are exact for
    /// CoppeliaSim's own renderer.
    ///
    /// # Errors
    /// [`LinkError::BadTruth`] when something is published that cannot be read; otherwise as for any call.
    pub fn ground_truth(&mut self) -> Result<GroundTruth, LinkError> {
        truth::read(&mut self.sim, &self.objects, &self.info)
    }

    /// See [`CellInfo::camera_intrinsics_nominal`].
    pub fn camera_intrinsics_nominal(&self) -> Intrinsics {
        self.info.camera_intrinsics_nominal()
    }
}
