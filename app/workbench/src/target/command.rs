//! Commands of the target.

use handeye_geometry::targets::TargetSpec;
use handeye_print::Page;
use serde::{Deserialize, Serialize};

/// What the user wants of the target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Another target.
    Set(TargetSpec),
    /// Write the target for a printer, on this page.
    Print(Page),
}
