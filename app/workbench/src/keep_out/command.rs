//! Commands and events of the boxes that the arm keeps out of.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_plan::Surroundings;
use handeye_plan::surroundings::KeepOutFile;
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// What the user wants of the boxes that the arm keeps out of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// The boxes that the arm keeps out of are these.
    Set(Box<KeepOutFile>),
    /// Read them from a file.
    Import(PathBuf),
    /// Write them to a file.
    Export(PathBuf),
}

/// What has happened to the boxes that the arm keeps out of.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The obstacles that the cell reports, now that the arm keeps out of the boxes, too; or why it does not.
    #[serde(skip)]
    Standing(Result<Arc<Surroundings>, Text>),
    /// Boxes to keep out of, from a file.
    Read(Box<KeepOutFile>),
}
