//! The connection to a cell: choosing it, its state, starting and stopping its simulation.

pub(crate) mod dialog;
pub(crate) mod pane;
pub(crate) mod update;
pub(crate) mod worker;
