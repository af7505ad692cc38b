//! The board from image to image, and the arm that follows it.

pub mod command;
pub mod follow;
pub(crate) mod follow_line;
pub(crate) mod state;
pub(crate) mod trail;
pub(crate) mod update;
pub(crate) mod worker;

pub use command::{Command, Event};
