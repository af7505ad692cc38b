//! The servers from which viewers read.
//!
//! Why two: a server keeps what it has sent for viewers that come later, up to a limit, and forgets the oldest first.
//! Pictures would push the captures out within a minute. So what lasts and what is live are served side by side, and a
//! viewer reads both as one recording.

use std::io;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use rerun::grpc_server::GrpcServerSink;
use rerun::{MemoryLimit, PlaybackBehavior, ServerOptions};

use super::stream::{SharedSink, Target};

/// What is kept of what lasts, for viewers that come later [bytes].
pub const LASTING_BYTES: u64 = 128 * 1024 * 1024;

/// What is kept of what is live, for viewers that come later [bytes].
pub const LIVE_BYTES: u64 = 32 * 1024 * 1024;

/// A server of ours begins to listen within this, or never.
const PATIENCE: Duration = Duration::from_secs(5);

/// The servers.
pub struct Servers {
    lasting: Arc<GrpcServerSink>,
    live: Arc<GrpcServerSink>,
}

impl Servers {
    /// Starts them on free ports of 127.0.0.1.
    ///
    /// # Errors
    /// When there is no port.
    pub fn start() -> io::Result<Self> {
        Ok(Self { lasting: serve(LASTING_BYTES)?, live: serve(LIVE_BYTES)? })
    }

    /// Where a stream for them writes to.
    pub fn target(&self) -> Target {
        let (lasting, live) = (Arc::clone(&self.lasting), Arc::clone(&self.live));
        Target::Viewers { lasting: SharedSink(lasting), live: SharedSink(live) }
    }

    /// What viewers read.
    pub fn urls(&self) -> [String; 2] {
        [self.lasting.uri().to_string(), self.live.uri().to_string()]
    }
}

fn serve(limit_bytes: u64) -> io::Result<Arc<GrpcServerSink>> {
    // The server does not tell which port it got, so that it is given one that is free.
    let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let port = free.local_addr()?.port();
    drop(free);
    let options = ServerOptions {
        playback_behavior: PlaybackBehavior::OldestFirst,
        memory_limit: MemoryLimit::from_bytes(limit_bytes),
        ..ServerOptions::default()
    };
    let sink = GrpcServerSink::new("127.0.0.1", port, options).map_err(io::Error::other)?;
    let end = Instant::now() + PATIENCE;
    while let Err(error) = TcpStream::connect((Ipv4Addr::LOCALHOST, port)) {
        if Instant::now() > end {
            return Err(error);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(Arc::new(sink))
}
