//! The recording for Rerun and its viewer.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::text::Text;

/// The recording as the window shows it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RerunState {
    /// Whether anything is recorded.
    pub on: bool,
    /// The file next to the session that is written.
    pub file: Option<PathBuf>,
    /// How it is viewed.
    pub viewer: ViewerState,
    /// Live entries that were dropped because the viewer or the disk was slow.
    pub left_out: u64,
}

/// A viewer of the recording.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub enum ViewerState {
    /// There is none.
    #[default]
    Closed,
    /// One is being started.
    Opening,
    /// The native viewer was started.
    Native,
    /// The web viewer is served at this address.
    Web {
        /// The page to open in a browser.
        url: String,
    },
    /// A viewer that runs elsewhere.
    Connected {
        /// Where.
        url: String,
    },
    /// None could be opened.
    Failed(Text),
}
