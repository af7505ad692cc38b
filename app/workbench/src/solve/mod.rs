//! The calibration: solving in the background, the answer with its error, charts.

pub mod command;
pub(crate) mod estimated;
pub(crate) mod observer;
pub(crate) mod question;
pub(crate) mod state;
pub(crate) mod tip_box;
pub(crate) mod update;
pub(crate) mod worker;

pub use command::{Command, Event, SolveOutcome};
