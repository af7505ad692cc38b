//! What may be wanted of captures, and what is reported.

use handeye_session::CaptureId;
use serde::{Deserialize, Serialize};

use crate::model::{CaptureOptions, CapturePurpose, CaptureRefused, CaptureWait};

/// What the user wants of captures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Take a capture as soon as robot and image have settled.
    Take(CapturePurpose),
    /// Not now.
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
        /// Why.
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
