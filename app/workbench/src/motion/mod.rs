//! Moving the arm: goals, jogging, and what refuses or ends a motion.

pub(crate) mod ask;
pub mod command;
pub mod correction;
pub mod desk;
pub mod grip;
pub(crate) mod jog_line;
pub(crate) mod rest;
pub(crate) mod state;
pub mod stop_line;
pub(crate) mod update;
pub mod way;
pub(crate) mod worker;

pub use command::{Command, Event};
