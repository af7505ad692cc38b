//! The application's end of the recording. Noting never waits: it puts the entry into bounded queues.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use super::pace::Pace;
use super::reports::Reports;
use super::shared::Shared;
use super::{Relay, RerunChoice, ViewerRequest, viewer};
use handeye_workbench::app::App;
use handeye_workbench::command::Event;
use handeye_workbench::model::RerunState;
use handeye_workbench::recording::{Entry, Recording};
use handeye_workbench::worker::Waker;

/// How long the end of the program waits for pending writes.
const DEADLINE: Duration = Duration::from_secs(2);

/// Where the web viewer is shown.
pub enum WebViewer {
    /// In the browser of this machine, which is opened.
    Here,
    /// On a port of its own; the user opens a browser to look.
    AtAddress,
    /// By another server; no viewer is opened on this machine.
    Relayed(Arc<Relay>),
}

pub struct RecorderOptions {
    /// Where to.
    pub choice: RerunChoice,
    /// How much.
    pub pace: Pace,
    /// Whether a file is written next to the session if nothing else is chosen.
    pub beside_session: bool,
    /// Where the web viewer is shown.
    pub web: WebViewer,
    /// Called when there is something to report.
    pub waker: Waker,
}

/// Records everything that happens in an application.
///
/// # Errors
/// When the named file cannot be created, or the system cannot start more threads.
pub fn record(app: &mut App, choice: RerunChoice, web: WebViewer) -> io::Result<()> {
    if choice != RerunChoice::Off {
        let waker = Arc::clone(app.waker());
        let options = RecorderOptions { choice, pace: Pace::Live, beside_session: true, web, waker };
        app.record_into(Recorder::start(options)?);
    }
    Ok(())
}

/// The recording of a program. If off, it costs nothing.
#[derive(Default)]
pub struct Recorder {
    shared: Option<Arc<Shared>>,
}

impl Recorder {
    /// Records nothing.
    pub(crate) fn off() -> Self {
        Self { shared: None }
    }

    /// Begins to record.
    ///
    /// # Errors
    /// When the named file cannot be created, or the system cannot start more threads.
    pub fn start(options: RecorderOptions) -> io::Result<Self> {
        let RecorderOptions { choice, pace, beside_session, web, waker } = options;
        if choice == RerunChoice::Off {
            return Ok(Self::off());
        }
        let beside_session = beside_session && !matches!(choice, RerunChoice::Save(_));
        let shared = Arc::new(Shared::new(Reports::new(waker), pace, web, beside_session));
        let recorder = Self { shared: Some(Arc::clone(&shared)) };
        match choice {
            RerunChoice::Save(path) => shared.save_to(path)?,
            RerunChoice::Spawn => recorder.open(ViewerRequest::Native),
            RerunChoice::Web => recorder.open(ViewerRequest::Web),
            RerunChoice::Connect(url) => recorder.open(ViewerRequest::Connect(url)),
            RerunChoice::Record | RerunChoice::Off => {}
        }
        Ok(recorder)
    }

    /// Whether anything is recorded. If not, entries need not be created.
    pub fn is_on(&self) -> bool {
        self.shared.is_some()
    }

    /// Opens a viewer; the outcome is reported.
    pub(crate) fn open(&self, request: ViewerRequest) {
        if let Some(shared) = &self.shared {
            viewer::open(shared, request);
        }
    }

    /// The state as it is now.
    pub fn state(&self) -> RerunState {
        self.shared.as_ref().map_or_else(RerunState::default, |shared| shared.now())
    }
}

impl Recording for Recorder {
    fn note(&self, entry: Entry) {
        if let Some(shared) = &self.shared {
            shared.note(entry);
        }
    }

    fn open_viewer(&self) {
        self.open(ViewerRequest::Best);
    }

    fn drain(&self, absorb: &mut dyn FnMut(Event)) {
        let Some(shared) = &self.shared else { return };
        shared.drain(absorb);
    }

    fn finish(&mut self, deadline: Duration) -> bool {
        let Some(shared) = self.shared.take() else { return true };
        shared.finish(deadline)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if !self.finish(DEADLINE) {
            tracing::warn!("the end of the recording for Rerun was not written in time");
        }
    }
}

#[cfg(test)]
#[path = "recorder_tests.rs"]
mod tests;
