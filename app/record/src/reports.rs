//! What the threads of the recording report to the window.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use handeye_workbench::command::Event;
use handeye_workbench::model::{RerunState, Severity, ViewerState};
use handeye_workbench::text::Text;
use handeye_workbench::worker::Waker;
use handeye_workbench::{messages, recording};

/// Events that wait for the window.
const MAX_EVENTS: usize = 32;

/// Reports of the threads to the window.
pub struct Reports {
    inner: Mutex<Inner>,
    waker: Waker,
}

#[derive(Default)]
struct Inner {
    state: RerunState,
    events: Vec<Event>,
    /// The state that the window knows.
    reported: RerunState,
}

impl Reports {
    /// Nothing to report.
    pub fn new(waker: Waker) -> Self {
        let state = RerunState { on: true, ..RerunState::default() };
        Self { inner: Mutex::new(Inner { state, ..Inner::default() }), waker }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The file that is written.
    pub fn set_file(&self, file: Option<PathBuf>) {
        self.inner().state.file = file;
        (self.waker)();
    }

    /// How it is looked at.
    pub fn set_viewer(&self, viewer: ViewerState) {
        self.inner().state.viewer = viewer;
        (self.waker)();
    }

    /// A viewer is being opened, unless there is one.
    ///
    /// # Errors
    /// How it is viewed already.
    pub fn begin_opening(&self) -> Result<(), ViewerState> {
        let mut inner = self.inner();
        match &inner.state.viewer {
            ViewerState::Closed | ViewerState::Failed(_) | ViewerState::Web { .. } => {
                inner.state.viewer = ViewerState::Opening;
                Ok(())
            }
            busy => Err(busy.clone()),
        }
    }

    /// Something for the user.
    pub fn notice(&self, severity: Severity, text: Text) {
        self.report(messages::Event::Notice { severity, text });
    }

    /// Something that has happened.
    pub fn report(&self, event: impl Into<Event>) {
        let event = event.into();
        let mut inner = self.inner();
        if inner.events.len() < MAX_EVENTS {
            inner.events.push(event);
        }
        drop(inner);
        (self.waker)();
    }

    /// The state with this many dropped entries.
    pub fn state(&self, left_out: u64) -> RerunState {
        RerunState { left_out, ..self.inner().state.clone() }
    }

    /// Hands over what the window does not know yet, the state first; this many entries were dropped.
    pub fn drain(&self, left_out: u64, absorb: &mut dyn FnMut(Event)) {
        let now = self.state(left_out);
        let mut inner = self.inner();
        let is_news = inner.reported != now;
        if is_news {
            inner.reported.clone_from(&now);
        }
        let events = std::mem::take(&mut inner.events);
        drop(inner);
        is_news.then_some(Event::Recording(recording::Event::Rerun(now))).into_iter().chain(events).for_each(absorb);
    }
}
