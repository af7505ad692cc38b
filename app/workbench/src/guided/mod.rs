//! Guided capture in the window: one button from the board in view to a calibration that was checked.
//!
//! It is a sequence of poses that grows: after each capture and its answer the motion thread, which knows the arm, has the
//! next pose chosen ([`handeye_plan::guided`]). Whatever ends another sequence ends it, too: STOP, another cell, another
//! session.

pub mod command;
pub(crate) mod progress;
pub mod state;
pub(crate) mod update;

pub use command::{Command, Event};
