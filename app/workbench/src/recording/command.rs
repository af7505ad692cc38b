//! Commands and events of the recording for Rerun.

use serde::{Deserialize, Serialize};

use crate::recording::state::RerunState;

/// What the user wants of the recording for Rerun.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Open the recording in Rerun.
    OpenRerun,
}

/// What has happened to the recording for Rerun.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The recording is in another state.
    Rerun(RerunState),
    /// The web viewer is served, and the system has no browser to show it.
    NoBrowser,
}
