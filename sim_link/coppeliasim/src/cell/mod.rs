//! An arm with an RGB-D camera behind a remote API: what the workbench drives.
//!
//! [`CellClient`] finds the objects of the scene and holds two connections, because a connection can do one thing at a
//! time: [`Arm`] moves and stops, [`CameraFeed`] takes frames, and after [`CellClient::split`] each has its own thread,
//! so that images keep coming while the arm moves.
//!
//! # How motions are driven
//! Each point of a motion, a jog or a path that is followed is computed here and sent for one pass of the simulation: the
//! API has no way to end a motion of another client, and a client that crashes must leave an arm at rest. The simulation
//! is not taken into stepping mode for it: it keeps its pace, other clients keep theirs, and a crash cannot freeze it;
//! the price is that a slow network makes the arm pause for a pass now and then on its way, which changes nothing about
//! where it ends. Only the inverse kinematics of an arm that is not known is left to the server.

mod arm;
mod board;
mod camera;
mod follow;
mod follow_goal;
mod follow_plan;
mod hold;
mod jog;
mod jog_plan;
mod joint_elsewhere;
mod joints;
mod keep_off;
mod motion;
mod objects;
mod paths;
mod reach;
mod room;
mod sentinel;
mod served;
mod stream;
mod surroundings;
mod truth;
mod version;
mod views;

use std::sync::Arc;

use handeye_arm::JointKind;
use handeye_geometry::camera::Intrinsics;

pub use crate::error::version_name;
pub use arm::{Arm, MotionTolerance, SettleOptions};
pub use board::{BoardMotion, BoardPath, UnknownPath};
pub use camera::{CameraFeed, Frame};
pub use follow::{FollowMoment, FollowRequest};
pub use follow_goal::{FollowEnd, FollowGoal, FollowLimits, Workspace};
pub use jog::{ArmJog, JogAxes, JogEnd};
pub use jog_plan::{
    Contact, JOINT_SPEED as JOG_JOINT_SPEED_RAD_S, JogObstacle, LINE_SPEED as JOG_LINE_SPEED_M_S,
    TURN_SPEED as JOG_TURN_SPEED_RAD_S,
};
pub use joints::{CellJoint, RAD_PER_M};
pub use paths::{BadCellPath, CellPart, CellPaths};
pub use reach::{ArmKinematics, UnknownKinematics};
pub use room::{BoardReach, FollowPlace, NoPlace};
pub use surroundings::{Among, SceneObstacles};
pub use truth::{GroundTruth, TRUTH_FUNCTION};
pub use views::BoardInView;

use objects::CellObjects;

use super::endpoint::Endpoint;
use super::error::LinkError;
use super::options::ConnectionOptions;
use super::sim::{SensorOptics, Sim, SimulationState};

/// What is known about a cell once it has been found.
#[derive(Debug, Clone, PartialEq)]
pub struct CellInfo {
    /// Where the server is.
    pub endpoint: Endpoint,
    /// Version of the simulator, 41000 is 4.10.0; 0 when it does not report it.
    pub program_version: i64,
    /// Whether it is a cell of this project, which CoppeliaSim's version number does not show.
    pub is_handeye_cell: bool,
    /// The joints from the base up.
    pub joints: Vec<CellJoint>,
    /// The colour sensor.
    pub optics: SensorOptics,
    /// The depth sensor, whose clipping planes bound the depths.
    pub depth_optics: SensorOptics,
    /// Simulated time per pass (s).
    pub time_step_s: f64,
}

/// A cell: an arm and its camera, over two connections.
pub struct CellClient {
    info: Arc<CellInfo>,
    arm: Arm,
    camera: CameraFeed,
}

impl CellClient {
    /// Connects twice and finds the objects of the scene.
    ///
    /// # Errors
    /// [`LinkError::TooOld`] before CoppeliaSim 4.7; [`LinkError::NoSuchObject`] names the first object that is missing;
    /// otherwise as for any call.
    pub fn connect(endpoint: &Endpoint, options: &ConnectionOptions, paths: &CellPaths) -> Result<Self, LinkError> {
        let control = Sim::connect(endpoint, options.clone())?;
        // Two clients with one id would share one record on the server.
        let camera_options =
            ConnectionOptions { seed: options.seed.map(|seed| seed.wrapping_add(1)), ..options.clone() };
        let camera = Sim::connect(endpoint, camera_options)?;
        Self::over(control, camera, paths)
    }

    /// Over two connections to the same server.
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub fn over(mut control: Sim, camera: Sim, paths: &CellPaths) -> Result<Self, LinkError> {
        let (objects, info) = look_around(&mut control, paths)?;
        Ok(Self {
            arm: Arm::new(control, Arc::clone(&objects), Arc::clone(&info)),
            camera: CameraFeed::new(camera, objects, Arc::clone(&info)),
            info,
        })
    }

    /// What is known about the cell.
    pub fn info(&self) -> &CellInfo {
        &self.info
    }

    /// The connection that commands the arm.
    pub fn arm(&mut self) -> &mut Arm {
        &mut self.arm
    }

    /// The connection that fetches images.
    pub fn camera(&mut self) -> &mut CameraFeed {
        &mut self.camera
    }

    /// The two halves, each for its own thread.
    pub fn split(self) -> (Arm, CameraFeed) {
        (self.arm, self.camera)
    }
}

impl CellInfo {
    /// The camera that the colour sensor's settings describe: a pinhole without distortion. A cell that simulates a
    /// lens publishes the true one, see [`GroundTruth`].
    pub fn camera_intrinsics_nominal(&self) -> Intrinsics {
        self.optics.intrinsics()
    }

    /// How each joint moves, from the base up.
    pub fn joint_kinds(&self) -> impl Iterator<Item = JointKind> {
        self.joints.iter().map(|joint| joint.kind)
    }

    fn read(sim: &mut Sim, objects: &CellObjects, program_version: i64) -> Result<Self, LinkError> {
        let mut joints = Vec::with_capacity(objects.joints.len());
        for (index, &joint) in objects.joints.iter().enumerate() {
            let read = CellJoint::read(sim, joint)?;
            joints.push(read.ok_or(LinkError::SphericalJoint { joint: index + 1 })?);
        }
        Ok(Self {
            endpoint: sim.connection().endpoint().clone(),
            program_version,
            is_handeye_cell: truth::is_published(sim)?,
            joints,
            optics: sim.get_sensor_optics(objects.camera)?,
            depth_optics: sim.get_sensor_optics(objects.depth)?,
            time_step_s: sim.get_simulation_time_step()?,
        })
    }
}

/// Connects once and finds the objects of the scene.
fn discover(
    endpoint: &Endpoint,
    options: &ConnectionOptions,
    paths: &CellPaths,
) -> Result<(Sim, Arc<CellObjects>, Arc<CellInfo>), LinkError> {
    let mut sim = Sim::connect(endpoint, options.clone())?;
    let (objects, info) = look_around(&mut sim, paths)?;
    Ok((sim, objects, info))
}

/// The version first: a server that is too old lacks what the rest needs.
fn look_around(sim: &mut Sim, paths: &CellPaths) -> Result<(Arc<CellObjects>, Arc<CellInfo>), LinkError> {
    let program_version = version::program_version(sim)?;
    let objects = CellObjects::find(sim, paths)?;
    let info = CellInfo::read(sim, &objects, program_version)?;
    Ok((Arc::new(objects), Arc::new(info)))
}

fn require_running(sim: &mut Sim, task: &'static str) -> Result<(), LinkError> {
    match sim.get_simulation_state()? {
        SimulationState::Running => Ok(()),
        state => Err(LinkError::NotRunning { task, state }),
    }
}

#[cfg(test)]
mod tests;
