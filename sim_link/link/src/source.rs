//! The cell of the workbench.

use std::sync::Arc;

use handeye_cell::scene::{ArmErrorsSpec, SceneChoice};
use handeye_coppeliasim::cell::CellPaths;
use serde::{Deserialize, Serialize};

use crate::drivers::{DrivenCell, Drivers};
use crate::{Cell, RemoteCell};

/// The cell of the workbench.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum CellSource {
    /// The cell inside this program, started by it, with this scene.
    BuiltIn(SceneChoice),
    /// A server that runs already.
    Address(String),
    /// Programs with the driver protocol.
    Drivers(Drivers),
}

impl CellSource {
    /// The cell; `objects` is where another scene than the built-in one has its parts. Nothing is started or connected to yet.
    pub fn cell(&self, objects: &CellPaths) -> Arc<dyn Cell> {
        self.cell_with(objects, None)
    }

    /// The same; the built-in one has these errors of the arm in place of those of its scene.
    pub fn cell_with(&self, objects: &CellPaths, arm_errors: Option<ArmErrorsSpec>) -> Arc<dyn Cell> {
        match self {
            Self::Drivers(drivers) => Arc::new(DrivenCell::new(drivers.clone())),
            Self::Address(address) => Arc::new(RemoteCell::at(address.clone(), objects.clone())),
            Self::BuiltIn(scene) => Arc::new(RemoteCell::built_in(scene.clone(), arm_errors)),
        }
    }

    /// Whether it is the cell inside this program, of any scene.
    pub fn is_built_in(&self) -> bool {
        matches!(self, Self::BuiltIn(_))
    }
}

impl Default for CellSource {
    fn default() -> Self {
        Self::BuiltIn(SceneChoice::default())
    }
}
