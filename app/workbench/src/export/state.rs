//! The export dialog.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use handeye_export::ExportNames;
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// What is exported, and how that went.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportState {
    /// Names of the chosen formats.
    pub chosen: BTreeSet<String>,
    /// Names of frames and files.
    pub names: ExportNames,
    /// Where to; `None` is `exports` in the session.
    pub folder: Option<PathBuf>,
    /// The format whose text is shown below its name.
    pub shown: Option<String>,
    /// The text of every format for the present result and names.
    pub previews: BTreeMap<String, Preview>,
    /// How the last writing went.
    pub written: Option<Written>,
    /// Whether files of the present captures are there, written now or in an earlier run.
    pub is_present: bool,
    /// Whether files are being written.
    pub writing: bool,
}

impl Default for ExportState {
    fn default() -> Self {
        Self {
            chosen: ["json", "ros_camera_info", "opencv_yaml", "easy_handeye2"].map(str::to_owned).into(),
            names: ExportNames::default(),
            folder: None,
            shown: None,
            previews: BTreeMap::new(),
            written: None,
            is_present: false,
            writing: false,
        }
    }
}

/// The files of a format, or why it cannot hold this result.
pub type Preview = Result<Vec<PreviewFile>, Text>;

/// A file as it would be written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PreviewFile {
    pub name: String,
    pub text: String,
}

/// What was written, each file read back and compared; or what went wrong.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Written {
    /// Where.
    pub folder: PathBuf,
    /// The files, or why there are none.
    pub files: Result<Vec<PathBuf>, Text>,
}
