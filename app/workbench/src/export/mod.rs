//! The calibration in other formats.

pub mod command;
pub(crate) mod state;
pub(crate) mod update;

pub use command::{Command, Event};
