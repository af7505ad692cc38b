//! Commands and events of exports.

use std::collections::BTreeSet;
use std::path::PathBuf;

use handeye_export::ExportNames;
use serde::{Deserialize, Serialize};

use crate::export::state::{Preview, Written};

/// What the user wants of exports.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Which formats are exported.
    ChooseFormats(BTreeSet<String>),
    /// The format whose text is shown.
    ShowFormat(Option<String>),
    /// Names of frames and files.
    SetNames(ExportNames),
    /// Where exports go; `None` is `exports` in the session.
    SetFolder(Option<PathBuf>),
    /// Write the chosen formats.
    Export,
}

/// What has happened to exports.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The text of every format.
    Previews(Vec<(String, Preview)>),
    /// Exports were written, or not.
    Written(Written),
}
