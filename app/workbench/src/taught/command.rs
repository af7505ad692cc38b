//! Commands and events of taught poses and sequences.

use std::path::PathBuf;

use handeye_arm::JointValues;
use handeye_dataset::taught_poses::TaughtPose;
use serde::{Deserialize, Serialize};

use crate::capture::state::CapturePurpose;
use crate::motion::state::MotionId;
use crate::text::Text;

/// What the user wants of taught poses and sequences.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Remember the place of the arm as a taught pose.
    Teach {
        /// Its name; one is chosen if not given.
        name: Option<String>,
    },
    /// Forget a taught pose.
    Remove(String),
    /// Rename a taught pose.
    Rename {
        /// Its present name.
        from: String,
        /// Its new name.
        to: String,
    },
    /// Change the position of a taught pose in the order.
    Reorder {
        name: String,
        /// Its new index, counted from 0.
        to: usize,
    },
    /// The ten reference poses instead of the taught ones.
    TeachReference,
    /// Take the taught poses of other cells for those of this one.
    Adopt,
    /// Taught poses from a file, after those that are there.
    Import(PathBuf),
    /// Taught poses into a file.
    Export(PathBuf),
    /// Move to a taught pose.
    GoTo(String),
    /// Visit all taught poses.
    RunSequence {
        /// What is captured at each; `None` only moves.
        purpose: Option<CapturePurpose>,
    },
    /// Continue the interrupted sequence, at the pose where it was.
    ContinueSequence,
    /// No more poses.
    StopSequence,
    /// Plan poses that are not in the fit, visit them, and capture for verification at each.
    VerifyAtPlanned,
    /// Allow the move that is waiting.
    ConfirmMove,
    /// Skip the move that waits; a sequence continues with another pose.
    SkipMove,
    /// Whether each move to a chosen pose waits to be confirmed.
    SetConfirmMoves(bool),
}

/// What has happened to taught poses and sequences.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// Taught poses were read from a file.
    Read {
        /// The poses.
        poses: Vec<TaughtPose>,
    },
    /// Poses to look at the board from were planned, or cannot be.
    Planned {
        /// The number of the request.
        id: MotionId,
        /// The joints at each \[rad\]; or why there are none.
        views: Result<Vec<JointValues>, Text>,
    },
}
