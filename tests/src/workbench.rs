//! The workbench without its window: what a user clicks is a command, what a user sees is the model.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::CellPaths;
use handeye_record::{RerunChoice, WebViewer, record};
use handeye_workbench::app::{App, Connect, Start};
use handeye_workbench::command::Command;
use handeye_workbench::model::{CellSource, Model, ViewSettings};
use handeye_workbench::taught;
use handeye_workbench::text::Language;
use handeye_workbench::worker::{Clock, Waker};

/// Longer than anything that a test waits for takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(6);

/// An application at work.
pub struct Workbench {
    app: App,
    woken: std::sync::mpsc::Receiver<()>,
}

impl Workbench {
    /// Starts it; new sessions go under `sessions`. It records as the window does.
    ///
    /// # Panics
    /// When the system cannot start more threads.
    pub fn start(source: CellSource, sessions: &Path, open: Option<PathBuf>) -> Self {
        Self::start_recording(source, sessions, open, RerunChoice::Record)
    }

    /// Starts it with a recording for Rerun that goes elsewhere.
    ///
    /// # Panics
    /// When the system cannot start more threads, or the recording cannot be created.
    pub fn start_recording(source: CellSource, sessions: &Path, open: Option<PathBuf>, rerun: RerunChoice) -> Self {
        let (wake, woken) = std::sync::mpsc::sync_channel(1);
        let waker: Waker = Arc::new(move || {
            // A channel that is full wakes as well.
            let _full = wake.try_send(()).is_err();
        });
        let began = Instant::now();
        let clock: Clock = Arc::new(move || began.elapsed().as_secs_f64());
        let connect: Connect = Arc::new(CellSource::cell);
        let start = Start {
            source,
            view: ViewSettings::default(),
            addresses: Vec::new(),
            drivers: Vec::new(),
            objects: CellPaths::default(),
            keep_out: None,
            sessions: sessions.to_path_buf(),
            open,
            in_browser: None,
        };
        let started = App::start(start, connect, clock, waker);
        match started.and_then(|mut app| record(&mut app, rerun, WebViewer::Here).map(|()| app)) {
            Ok(app) => Self { app, woken },
            Err(error) => panic!("no threads: {error}"),
        }
    }

    /// What the window would show.
    pub fn model(&self) -> &Model {
        self.app.model()
    }

    pub fn click(&mut self, command: impl Into<Command>) {
        self.app.apply(command);
    }

    /// Carries out a user's command, and allows the arm to make the first move, which has to be confirmed wherever the arm
    /// may be real.
    ///
    /// # Panics
    /// When no move waits.
    pub fn allow(&mut self, command: impl Into<Command>) {
        self.click(command);
        self.until("the first move that waits", |model| model.asked.is_some());
        self.click(taught::Command::ConfirmMove);
    }

    /// Waits until the condition holds for the model.
    ///
    /// # Panics
    /// When that does not happen, with the window's messages so far.
    pub fn until(&mut self, what: &str, is_so: impl Fn(&Model) -> bool) {
        let deadline = Instant::now() + PATIENCE;
        loop {
            self.app.collect();
            if is_so(self.app.model()) {
                return;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            assert!(!left.is_zero(), "waiting for {what}; the window says:\n{}", self.text());
            // Also without a wake-up: time itself is part of the model.
            let _woken = self.woken.recv_timeout(left.min(Duration::from_millis(100))).is_ok();
        }
    }

    /// All messages so far.
    pub fn text(&self) -> String {
        let messages = self.app.model().messages.iter();
        messages.map(|message| message.text.in_language(Language::English)).collect::<Vec<_>>().join("\n")
    }
}
