//! Commands and events of guided capture.

use serde::{Deserialize, Serialize};

use crate::guided::state::ChoiceOutcome;
use crate::motion::state::MotionId;

/// What the user wants of guided capture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Choose poses, visit them and capture there until the goal is reached.
    CalibrateForMe,
}

/// What has happened to guided capture.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The next pose of a guided sequence was chosen, or cannot be.
    #[serde(skip)]
    Chosen {
        /// The number of the request.
        id: MotionId,
        /// What was chosen.
        outcome: ChoiceOutcome,
    },
}
