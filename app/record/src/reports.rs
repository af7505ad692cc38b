//! What the threads of the recording tell the window.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use handeye_workbench::model::{RerunState, Severity, ViewerState};
use handeye_workbench::text::Text;
use handeye_workbench::worker::Waker;

/// Messages that wait for the window.
const MAX_NOTICES: usize = 32;

/// What the threads tell the window.
pub struct Reports {
    inner: Mutex<Inner>,
    waker: Waker,
}

#[derive(Default)]
struct Inner {
    state: RerunState,
    notices: Vec<(Severity, Text)>,
    no_browser: bool,
    told: RerunState,
}

impl Reports {
    /// Nothing to tell.
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
    /// How it is looked at already.
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
        let mut inner = self.inner();
        if inner.notices.len() < MAX_NOTICES {
            inner.notices.push((severity, text));
        }
        drop(inner);
        (self.waker)();
    }

    /// The web viewer is served and no browser shows it.
    pub fn no_browser(&self) {
        self.inner().no_browser = true;
        (self.waker)();
    }

    /// Whether that is so, once.
    pub fn take_no_browser(&self) -> bool {
        std::mem::take(&mut self.inner().no_browser)
    }

    /// The state with so many entries left out.
    pub fn state(&self, left_out: u64) -> RerunState {
        RerunState { left_out, ..self.inner().state.clone() }
    }

    /// What is to be told to the user.
    pub fn take_notices(&self) -> Vec<(Severity, Text)> {
        std::mem::take(&mut self.inner().notices)
    }

    /// Whether the window does not know a state yet; from now on it does.
    pub fn is_news(&self, now: &RerunState) -> bool {
        let mut inner = self.inner();
        let is_news = inner.told != *now;
        if is_news {
            inner.told.clone_from(now);
        }
        is_news
    }
}
