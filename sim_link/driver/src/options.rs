//! How long to wait for what.

use std::time::Duration;

use handeye_geometry::progress::CancelToken;

use super::clock::Timebase;

/// How a connection to a driver behaves.
#[derive(Debug, Clone)]
pub struct DriverOptions {
    /// Longest wait for the driver's `hello`: a camera takes its time to open.
    pub hello: Duration,
    /// How often a ping is sent.
    pub ping_every: Duration,
    /// A driver without a pong for so long is gone.
    pub silence: Duration,
    /// Longest wait for the answer to a short request, and for an arm that brakes.
    pub answer: Duration,
    /// Longest motion.
    pub motion: Duration,
    /// How long a driver may take to end by itself before it is killed.
    pub farewell: Duration,
    /// The clock of the workbench. Drivers that belong together share it.
    pub timebase: Timebase,
    /// Gives up a start that waits for `hello`.
    pub halt: CancelToken,
}

impl Default for DriverOptions {
    fn default() -> Self {
        Self {
            hello: Duration::from_secs(10),
            ping_every: Duration::from_millis(200),
            silence: Duration::from_secs(2),
            answer: Duration::from_secs(2),
            motion: Duration::from_mins(5),
            farewell: Duration::from_secs(1),
            timebase: Timebase::start(),
            halt: CancelToken::default(),
        }
    }
}
