//! One cell of drivers for several threads, started when it is needed and again when it is gone.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use handeye_geometry::progress::CancelToken;

use super::cell::{DriverCell, DriverCellSpec};
use super::error::DriverError;
use super::options::{DriverOptions, Preparing};
use super::pending::{PendingStart, Waited};
use super::starts::{Failure, Permit, Starts};

/// Interval at which a start that is being prepared is checked.
const LOOK_AGAIN: Duration = Duration::from_millis(500);

/// Keeps a cell running. Threads ask it for the cell whenever theirs is gone; what it gives is the same cell for all.
///
/// A cell that is gone is started again on request, with pauses that grow as long as starts fail, and in the end no more until
/// [`Self::again`]. A request during a pause returns the rest of the pause, and nothing is started.
#[derive(Debug)]
pub struct DriverHost {
    spec: DriverCellSpec,
    options: DriverOptions,
    kept: Mutex<Kept>,
    /// Nothing is to be started.
    rests: AtomicBool,
    /// A person has asked since the last start.
    is_asked: AtomicBool,
    /// Gives up the start under way.
    halt: Mutex<CancelToken>,
}

#[derive(Debug, Default)]
struct Kept {
    cell: Option<DriverCell>,
    /// A start that is under way.
    pending: Option<PendingStart>,
    starts: Starts,
    /// Why there is no cell.
    error: Option<DriverError>,
}

/// Why there is no cell.
#[derive(Debug, Clone, PartialEq)]
pub enum NoCell {
    /// Starts failed and the next is after a pause, or the one under way takes long.
    Later {
        /// Why the last one did, or [`DriverError::Preparing`].
        error: DriverError,
        /// Number of failed starts in a row.
        tries: u32,
        /// Rest of the pause.
        pause: Duration,
    },
    /// Starts failed, and there are no more automatic ones.
    Over {
        /// Why the last one did.
        error: DriverError,
        /// Number of failed starts in a row.
        tries: u32,
    },
    /// Somebody wants that nothing is started.
    Rests {
        /// Why the last start failed, or how the last cell ended.
        error: Option<DriverError>,
    },
}

impl DriverHost {
    /// Nothing is started yet.
    pub fn new(spec: DriverCellSpec, options: DriverOptions) -> Self {
        Self {
            spec,
            options,
            kept: Mutex::default(),
            rests: AtomicBool::new(false),
            is_asked: AtomicBool::new(false),
            halt: Mutex::default(),
        }
    }

    /// The drivers that it starts.
    pub fn spec(&self) -> &DriverCellSpec {
        &self.spec
    }

    /// The cell; one that is gone is ended and started again, read-only as every new one. Whoever asks meanwhile waits for
    /// the same start.
    ///
    /// # Errors
    /// [`NoCell`].
    pub fn cell(&self, cancel: &CancelToken) -> Result<DriverCell, NoCell> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cell) = kept.cell.take() {
            match cell.check() {
                Ok(()) => return Ok(kept.cell.insert(cell).clone()),
                Err(error) => kept.error = Some(error),
            }
            // Both halves of it, even if others still hold them: a device takes one program at a time.
            cell.close();
            kept.starts.ended(self.now_s());
        }
        if self.is_asked.swap(false, Ordering::AcqRel) {
            kept.starts.again();
        }
        // Before the question whether it rests: a rest that is wanted after that cancels this one.
        let halt = self.halt().clone();
        if self.rests.load(Ordering::Acquire) {
            kept.pending = None;
            return Err(NoCell::Rests { error: kept.error.clone() });
        }
        let pending = match kept.pending.take() {
            Some(pending) => pending,
            None => self.begin(&mut kept, halt, cancel)?,
        };
        let halt = pending.halt.clone();
        match pending.wait() {
            Waited::Preparing(pending, error) => {
                kept.pending = Some(pending);
                // The one under way is a try, too.
                Err(NoCell::Later { error, tries: kept.starts.tries() + 1, pause: LOOK_AGAIN })
            }
            Waited::Ended(Ok(cell)) => {
                kept.starts.began(self.now_s());
                Ok(kept.cell.insert(cell).clone())
            }
            Waited::Ended(Err(error)) if halt.is_cancelled() => {
                Err(NoCell::Rests { error: kept.error.clone().or(Some(error)) })
            }
            Waited::Ended(Err(error)) => Err(self.failed(&mut kept, error)),
        }
    }

    /// Begins a start, if there may be one now.
    fn begin(&self, kept: &mut Kept, halt: CancelToken, cancel: &CancelToken) -> Result<PendingStart, NoCell> {
        let (permit, error) = (kept.starts.permit(self.now_s()), kept.error.clone());
        if let (Permit::In(_) | Permit::No, Some(error)) = (permit, error) {
            return Err(refusal(permit, error, kept.starts.tries()));
        }
        let options = DriverOptions { halt, preparing: Preparing::default(), ..self.options.clone() };
        PendingStart::begin(&self.spec, options, cancel).map_err(|error| self.failed(kept, error))
    }

    /// Counts a failed start.
    fn failed(&self, kept: &mut Kept, error: DriverError) -> NoCell {
        kept.error = Some(error.clone());
        let now_s = self.now_s();
        kept.starts.failed(now_s, kind(&error));
        refusal(kept.starts.permit(now_s), error, kept.starts.tries())
    }

    /// Starts nothing until [`Self::again`], and gives up the start under way. A cell that works goes on. Waits for nothing.
    pub fn rest(&self) {
        self.rests.store(true, Ordering::Release);
        self.halt().cancel();
    }

    /// The next request starts at once, however often starts failed before. Waits for nothing.
    pub fn again(&self) {
        *self.halt() = CancelToken::default();
        self.is_asked.store(true, Ordering::Release);
        self.rests.store(false, Ordering::Release);
    }

    /// Ends the cell, even if others still hold it.
    pub fn close(&self) {
        if let Some(cell) = self.kept.lock().unwrap_or_else(PoisonError::into_inner).cell.take() {
            cell.close();
        }
    }

    fn halt(&self) -> MutexGuard<'_, CancelToken> {
        self.halt.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now_s(&self) -> f64 {
        self.options.timebase.now_s()
    }
}

impl Drop for DriverHost {
    fn drop(&mut self) {
        // A start under way would go on with nobody waiting for it.
        self.halt().cancel();
    }
}

fn refusal(permit: Permit, error: DriverError, tries: u32) -> NoCell {
    match permit {
        Permit::Now => NoCell::Later { error, tries, pause: Duration::ZERO },
        Permit::In(pause) => NoCell::Later { error, tries, pause },
        Permit::No => NoCell::Over { error, tries },
    }
}

fn kind(error: &DriverError) -> Failure {
    match error {
        DriverError::Connect { .. } => Failure::Nobody,
        DriverError::Gone { .. } | DriverError::NoAnswer { .. } => Failure::Ended,
        _ => Failure::Hopeless,
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "host_tests.rs"]
mod tests;
