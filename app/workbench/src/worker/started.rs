//! Threads whose end can be waited for, but not for ever.

use std::io;
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TryRecvError, bounded};

/// A thread that was started.
pub struct Started {
    handle: JoinHandle<()>,
    /// Closes when it is done; nothing is ever sent.
    done: Receiver<()>,
}

impl Started {
    /// Starts a thread.
    ///
    /// # Errors
    /// When the system cannot start more threads.
    pub fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> io::Result<Self> {
        let (running, done) = bounded(0);
        let handle = Builder::new().name(name.to_owned()).spawn(move || {
            // Dropped last, also when the work panics.
            let _running: Sender<()> = running;
            work();
        })?;
        Ok(Self { handle, done })
    }

    /// Whether it is at work.
    pub(crate) fn is_running(&self) -> bool {
        matches!(self.done.try_recv(), Err(TryRecvError::Empty))
    }

    /// Waits for its end, no longer than until `end`; whether it has ended. One that has not is abandoned.
    pub fn join_until(self, end: Instant) -> bool {
        let Self { handle, done } = self;
        let name = handle.thread().name().unwrap_or_default().to_owned();
        if matches!(done.recv_deadline(end), Err(RecvTimeoutError::Timeout)) {
            tracing::warn!(name, "a worker does not end and is left alone");
            return false;
        }
        if handle.join().is_err() {
            tracing::error!(name, "a worker ended with a panic");
        }
        true
    }
}
