//! What all threads share: clock, waker, limits.

use std::sync::Arc;
use std::time::Duration;

/// Wakes the window to look for news. Called from any thread.
pub type Waker = Arc<dyn Fn() + Send + Sync>;

/// Seconds since some moment before the workers were started.
pub type Clock = Arc<dyn Fn() -> f64 + Send + Sync>;

/// Requests that may wait for a worker. The user cannot click faster than it answers, unless it hangs.
pub(crate) const MAX_REQUESTS: usize = 32;

/// Events that may wait for the window.
pub(crate) const MAX_EVENTS: usize = 256;

/// How long the end of the program waits for the workers. Calls under way return within a fraction of it.
pub const JOIN_DEADLINE: Duration = Duration::from_secs(2);

/// How long the end of the program waits for one report of a worker before it looks again.
pub(crate) const POLL: Duration = Duration::from_millis(5);

/// A worker cannot take the request now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[error("the connection does not answer; wait until it is back")]
pub struct Busy;
