//! The camera: frames in which everything belongs to the same instant.

use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Pose, Target, Tip};
use image::RgbImage;

use super::hold::Held;
use super::joints::read_joint_values;
use super::objects::CellObjects;
use super::truth::{self, GroundTruth, ShownMoment};
use super::{CellInfo, CellPaths, discover};
use crate::endpoint::Endpoint;
use crate::error::LinkError;
use crate::options::ConnectionOptions;
use crate::sim::{ObjectHandle, Sim};

/// How often a frame is read again because another client moved the arm meanwhile.
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
    /// How much older than pose and joints the images may be (s of simulated time): zero where all of it is of one
    /// instant. Images of an arm at rest for longer than that show it where it is.
    pub image_age_s: f64,
    /// The tip as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Positions of the joints (rad, or m of a prismatic joint).
    pub joints: JointValues,
    /// Where the board is in these images, if the cell publishes it. For comparison only.
    pub base_from_target_true: Option<Pose<Base, Target>>,
}

/// The camera of a cell, over its own connection.
pub struct CameraFeed {
    sim: Sim,
    objects: Arc<CellObjects>,
    info: Arc<CellInfo>,
    /// Whether the server takes images on request, as far as is known.
    renews: bool,
    /// Whether the server reports the moment that its images show, as far as is known.
    tells_moment: bool,
}

impl CameraFeed {
    pub(super) fn new(sim: Sim, objects: Arc<CellObjects>, info: Arc<CellInfo>) -> Self {
        let tells_moment = info.is_handeye_cell;
        Self { sim, objects, info, renews: !tells_moment, tells_moment }
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
    /// The simulation is held for the few milliseconds that it takes, and has its sensors take their images meanwhile:
    /// the simulator does so at the end of a pass, and answers at the beginning of the next, so a joint that was put
    /// elsewhere since is in the pose and not yet in the image. A built-in cell reports instead the moment that the
    /// images of the last pass show, board included, and the whole frame is of the end of that pass.
    ///
    /// Where images cannot be requested, [`Frame::image_age_s`] gives how much older than the pose they may be.
    ///
    /// # Errors
    /// [`LinkError::MixedInstants`] when another client moves the arm meanwhile, repeatedly; otherwise as for any call.
    pub fn grab(&mut self) -> Result<Frame, LinkError> {
        let held = Held::acquire(&mut self.sim)?;
        let outcome = self.read_held();
        held.release(&mut self.sim, outcome)
    }

    /// All of one instant while simulated time is held. Requests of other clients are served meanwhile, so one that moves
    /// the arm may move a joint between image and pose: then it is done again.
    fn read_held(&mut self) -> Result<Frame, LinkError> {
        for _ in 0..ATTEMPTS {
            let before = if self.renews { Some(self.base_from_tip()?) } else { None };
            let image_age_s = self.renew()?;
            let frame = self.read(image_age_s)?;
            // Images that cannot be requested, or that come with their moment, are as old as reported.
            let Some(before) = before.filter(|_| self.renews) else { return Ok(frame) };
            if frame.base_from_tip == before && self.base_from_tip()? == before {
                return Ok(frame);
            }
        }
        Err(LinkError::MixedInstants { attempts: ATTEMPTS })
    }

    fn base_from_tip(&mut self) -> Result<Pose<Base, Tip>, LinkError> {
        self.sim.get_object_pose(self.objects.tip, ObjectHandle::WORLD)
    }

    /// Has the sensors take their images; returns how much older than the pose they may be even so.
    fn renew(&mut self) -> Result<f64, LinkError> {
        if self.renews {
            match self.sim.handle_vision_sensors() {
                Err(error @ LinkError::Remote { .. }) => {
                    tracing::info!(%error, "images may be a pass older than the pose beside them");
                    self.renews = false;
                }
                outcome => return outcome.map(|()| 0.0),
            }
        }
        // A cell that reports the moment of its images reports pose and joints of the same instant.
        Ok(if self.tells_moment { 0.0 } else { self.info.time_step_s })
    }

    fn read(&mut self, image_age_s: f64) -> Result<Frame, LinkError> {
        let Some(shown) = self.shown()? else { return self.read_present(image_age_s) };
        Ok(Frame {
            image_age_s: 0.0,
            rgb: self.sim.get_vision_sensor_image(self.objects.camera)?,
            depth: self.sim.get_vision_sensor_depth(self.objects.depth)?,
            sim_time_s: shown.sim_time_s,
            base_from_tip: shown.base_from_tip,
            joints: shown.joints,
            base_from_target_true: shown.base_from_target,
        })
    }

    /// The robot and the time that the newest images show, from a cell that reports them; `None` where they show nothing
    /// yet.
    pub fn shown(&mut self) -> Result<Option<ShownMoment>, LinkError> {
        if !self.tells_moment {
            return Ok(None);
        }
        match truth::shown_moment(&mut self.sim, self.objects.joints.len()) {
            Err(error) if error.is_unknown_function() => {
                self.tells_moment = false;
                Ok(None)
            }
            outcome => outcome,
        }
    }

    fn read_present(&mut self, image_age_s: f64) -> Result<Frame, LinkError> {
        Ok(Frame {
            image_age_s,
            sim_time_s: self.sim.get_simulation_time()?,
            base_from_tip: self.base_from_tip()?,
            joints: read_joint_values(&mut self.sim, &self.objects)?,
            rgb: self.sim.get_vision_sensor_image(self.objects.camera)?,
            depth: self.sim.get_vision_sensor_depth(self.objects.depth)?,
            base_from_target_true: None,
        })
    }

    /// True pose and intrinsics of the camera of a simulated cell. For comparison with a result; never an input of a
    /// solver.
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
