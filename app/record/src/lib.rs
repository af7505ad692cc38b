//! The recording of the workbench for [Rerun](https://rerun.io): everything that happens, in 3D and on a time line.
//!
//! The application notes [`Entry`](handeye_workbench::recording::Entry)s with a [`Recorder`]; noting never waits. Two threads
//! write what was noted, each with a queue and a stream of its own, so that a viewer that hangs does not keep anything from
//! the disk:
//!
//! | thread | writes to | how much |
//! | --- | --- | --- |
//! | `rerun-file` | a file, as a rule beside the session | what lasts, and a little of what is live |
//! | `rerun-viewer` | a server of ours for viewers, or a viewer elsewhere | everything, as fast as the viewer reads |
//!
//! What lasts (captures, calibrations, messages) is kept for a viewer that is opened later. What is live (images, the
//! robot) is only of interest while it is new: what cannot be written in time is dropped and counted.
//! `docs/reference/rerun_viewers.md` has the bounds.
//!
//! Depends on `handeye_workbench` for what is recorded, implements its
//! [`Recording`](handeye_workbench::recording::Recording), and is the only crate that knows Rerun. Never depends on egui or a
//! window: [`record`] records any [`App`](handeye_workbench::app::App), and a program without one notes its own entries.
//!
//! ```
//! use std::sync::Arc;
//! use std::time::Duration;
//!
//! use handeye_record::{Pace, Recorder, RecorderOptions, RerunChoice, WebViewer};
//! use handeye_workbench::model::Severity;
//! use handeye_workbench::recording::{Entry, Recording as _};
//!
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("recording.rrd");
//! let mut recorder = Recorder::start(RecorderOptions {
//!     choice: RerunChoice::Save(file.clone()),
//!     pace: Pace::Everything,
//!     beside_session: false,
//!     web: WebViewer::AtAddress,
//!     waker: Arc::new(|| {}),
//! })?;
//! recorder.note(Entry::Message { severity: Severity::Info, words: "ten poses".to_owned() });
//! assert!(recorder.finish(Duration::from_secs(20)), "written in time");
//! assert!(std::fs::metadata(&file)?.len() > 0);
//! # Ok::<(), std::io::Error>(())
//! ```

mod arrangement;
mod blueprint;
mod browser;
mod choice;
mod file;
mod lasting;
mod native;
mod pace;
mod pump;
mod queue;
mod recorder;
mod reports;
mod scene;
mod serving;
mod shared;
mod stream;
mod viewer;

pub use choice::{ChoiceError, RerunChoice};
pub use pace::Pace;
pub use recorder::{Recorder, RecorderOptions, WebViewer, record};
pub use serving::Relay;
pub use viewer::ViewerRequest;

/// The name under which viewers keep layouts and recordings of this program.
const APPLICATION_ID: &str = "handeye-workbench";
