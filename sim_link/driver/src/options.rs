//! Timeouts.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use handeye_geometry::progress::CancelToken;

use super::clock::Timebase;

/// How a connection to a driver behaves.
#[derive(Debug, Clone)]
pub struct DriverOptions {
    /// Longest wait for the driver's `hello`: a camera takes its time to open.
    pub hello: Duration,
    /// Longest preparation: with each `preparing` the wait for `hello` begins again.
    pub preparation: Duration,
    /// How often a ping is sent.
    pub ping_every: Duration,
    /// A driver without a pong for this long is gone: longer than one that renders its own images is kept waiting on a busy machine.
    pub silence: Duration,
    /// Longest wait for the answer to a short request, and for an arm that brakes.
    pub answer: Duration,
    /// Longest motion.
    pub motion: Duration,
    /// How long a driver may take to end by itself before its process is killed.
    pub farewell: Duration,
    /// The clock of the workbench. Drivers that belong together share it.
    pub timebase: Timebase,
    /// Gives up a start that waits for `hello`.
    pub halt: CancelToken,
    /// Text of a start that is being prepared.
    pub preparing: Preparing,
}

/// The text of the newest `preparing`, for those that wait for the start. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Preparing(Arc<Mutex<Option<String>>>);

impl Preparing {
    /// The newest, for people.
    pub(crate) fn text(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(super) fn say(&self, text: &str) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(text.to_owned());
    }
}

impl Default for DriverOptions {
    fn default() -> Self {
        Self {
            hello: Duration::from_secs(10),
            preparation: Duration::from_mins(10),
            ping_every: Duration::from_millis(200),
            silence: Duration::from_secs(5),
            answer: Duration::from_secs(2),
            motion: Duration::from_mins(5),
            farewell: Duration::from_secs(1),
            timebase: Timebase::start(),
            halt: CancelToken::default(),
            preparing: Preparing::default(),
        }
    }
}
