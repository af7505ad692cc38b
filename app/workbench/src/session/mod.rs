//! The session: the thread that keeps it, its folder, undo and redo.

pub(crate) mod archive;
pub mod command;
pub(crate) mod desk;
pub mod facts;
pub(crate) mod requests;
pub mod start;
pub(crate) mod state;
pub(crate) mod update;

pub use command::{Command, Event};
