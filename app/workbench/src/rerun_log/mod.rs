//! The recording for Rerun: everything that happens, in 3D and on a time line.
//!
//! The application notes [`Entry`]s with a [`Recorder`]; noting never waits. Two threads write what was noted, each with a
//! queue and a stream of its own, so that a viewer that hangs does not keep anything from the disk:
//!
//! | thread | writes to | how much |
//! | --- | --- | --- |
//! | `rerun-file` | a file, as a rule beside the session | what lasts, and a little of what is live |
//! | `rerun-viewer` | a server of ours for viewers, or a viewer elsewhere | everything, as fast as the viewer reads |
//!
//! What lasts (captures, calibrations, messages) is kept for a viewer that is opened later. What is live (images, the
//! robot) is only of interest while it is new: what cannot be written in time is left out and counted.
//! `docs/reference/rerun_viewers.md` has the bounds.

mod arrangement;
pub mod blueprint;
mod browser;
mod choice;
mod entry;
mod file;
mod lasting;
mod native;
mod pace;
mod pump;
mod queue;
pub(crate) mod recorded;
mod recorder;
mod reports;
pub mod scene;
mod serving;
mod shared;
pub(crate) mod state;
mod stream;
pub(crate) mod update;
mod viewer;

pub use choice::{ChoiceError, RerunChoice};
pub use entry::Entry;
pub use pace::Pace;
pub use recorder::{Recorder, RecorderOptions, WebViewer};
pub use scene::{RecordError, SceneWriter};
pub use serving::relay::{PATH as RELAY_PATH, Relay};
pub use viewer::ViewerWish;

/// Under which viewers keep layouts and recordings of this program.
pub const APPLICATION_ID: &str = "handeye-workbench";
