//! What the threads of one driver's connection share.

use std::sync::mpsc::{SyncSender, TrySendError};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use handeye_geometry::progress::CancelToken;

use super::error::{DriverError, Ending};
pub use super::inner::{DriverExit, FrameRequest, Inner, Progress};
use super::message::{FromDriver, ToDriver};
use super::options::DriverOptions;
use super::wire::{Excerpt, Incoming, WireError};

/// Lines that may wait for a driver which reads slowly.
pub const QUEUE: usize = 64;
/// Requests that may be open at a time; the workbench makes a handful.
const MOST_REQUESTS: usize = 64;
/// Interval at which a cancel token is checked.
const POLL: Duration = Duration::from_millis(20);

/// Commands for the thread that writes.
#[derive(Debug)]
pub enum Out {
    /// A message.
    Line(String),
    /// A ping with this number, whose time is taken when it leaves.
    Ping(u64),
    /// The last message.
    Bye,
}

/// A connection to one driver, shared by its threads and its users.
#[derive(Debug)]
pub struct Shared {
    /// Command or address, for messages.
    pub driver: String,
    pub options: DriverOptions,
    inner: Mutex<Inner>,
    changed: Condvar,
    queue: Mutex<Option<SyncSender<Out>>>,
}

impl Shared {
    pub fn new(driver: String, options: DriverOptions, queue: SyncSender<Out>) -> Self {
        Self { driver, options, inner: Mutex::default(), changed: Condvar::new(), queue: Mutex::new(Some(queue)) }
    }

    pub fn now_s(&self) -> f64 {
        self.options.timebase.now_s()
    }

    /// The state, for a moment.
    pub fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the state and wakes who waits for it.
    pub fn update<T>(&self, change: impl FnOnce(&mut Inner) -> T) -> T {
        let changed = change(&mut self.lock());
        self.changed.notify_all();
        changed
    }

    /// Ends the connection, unless it is over already.
    pub fn finish(&self, why: Ending) {
        self.update(|inner| {
            inner.ending.get_or_insert(why);
            inner.is_armed = false;
        });
    }

    /// Waits until `ready` gives something, at most for `patience`; `None` when the time is over or `cancel` was
    /// raised.
    ///
    /// # Errors
    /// [`DriverError::Gone`] once the connection is over.
    pub fn wait<T>(
        &self,
        patience: Duration,
        cancel: Option<&CancelToken>,
        mut ready: impl FnMut(&mut Inner) -> Option<T>,
    ) -> Result<Option<T>, DriverError> {
        let until = Instant::now() + patience;
        let mut inner = self.lock();
        loop {
            if let Some(found) = ready(&mut inner) {
                return Ok(Some(found));
            }
            if let Some(why) = &inner.ending {
                return Err(self.gone(why.clone()));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() || cancel.is_some_and(CancelToken::is_cancelled) {
                return Ok(None);
            }
            let pause = if cancel.is_some() { left.min(POLL) } else { left };
            inner = self.changed.wait_timeout(inner, pause).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Waits until nothing more is read, at most for `patience`; returns whether that is so.
    pub fn wait_for_output(&self, patience: Duration) -> bool {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, |inner| !inner.read_up.output);
        waited.unwrap_or_else(PoisonError::into_inner).0.read_up.output
    }

    /// Waits until the driver has ended, at most for `patience`.
    pub fn wait_for_burial(&self, patience: Duration) {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, |inner| inner.burial.is_none());
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }

    pub fn gone(&self, why: Ending) -> DriverError {
        DriverError::Gone { driver: self.driver.clone(), why }
    }

    /// Puts something into the queue of the thread that writes; false when it is full or closed.
    pub fn enqueue(&self, out: Out) -> Result<(), TrySendError<Out>> {
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        match queue.as_ref() {
            Some(queue) => queue.try_send(out),
            None => Err(TrySendError::Disconnected(out)),
        }
    }

    /// Nothing is sent any longer; the thread that writes closes the driver's input once it has sent what waits.
    pub fn close_queue(&self) {
        *self.queue.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Sends a message.
    ///
    /// # Errors
    /// [`DriverError::Gone`], also when the driver reads nothing.
    pub fn send(&self, message: &ToDriver) -> Result<(), DriverError> {
        self.send_line(message.line())
    }

    /// Sends a line, with its end.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn send_line(&self, line: String) -> Result<(), DriverError> {
        if let Some(why) = &self.lock().ending {
            return Err(self.gone(why.clone()));
        }
        match self.enqueue(Out::Line(line)) {
            Ok(()) => Ok(()),
            Err(error) => {
                let why = if matches!(error, TrySendError::Full(_)) { Ending::NotReading } else { Ending::ClosedHere };
                self.finish(why.clone());
                Err(self.gone(why))
            }
        }
    }

    /// Makes a request and gives its number.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn request(&self, message: impl FnOnce(u64) -> ToDriver) -> Result<u64, DriverError> {
        let id = {
            let mut inner = self.lock();
            // Requests that nobody waits for any longer make room; a driver that never answers uses no more memory than
            // this.
            while inner.requests.len() >= MOST_REQUESTS {
                inner.requests.pop_first();
            }
            inner.last_id += 1;
            let id = inner.last_id;
            inner.requests.insert(id, Progress::Sent);
            id
        };
        self.send(&message(id))?;
        Ok(id)
    }

    /// Takes in a message.
    ///
    /// # Errors
    /// [`WireError`] for a message in the wrong place.
    pub fn take(&self, incoming: Incoming, arrived_s: f64) -> Result<(), WireError> {
        let Incoming { number, line, message, bytes } = incoming;
        if let FromDriver::Preparing(preparing) = &message {
            self.options.preparing.say(&preparing.text);
        }
        let taken = self.update(|inner| inner.take(message, bytes, arrived_s));
        taken.map_err(|problem| WireError { number, excerpt: Excerpt::of(line.as_bytes()), problem })
    }
}
