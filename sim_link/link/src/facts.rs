//! Facts that a cell reports about itself and its robot.

use handeye_arm::{JointKind, JointValues};
use handeye_coppeliasim::cell::{ArmKinematics, CellInfo, CellJoint, GroundTruth};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use serde::{Deserialize, Serialize};

/// What is known about the cell once it is connected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellFacts {
    /// The joints from the base up.
    pub joints: Vec<JointFacts>,
    /// Intrinsics from the camera's settings, without distortion, or from a driver: good enough for drawing before
    /// there is a calibration.
    pub nominal_intrinsics: Option<Intrinsics>,
    /// The arm as it was measured. Where that is not known, goals are not checked before anything moves, and it is not
    /// drawn.
    pub arm: Option<ArmKinematics>,
    /// Why that is not known of a chain of joints that a driver names.
    #[serde(default)]
    pub arm_doubt: Option<ArmDoubt>,
    /// What a simulated cell publishes for comparison; never read by a solver.
    pub truth: Option<Truth>,
    /// Whether the camera measures depth.
    pub has_depth: bool,
    /// How the arm may be moved from here.
    pub moves: Moves,
    /// Whether a person types the pose of the robot, because nothing reports it.
    pub poses_are_typed: bool,
}

/// Why the chain of joints that a driver names is not used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum ArmDoubt {
    /// The arm has not been at rest at enough places to determine the place of the chain and its tool.
    Open,
    /// The tip or the flange computed from the joints is not where the driver reports it.
    Foreign {
        /// Distance between both \[m\].
        distance_m: f64,
        /// Angle between both \[rad\].
        angle_rad: f64,
    },
}

/// How the workbench may move an arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Moves {
    /// In every way: a simulation.
    Freely,
    /// To goals and in steps, once a person allows it: a robot behind a driver.
    OnceArmed {
        /// Goals as joint values are possible.
        joints: bool,
        /// Goals as poses of the tip are possible.
        tip: bool,
    },
    /// Not at all.
    Never,
}

impl CellFacts {
    /// From the information of the cell.
    pub(crate) fn new(info: &CellInfo, arm: Option<&ArmKinematics>, truth: Option<&GroundTruth>) -> Self {
        Self {
            joints: info.joints.iter().map(JointFacts::from).collect(),
            nominal_intrinsics: Some(info.camera_intrinsics_nominal()),
            arm: arm.cloned(),
            arm_doubt: None,
            truth: truth.map(Truth::from),
            has_depth: true,
            moves: Moves::Freely,
            poses_are_typed: false,
        }
    }
}

/// A joint of the arm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct JointFacts {
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Range \[rad, or m of a prismatic joint\]; `None` for a cyclic joint.
    pub range: Option<[f64; 2]>,
}

impl From<&CellJoint> for JointFacts {
    fn from(joint: &CellJoint) -> Self {
        let range = [joint.range.min, joint.range.max];
        Self { kind: joint.kind, range: range.iter().all(|end| end.is_finite()).then_some(range) }
    }
}

/// Where everything really is, in a simulated cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The camera on the tip.
    pub tip_from_camera: Pose<Tip, Camera>,
    /// The board.
    pub base_from_target: Option<Pose<Base, Target>>,
    /// The camera.
    pub intrinsics: Intrinsics,
}

impl From<&GroundTruth> for Truth {
    fn from(published: &GroundTruth) -> Self {
        let GroundTruth { tip_from_camera, base_from_target, intrinsics, .. } = *published;
        Self { tip_from_camera, base_from_target, intrinsics }
    }
}

/// Whether simulated time advances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Simulation {
    /// It does not; images are not renewed.
    Stopped,
    /// It does not for now.
    Paused,
    /// It does.
    Running,
}

/// The robot at one instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotState {
    /// The tip as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Positions of the joints from the base up \[rad, or m of a prismatic joint\]; empty where they are not reported.
    pub joints_rad: JointValues,
    /// Simulated time \[s\]; of a robot behind a driver, time of the workbench.
    pub sim_time_s: f64,
    /// Whether it advances.
    pub simulation: Simulation,
    /// Whether a robot behind a driver may be moved.
    pub is_armed: bool,
}
