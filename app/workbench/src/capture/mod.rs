//! Taking a capture: one way for the vision thread of the window, for `handeye auto` and for whatever else takes one.
//!
//! | part | is |
//! | --- | --- |
//! | [`CaptureRequest`] | what is asked for |
//! | [`Sequence`] | the capture under way: takes in images one by one and says what it waits for, until robot and image are at rest, the average is complete and the board in it is measured |
//! | [`take`] | drives a sequence for a thread that has a camera of its own and can wait for it |
//! | [`Measured`] | a capture that is good, to be recorded in a session |
//! | [`refusal`] | why there is none, in words |
//!
//! What is decided along the way (at rest, sharp, too similar) is decided in [`handeye_capture`].

pub mod command;
mod measured;
pub mod refusal;
mod request;
mod sequence;
pub(crate) mod state;
mod take;
pub(crate) mod update;

pub use command::{Command, Event};
pub use measured::{Measured, thumbnail};
pub use request::CaptureRequest;
pub use sequence::Sequence;
pub use take::{CaptureEnd, Images, take};

#[cfg(feature = "testing")]
pub mod drawn;
#[cfg(test)]
mod tests;
