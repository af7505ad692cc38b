//! Commands and events of moving the arm.

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_session::CaptureId;
use serde::{Deserialize, Serialize};

use crate::motion::state::{JogSettings, MotionId};
use crate::text::Text;
use handeye_link::{Jog, MotionGoal, MotionOutcome};

/// What the user wants of moving the arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Stop the arm where it is, now.
    Stop,
    /// Move the arm to a place, which the words name.
    Move {
        /// Where to.
        goal: MotionGoal,
        /// In words.
        what: Text,
    },
    /// Move the tip so that it really is at this pose, allowing for the errors of the arm that the calibration found.
    MoveCorrected {
        /// Where the tip should be.
        base_from_tip: Pose<Base, Tip>,
        /// In words.
        what: Text,
    },
    /// A jog button is pressed: one step, or the beginning of holding it.
    Jog(Jog),
    /// It is still held. The arm stops by itself when this does not come.
    JogHeld(Jog),
    /// It was released.
    JogReleased,
    /// How the tip is jogged.
    SetJog(JogSettings),
    /// Move to where the arm was when the cell was connected.
    GoHome,
    /// Move to where a capture was taken.
    GoToCapture(CaptureId),
}

/// What has happened to moving the arm.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The arm was commanded to stay where it is.
    Stopped,
    /// A motion has ended.
    Moved {
        /// Which one.
        id: MotionId,
        outcome: MotionOutcome,
    },
    /// A held jog button has no more effect: the arm is at rest.
    JogEnded {
        /// Why, when it was not released.
        why: Option<Text>,
    },
}
