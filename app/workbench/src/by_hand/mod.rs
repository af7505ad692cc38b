//! Guided capture for an arm that is moved by hand: the window shows how the board should look in the image and what to
//! change, and captures by itself when the view is good enough and the robot is at rest.
//!
//! [`handeye_plan::guided::by_hand`] chooses and judges the views, on a thread of its own: no connection of the arm is
//! needed except the one that reports where it is.

pub mod command;
pub mod state;
pub(crate) mod update;
pub(crate) mod worker;

pub use command::{Command, Event};
