//! What the arm does and is asked to do.

use handeye_arm::{JointKind, JointValues};
use handeye_coppeliasim::cell::{ArmKinematics, CellInfo, CellJoint, GroundTruth};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// What is known about the cell once it is connected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellFacts {
    /// The joints from the base up.
    pub joints: Vec<JointFacts>,
    /// What the camera's settings say, without its lens, or a driver knows: good enough to draw with before there is a
    /// calibration.
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

/// Why the chain of joints that a driver names is not driven by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum ArmDoubt {
    /// The arm has not stood at enough places to tell where the chain stands and what tool it carries.
    Open,
    /// By the joints the tip or the flange is not where the driver reports it.
    Foreign {
        /// Distance between both \[m\].
        distance_m: f64,
        /// Angle between both \[rad\].
        angle_rad: f64,
    },
}

/// How an arm may be moved from the workbench.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Moves {
    /// In every way: a simulation.
    Freely,
    /// To goals and in steps, once a person allows it: a robot behind a driver.
    OnceArmed {
        /// To values of the joints.
        joints: bool,
        /// To poses of the tip.
        tip: bool,
    },
    /// Not at all.
    Never,
}

impl CellFacts {
    /// By what the cell says of itself.
    pub fn new(info: &CellInfo, arm: Option<&ArmKinematics>, truth: Option<&GroundTruth>) -> Self {
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
    /// How it moves.
    pub kind: JointKind,
    /// How far \[rad, or m of a prismatic joint\]; `None` for one that has no end.
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

/// Counts motions, so that what is reported can be told from what came before.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MotionId(pub u64);

/// Where to move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum MotionGoal {
    /// These joint positions \[rad, or m of a prismatic joint\].
    Joints(JointValues),
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

/// A move that waits until a person lets the arm go.
#[derive(Debug, Clone, PartialEq)]
pub struct AskedMove {
    /// Where to.
    pub goal: MotionGoal,
    /// In words.
    pub what: Text,
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

impl MotionOutcome {
    /// Why the arm is not at its goal, where there is a reason to say.
    pub fn why(&self) -> Option<&Text> {
        match self {
            Self::Refused(why) | Self::Failed(why) => Some(why),
            Self::Arrived | Self::Stopped => None,
        }
    }
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
        /// Towards larger values.
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

impl Jog {
    /// Whether it goes along something, in metres, and not about it, in radians; `kind` says how a joint moves.
    pub fn is_length(&self, kind: impl Fn(usize) -> JointKind) -> bool {
        match *self {
            Self::Translate { .. } => true,
            Self::Rotate { .. } => false,
            Self::Joint { index, .. } => kind(index) == JointKind::Prismatic,
        }
    }
}

/// How far one press of a jog button goes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub enum JogStep {
    /// As long as it is held.
    #[default]
    Hold,
    /// This far: metres for translations and prismatic joints, radians for rotations and revolute joints.
    Step {
        /// Translations and prismatic joints.
        metres: f64,
        /// Rotations and revolute joints.
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
    /// Share of the fastest speed, over 0 and up to 1; `None` as [`Model::speed`](crate::model::Model::speed) has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed: Option<f64>,
}

impl Default for JogSettings {
    fn default() -> Self {
        Self { frame: JogFrame::Base, step: JogStep::Hold, speed: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_a_prismatic_joint_is_a_length_and_one_of_a_revolute_joint_an_angle() {
        let kind = |joint: usize| if joint == 1 { JointKind::Prismatic } else { JointKind::Revolute };
        let is_length = |jog: Jog| jog.is_length(kind);
        let (frame, axis, forward) = (JogFrame::Base, Axis::X, true);
        assert!(is_length(Jog::Joint { index: 1, forward }) && is_length(Jog::Translate { frame, axis, forward }));
        assert!(!is_length(Jog::Joint { index: 0, forward }) && !is_length(Jog::Rotate { frame, axis, forward }));
    }
}
