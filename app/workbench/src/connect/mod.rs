//! The connection to a cell: choosing it, its state, starting and stopping its simulation.

pub mod drivers;
pub mod stop_line;
pub(crate) mod update;
pub(crate) mod worker;

use std::sync::Arc;

use handeye_coppeliasim::cell::CellPaths;

use crate::model::CellSource;
use crate::text::Text;
use crate::worker::{Connector, LiveConnector};
use drivers::DriverConnector;
use handeye_wording::text;

/// What connects to a cell; `objects` is where another scene than the built-in one has its parts.
pub fn connector(source: &CellSource, objects: &CellPaths) -> Arc<dyn Connector> {
    match source {
        CellSource::Drivers(drivers) => Arc::new(DriverConnector::new(drivers.clone())),
        CellSource::Address(address) => Arc::new(LiveConnector::at(address.clone(), objects.clone())),
        CellSource::BuiltIn(scene) => Arc::new(LiveConnector::built_in(scene.clone())),
    }
}

/// What is connected, in the user's language where it is part of this program.
pub fn server_name(source: &CellSource, server: &str) -> Text {
    match source {
        CellSource::BuiltIn(_) => text!("built-in cell"),
        CellSource::Address(_) | CellSource::Drivers(_) => Text::verbatim(server),
    }
}
