//! The servers from which viewers read, and the page with the web viewer.
//!
//! Why two servers: a server keeps what it has sent for viewers that come later, up to a limit, and forgets the oldest
//! first. Images would push the captures out within a minute. So what lasts and what is live are served side by side, and
//! a viewer reads both as one recording.
//!
//! Rerun's own server listens by itself and answers whoever asks. What it serves is taken out of it here and put behind a
//! [`Door`], in this process: there is no port behind the door that somebody else could find.

mod engine;
mod page;
mod proxy;
pub mod relay;

use engine::Engine;
use std::io;
use std::sync::Arc;

use super::stream::{SharedSink, Target};
use handeye_http::door::Door;
use proxy::{ProxySink, Reader};
use relay::{Relay, Relayed};

pub use page::Page;

/// What is kept of what lasts, for viewers that come later \[bytes\].
pub const LASTING_BYTES: u64 = 128 * 1024 * 1024;

/// What is kept of what is live, for viewers that come later \[bytes\].
pub const LIVE_BYTES: u64 = 32 * 1024 * 1024;

/// The servers.
pub struct Servers {
    engine: Arc<Engine>,
    lasting: Served,
    live: Served,
}

/// One of them.
struct Served {
    sink: Arc<ProxySink>,
    door: Door,
    reader: Reader,
}

impl Servers {
    /// Starts them on free ports of 127.0.0.1.
    ///
    /// # Errors
    /// When there is no port or no thread.
    pub fn start() -> io::Result<Self> {
        let engine = Arc::new(Engine::start()?);
        let served = |limit_bytes| -> io::Result<Served> {
            let (sink, door, reader) = proxy::serve(&engine, limit_bytes)?;
            Ok(Served { sink: Arc::new(sink), door, reader })
        };
        Ok(Self { lasting: served(LASTING_BYTES)?, live: served(LIVE_BYTES)?, engine })
    }

    /// Where a stream for them writes to.
    pub fn target(&self) -> Target {
        let sink = |served: &Served| SharedSink(Arc::clone(&served.sink) as Arc<dyn rerun::sink::LogSink>);
        Target::Viewers { lasting: sink(&self.lasting), live: sink(&self.live) }
    }

    /// What viewers read.
    pub fn urls(&self) -> [String; 2] {
        [&self.lasting, &self.live].map(|served| format!("rerun+http://{}/proxy", served.door.address()))
    }

    /// Has page and recording served by somebody else.
    ///
    /// # Errors
    /// When there is no page.
    pub fn relay(&self, relay: &Relay) -> io::Result<()> {
        relay.serve(Relayed::new([&self.lasting, &self.live].map(|served| served.reader.clone()))?);
        Ok(())
    }

    /// Serves the page with the web viewer.
    ///
    /// # Errors
    /// When there is no port.
    pub fn page(&self) -> io::Result<Page> {
        Page::start(&self.engine, &self.urls())
    }
}

#[cfg(test)]
mod tests;
