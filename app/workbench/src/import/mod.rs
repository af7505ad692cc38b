//! Other people's recordings become data sets and sessions.

pub mod command;
pub mod state;
pub mod understand;
pub(crate) mod update;
pub mod worker;

pub use command::{Command, Event};
