//! Taught poses, and the sequence that visits them.

pub(crate) mod break_off;
mod cell;
pub mod command;
mod confirm;
pub(crate) mod sequence;
pub mod update;

pub use command::{Command, Event};
