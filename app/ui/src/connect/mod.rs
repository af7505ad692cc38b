//! The connection to a cell: choosing it, its state, starting and stopping its simulation.

pub(crate) mod dialog;
pub(crate) mod drivers;
mod objects;
pub(crate) mod pane;
mod scene;
