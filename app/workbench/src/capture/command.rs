//! Commands and events of captures.

use handeye_session::CaptureId;
use serde::{Deserialize, Serialize};

use crate::capture::state::{CaptureOptions, CapturePurpose, CaptureRefused, CaptureWait};

/// What the user wants of captures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Take a capture as soon as robot and image have settled.
    Take(CapturePurpose),
    /// Cancel the capture.
    Cancel,
    /// How captures are taken.
    SetOptions(CaptureOptions),
}

/// What has happened to captures.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The capture that is under way waits for something else.
    Waits { number: u64, wait: CaptureWait },
    /// There is no capture.
    Refused {
        number: u64,
        /// The reason.
        refused: CaptureRefused,
    },
    /// A capture is on the disk.
    Captured {
        /// The number of the request.
        number: u64,
        /// Its number in the session.
        id: CaptureId,
    },
}
