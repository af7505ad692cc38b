//! Timeouts.

use std::time::Duration;

use handeye_geometry::progress::CancelToken;

/// Options of a connection, unless a call overrides them.
#[derive(Debug, Clone)]
pub struct ConnectionOptions {
    /// Longest silence of the server within a call.
    pub reply_timeout: Duration,
    /// Longest duration of a whole call, however lively the server is.
    pub total_timeout: Duration,
    /// A host that has been silent for this long counts as gone, even if its connection was never closed; `None` relies
    /// on the connection alone.
    pub heartbeat: Option<Duration>,
    /// After this many seconds without a message the server may forget this client, with its stepping mode and locks:
    /// it bounds how long a client that crashed can hold the simulation. Longer than any call that holds it, so that
    /// nothing has to be sent to keep a lock alive, and longer than a pass of a slow scene.
    pub idle_timeout_s: u32,
    /// Seed of the client ids; `None` draws them from the system. Two clients of one server must not share a seed.
    pub seed: Option<u64>,
    /// Ends every wait of this connection, for the end of the program.
    pub shutdown: CancelToken,
    /// The server is a thread of this process: the user cannot start it again, and it is late only on a computer under
    /// load.
    pub is_own_cell: bool,
}

impl ConnectionOptions {
    /// For a cell in this process. Silence does not mean that it has gone: that is known at once, by the end of the
    /// connection. So there are no heartbeats, and a computer under load has more time.
    pub fn own_cell() -> Self {
        Self { reply_timeout: Duration::from_secs(30), heartbeat: None, is_own_cell: true, ..Self::default() }
    }
}

impl Default for ConnectionOptions {
    fn default() -> Self {
        Self {
            reply_timeout: Duration::from_secs(5),
            total_timeout: Duration::from_mins(1),
            heartbeat: Some(Duration::from_millis(1500)),
            idle_timeout_s: 8,
            seed: None,
            shutdown: CancelToken::default(),
            is_own_cell: false,
        }
    }
}

/// Limits of one call.
#[derive(Debug, Clone, Default)]
pub struct CallOptions {
    /// Longest silence of the server; `None` takes the connection's.
    pub reply_timeout: Option<Duration>,
    /// Longest duration of the call; `None` takes the connection's.
    pub total_timeout: Option<Duration>,
    /// Ends the wait within 50 ms when raised.
    pub cancel: Option<CancelToken>,
    /// How long a cancelled call may still take to end by itself: giving it up costs this client its record on the
    /// server.
    pub grace: Duration,
    /// The call waits for one pass of the simulation, and is given up where another client keeps that from beginning:
    /// [`LinkError::Held`](super::LinkError::Held).
    pub awaits_pass: bool,
}

impl CallOptions {
    /// For a call that may take `total` without a message: a server that defers its reply sends nothing until it is
    /// done. The connection itself checks that the server is alive.
    pub fn long(total: Duration, cancel: &CancelToken) -> Self {
        let total = Some(total);
        Self { reply_timeout: total, total_timeout: total, cancel: Some(cancel.clone()), ..Self::default() }
    }

    /// The usual limits, and a cancel token.
    pub fn cancelled_by(cancel: &CancelToken) -> Self {
        Self { cancel: Some(cancel.clone()), ..Self::default() }
    }
}
