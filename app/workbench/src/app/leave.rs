//! The end of the application, whether its window is closed or the system asks for it by a signal.
//!
//! What moves the arm is braked first, then threads and connections end. What was captured is on the disk already;
//! pending writes are still finished.

use std::time::{Duration, Instant};

use super::App;
use crate::keep_out::update::keep_keep_out;

/// How long all of it may take. The system gives a program that it asks to end a few seconds, a user less.
const ALL: Duration = Duration::from_millis(1500);

/// What is left of that for threads when the arm does not come to rest earlier.
const FOR_THREADS: Duration = Duration::from_millis(500);

/// What is left for the session and for what was recorded for Rerun when a worker hangs.
const FOR_FILES: Duration = Duration::from_millis(300);

impl App {
    /// Begins to leave: the arm is braked if this application moves it, a solve ends. The rest happens when the application
    /// is dropped, which should be soon.
    pub fn begin_to_leave(&mut self) {
        if self.leave_by.is_some() {
            return;
        }
        self.leave_by = Some(Instant::now() + ALL);
        self.cx.model.sequence_runs = false;
        keep_keep_out(&mut self.cx.model, &self.cx.desk, true);
        // Another client's motions are not ours to stop.
        if self.cx.workers.is_moving() {
            self.cx.workers.press_stop();
        }
        self.cx.desk.cancel_all();
    }

    fn leave(&mut self) {
        self.begin_to_leave();
        let by = self.leave_by.unwrap_or_else(Instant::now);
        if !self.cx.workers.come_to_rest(before(by, FOR_THREADS)) {
            tracing::warn!("the arm is left before it has come to rest; it gets no further points to go to");
        }
        self.cx.workers.shut_down(before(by, FOR_FILES).saturating_duration_since(Instant::now()));
        self.cx.desk.end(by);
        let left = by.saturating_duration_since(Instant::now());
        if self.recording.as_mut().is_some_and(|recording| !recording.finish(left)) {
            tracing::warn!("the end of the recording for Rerun was not written in time");
        }
    }
}

fn before(end: Instant, by: Duration) -> Instant {
    end.checked_sub(by).unwrap_or(end)
}

impl Drop for App {
    fn drop(&mut self) {
        self.leave();
    }
}
