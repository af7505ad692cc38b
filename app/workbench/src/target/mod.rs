//! The target, the camera and where it is mounted.

pub mod command;
pub(crate) mod print;
pub(crate) mod update;

pub use command::Command;
