//! Boxes that the arm keeps out of, in addition to the obstacles that the cell reports: drawn in the 3D pane, kept in a
//! file.

pub mod command;
pub(crate) mod file;
pub mod state;
pub(crate) mod update;

pub use command::{Command, Event};
