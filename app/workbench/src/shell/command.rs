//! Commands of the window around the panes.

use serde::{Deserialize, Serialize};

use crate::shell::state::{Dialog, Pane, Step};
use crate::shell::view::{RotationFormat, ThemeChoice};
use crate::text::Language;

/// What the user wants of the window around the panes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Light or dark.
    SetTheme(ThemeChoice),
    /// Language of all texts.
    SetLanguage(Language),
    /// How rotations are written.
    SetRotationFormat(RotationFormat),
    /// Which step of the work is in front.
    GoToStep(Step),
    /// Which dialog is open.
    SetDialog(Option<Dialog>),
    /// Bring a pane to the front.
    ShowPane(Pane),
    /// Put every pane back to its initial place.
    ResetLayout,
}
