//! Boxes that the arm keeps out of, besides what the cell says stands around it: drawn in the 3D pane, kept in a file.

pub mod command;
pub mod state;
pub(crate) mod update;

pub use command::{Command, Event};
