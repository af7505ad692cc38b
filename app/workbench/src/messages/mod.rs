//! What the program reports: log, toasts, the banner.

pub mod command;
pub(crate) mod state;
pub(crate) mod update;

pub use command::{Command, Event};
