//! Commands of the 3D pane.

use serde::{Deserialize, Serialize};

use super::view::SceneView;

/// What the user wants of the 3D pane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// The viewpoint of the 3D pane.
    SetView(SceneView),
}
