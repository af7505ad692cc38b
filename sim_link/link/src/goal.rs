//! Goals of an arm's motions, and their outcome.

use handeye_arm::{JointKind, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_wording::Text;
use serde::{Deserialize, Serialize};

/// Where to move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum MotionGoal {
    /// These joint positions \[rad, or m of a prismatic joint\].
    Joints(JointValues),
    /// This pose of the tip.
    Tip(Pose<Base, Tip>),
}

/// How a motion ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum MotionOutcome {
    /// The arm is there and at rest.
    Arrived,
    /// It was not begun, and this is why.
    Refused(Text),
    /// The arm is at rest, but not at its goal, which may be out of reach.
    Unreached(Text),
    /// It was stopped on its way.
    Stopped,
    /// It was begun and did not get there.
    Failed(Text),
    /// The same, because another client holds the simulation.
    Held(Text),
}

impl MotionOutcome {
    /// Why the arm is not at its goal, where there is a reason to report.
    pub fn why(&self) -> Option<&Text> {
        match self {
            Self::Refused(why) | Self::Unreached(why) | Self::Failed(why) | Self::Held(why) => Some(why),
            Self::Arrived | Self::Stopped => None,
        }
    }
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
    /// The axes of the robot's base.
    #[default]
    Base,
    /// The axes of the tip.
    Tip,
    /// The axes of the camera, by the current calibration or else by the cell's own value; turns are about its centre.
    Camera,
}

/// One direction of jogging; `forward` selects the sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Jog {
    /// One joint, counted from 0 at the base.
    Joint {
        /// The joint, counted from 0 at the base.
        index: usize,
        /// Towards larger values.
        forward: bool,
    },
    /// The tip, along an axis.
    Translate {
        /// Frame of the axis.
        frame: JogFrame,
        /// The axis, x, y or z.
        axis: Axis,
        /// Sense.
        forward: bool,
    },
    /// The tip, about an axis; right-handed when forward.
    Rotate {
        /// Frame of the axis.
        frame: JogFrame,
        /// The axis, x, y or z.
        axis: Axis,
        /// Sense.
        forward: bool,
    },
}

impl Jog {
    /// Whether it is a length, in metres, and not an angle, in radians; `kind` gives the kind of a joint.
    pub fn is_length(&self, kind: impl Fn(usize) -> JointKind) -> bool {
        match *self {
            Self::Translate { .. } => true,
            Self::Rotate { .. } => false,
            Self::Joint { index, .. } => kind(index) == JointKind::Prismatic,
        }
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
