//! The live images: colour, depth, and what is drawn over them.

pub mod command;
pub mod depth;
pub(crate) mod state;
pub(crate) mod update;
pub(crate) mod worker;

pub use command::{Command, Event};
