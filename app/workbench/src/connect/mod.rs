//! The connection to a cell: choosing it, its state, starting and stopping its simulation.

pub mod command;
pub mod offered;
pub(crate) mod state;
pub(crate) mod update;
pub(crate) mod worker;

pub use command::{Command, Event};

use crate::text::Text;
use handeye_link::CellSource;
use handeye_wording::text;

/// What is connected, in the user's language where it is part of this program.
pub fn server_name(source: &CellSource, server: &str) -> Text {
    match source {
        CellSource::BuiltIn(_) => text!("built-in cell"),
        CellSource::Address(_) | CellSource::Drivers(_) => Text::verbatim(server),
    }
}
