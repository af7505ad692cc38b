//! Commands and events of recordings in other tools' formats.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::import::state::{Converted, Found, ImportWork};
use crate::text::Text;

/// What the user wants of recordings in other tools' formats.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// The target of the recording that is imported, as it is typed; empty: as its files have it.
    SetTarget(String),
    /// Read the files of the recording again, for at most this many seconds.
    SetTime(u32),
    /// A convention of that recording, which the data may not determine.
    FixConvention {
        /// Its key, as `handeye import --set` has it.
        key: String,
        /// Its value; `None`: as the data determine.
        value: Option<String>,
    },
    /// Take this hypothesis about the recording, by its place in the list.
    ChooseHypothesis(usize),
    /// Make a session of the recording.
    ConvertRecording,
    /// Makes a session of the images alone, to calibrate the camera by itself.
    ConvertImages,
}

/// What has happened to recordings in other tools' formats.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// There is neither a session nor a data set: it may be a recording of another tool.
    NoSession(PathBuf),
    /// Progress of examining or converting a recording.
    Progress {
        /// The number of the request.
        number: u64,
        /// How far.
        work: ImportWork,
    },
    /// A recording was examined.
    #[serde(skip)]
    Looked {
        /// The number of the request.
        number: u64,
        /// What was found; `None` where its files cannot be read.
        found: Option<Arc<Found>>,
        /// Why no more was.
        trouble: Option<Text>,
    },
    /// A recording was converted to a data set, or cannot be.
    #[serde(skip)]
    Converted {
        /// The number of the request.
        number: u64,
        /// The data set.
        converted: Result<Arc<Converted>, Text>,
    },
}
