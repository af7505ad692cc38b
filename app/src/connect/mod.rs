//! The connection to a cell: choosing it, its state, starting and stopping its simulation.

pub(crate) mod dialog;
pub(crate) mod drivers;
mod objects;
pub(crate) mod pane;
pub(crate) mod update;
pub(crate) mod worker;

use crate::model::CellSource;
use crate::text;
use crate::text::Text;

/// What is connected, in the user's language where it is part of this program.
pub(crate) fn server_name(source: &CellSource, server: &str) -> Text {
    match source {
        CellSource::BuiltIn => text!("built-in cell"),
        CellSource::Address(_) | CellSource::Drivers(_) => Text::verbatim(server),
    }
}
