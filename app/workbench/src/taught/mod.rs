//! Taught poses, and the sequence that visits them.

mod cell;
pub mod command;
pub(crate) mod sequence;
pub mod update;

pub use command::{Command, Event};
