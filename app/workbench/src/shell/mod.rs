//! The window around the panes: steps, dialogs, language and theme.

pub mod command;
pub(crate) mod state;
pub(crate) mod update;
pub(crate) mod view;

pub use command::Command;
