//! What may be wanted of moving the arm, and what is reported.

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_session::CaptureId;
use serde::{Deserialize, Serialize};

use crate::model::{Jog, JogSettings, MotionGoal, MotionId, MotionOutcome};
use crate::text::Text;

/// What the user wants of moving the arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Have the arm stay where it is, now.
    Stop,
    /// Move the arm to a place, which the words name.
    Move {
        /// Where to.
        goal: MotionGoal,
        /// In words.
        what: Text,
    },
    /// Move the tip to where it really is at this pose, by the errors of the arm that the calibration found.
    MoveCorrected {
        /// Where the tip shall be.
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
    /// Move to where the arm stood when the cell was connected.
    GoHome,
    /// Move to where a capture was taken.
    GoToCapture(CaptureId),
    /// Let the arm make the move that waits for it.
    ConfirmMove,
    /// Leave out the move that waits; a sequence goes on with another pose.
    SkipMove,
    /// Whether each move to a chosen pose waits to be confirmed.
    SetConfirmMoves(bool),
}

/// What has happened to moving the arm.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The arm was told to stay where it is.
    Stopped,
    /// A motion has ended.
    Moved {
        /// Which one.
        id: MotionId,
        outcome: MotionOutcome,
    },
    /// A held jog button can do no more, or may not: the arm stands.
    JogEnded {
        /// Why, when it was not released.
        why: Option<Text>,
    },
}
