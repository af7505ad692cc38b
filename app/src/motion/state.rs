//! What the arm does and is asked to do.

use handeye_core::geometry::camera::Intrinsics;
use handeye_core::geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_sim_link::client::cell::{ArmChain, ArmKinematics, CellInfo, GroundTruth, JointAngles, Support};
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// What is known about the cell once it is connected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellFacts {
    /// Ranges of the joints \[rad\] from the base up; `None` for a joint that turns without end.
    pub joint_ranges_rad: [Option<[f64; 2]>; 6],
    /// What the camera's settings say, without its lens: good enough to draw with before there is a calibration.
    pub nominal_intrinsics: Intrinsics,
    /// Whether it is known how the tip moves with the joints: goals are then checked before anything moves.
    pub is_arm_known: bool,
    /// The arm as it was measured, if it is the UR5, whose bodies are known: where it is drawn.
    pub arm: Option<ArmChain>,
    /// What works with the server's version.
    pub support: Support,
    /// What a simulated cell publishes for comparison; never read by a solver.
    pub truth: Option<Truth>,
}

impl CellFacts {
    /// By what the cell says of itself.
    pub fn new(info: &CellInfo, arm: Option<&ArmKinematics>, truth: Option<&GroundTruth>) -> Self {
        Self {
            joint_ranges_rad: info.joint_intervals.map(|i| (!i.cyclic).then_some([i.min_rad, i.max_rad])),
            nominal_intrinsics: info.camera_intrinsics_nominal(),
            is_arm_known: arm.is_some(),
            arm: arm.and_then(ArmKinematics::ur5_chain),
            support: info.support(),
            truth: truth.map(Truth::from),
        }
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

/// Counts motions, so that what is reported can be told from what came before.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MotionId(pub u64);

/// Where to move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum MotionGoal {
    /// These joint positions \[rad\].
    Joints(JointAngles),
    /// This pose of the tip.
    Tip(Pose<Base, Tip>),
}

/// A motion that is asked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MotionRequest {
    /// Its number.
    pub id: MotionId,
    /// Where to.
    pub goal: MotionGoal,
    /// Share of the fastest speed, over 0 and up to 1.
    pub speed: f64,
}

/// How a motion ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum MotionOutcome {
    /// The arm is there and at rest.
    Arrived,
    /// It was not begun, and this is why.
    Refused(Text),
    /// It was stopped on its way.
    Stopped,
    /// It was begun and did not get there.
    Failed(Text),
}

/// What the arm does now, as far as this program moves it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// Nothing.
    #[default]
    Idle,
    /// It is on its way.
    Moving {
        /// Which motion.
        id: MotionId,
        /// Where to, in words.
        what: Text,
        /// Since when.
        since_s: f64,
    },
    /// A jog button is held.
    Jogging(Jog),
}

/// Axes of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Axis {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

impl Axis {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];
}

/// Along which axes the tip is jogged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum JogFrame {
    /// Those of the robot's base.
    #[default]
    Base,
    /// Those of the tip.
    Tip,
    /// Those of the camera, by the current calibration or else by what the cell says of it; turns are about its centre.
    Camera,
}

/// One direction of jogging; `forward` tells the two ways apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Jog {
    /// One joint, counted from 0 at the base.
    Joint {
        /// Which.
        index: usize,
        /// Towards larger angles.
        forward: bool,
    },
    /// The tip, along an axis.
    Translate {
        /// Whose axis.
        frame: JogFrame,
        /// Which axis.
        axis: Axis,
        /// Which way.
        forward: bool,
    },
    /// The tip, about an axis; right-handed when forward.
    Rotate {
        /// Whose axis.
        frame: JogFrame,
        /// Which axis.
        axis: Axis,
        /// Which way.
        forward: bool,
    },
}

/// How far one press of a jog button goes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub enum JogStep {
    /// As long as it is held.
    #[default]
    Hold,
    /// This far: metres for translations, radians for rotations and joints.
    Step {
        /// Translations.
        metres: f64,
        /// Rotations and joints.
        radians: f64,
    },
}

/// How the tip is jogged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JogSettings {
    /// Whose axes.
    pub frame: JogFrame,
    /// How far.
    pub step: JogStep,
    /// Share of the fastest speed, over 0 and up to 1.
    pub speed: f64,
}

impl Default for JogSettings {
    fn default() -> Self {
        Self { frame: JogFrame::Base, step: JogStep::Hold, speed: 0.25 }
    }
}
