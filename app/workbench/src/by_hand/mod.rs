//! Guided capture for an arm that a person moves: the window shows how the board is to look in the image and what to change,
//! and captures by itself when the view is good enough and the robot stands still.
//!
//! [`handeye_plan::guided::by_hand`] chooses and judges the views, on a thread of its own: no connection of the arm is
//! needed beside what says where it is.

pub mod command;
pub mod state;
pub(crate) mod update;
pub(crate) mod worker;

pub use command::{Command, Event};
