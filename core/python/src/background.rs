//! Work on a separate thread while Python goes on: its other threads run, Ctrl-C ends the work, progress is reported.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use handeye_geometry::progress::{CancelToken, Progress, Work};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::Failure;

/// Interval at which signals are checked: short enough for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Messages of the working thread.
enum WorkerMessage<T> {
    Progress(Progress),
    Done(Result<T, Failure>),
}

/// Does the work without holding Python's lock. `told` is called with the stage as text and the part of it that is done.
///
/// # Errors
/// The error of the work; `KeyboardInterrupt`, or the exception of `told`, after which the work was cancelled.
pub fn run<T: Send>(
    py: Python<'_>,
    stated: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(Work<'_>) -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    let cancel = CancelToken::default();
    let wants_progress = stated.is_some();
    thread::scope(|scope| {
        let (sender, mut receiver) = channel();
        let token = cancel.clone();
        let worker = scope.spawn(move || {
            // The receiver is only gone when no one waits for the result any more.
            let say = |reported| drop(sender.send(reported));
            let progress = |now: Progress| {
                if wants_progress {
                    say(WorkerMessage::Progress(now));
                }
            };
            say(WorkerMessage::Done(work(Work { cancel: &token, progress: &progress })));
        });
        let mut interrupted = None;
        loop {
            let reported;
            // It may be on one thread at a time only, so that it is handed over and back.
            (reported, receiver) = py.detach(move || (receiver.recv_timeout(LOOK), receiver));
            let heard = match reported {
                Ok(WorkerMessage::Done(result)) => return interrupted.map_or(result, |error: PyErr| Err(error.into())),
                Ok(WorkerMessage::Progress(now)) => {
                    stated.map_or(Ok(()), |stated| stated.call1((now.stage.label(), now.fraction())).map(drop))
                }
                Err(RecvTimeoutError::Timeout) => py.check_signals(),
                Err(RecvTimeoutError::Disconnected) => {
                    let _panic = worker.join();
                    let message = "the solver crashed on this set: please report it with the data";
                    return Err(PyRuntimeError::new_err(message).into());
                }
            };
            if let (Err(error), None) = (heard, &interrupted) {
                cancel.cancel();
                interrupted = Some(error);
            }
        }
    })
}
