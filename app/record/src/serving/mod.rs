//! The server from which viewers read, and the page with the web viewer: one port, of this machine.
//!
//! A server of Rerun keeps what it has sent for viewers that come later, up to a limit, and forgets the oldest first. Images
//! would push the captures out, so lasting and live entries are kept by two of them, and read as one.
//!
//! Rerun's own server listens on its own port, and answers every client under every host name
//! (`docs/reference/rerun_viewers.md` has the measurements). So its service is extracted here and put behind a [`Door`], in
//! this process: there is no port behind the door that another client could find.

mod page;
mod proxy;
mod relay;

use std::io;
use std::sync::Arc;

use tokio::runtime::{Builder, Runtime};

use super::stream::{SharedSink, Target};
use handeye_http::door::{Door, Limits};
use handeye_workbench::recording::BROWSER_PATH;
use page::encoded;
use proxy::ProxySink;

pub use relay::Relay;

/// Threads of the server, however many connections there are.
const THREADS: usize = 2;

/// Size of the lasting entries that are kept for viewers that come later \[bytes\].
pub const LASTING_BYTES: u64 = 128 * 1024 * 1024;

/// Size of the live entries that are kept for viewers that come later \[bytes\].
pub const LIVE_BYTES: u64 = 32 * 1024 * 1024;

/// The server; it ends when this is dropped, without waiting for it.
pub struct Server {
    lasting: SharedSink,
    live: SharedSink,
    door: Door,
    runtime: Option<Runtime>,
}

impl Server {
    /// Starts it on a free port of 127.0.0.1, and lets `relay` serve the recording as well.
    ///
    /// # Errors
    /// When there is no port or no thread.
    pub fn start(relay: &Arc<Relay>) -> io::Result<Self> {
        let runtime =
            Builder::new_multi_thread().worker_threads(THREADS).thread_name("rerun-server").enable_all().build()?;
        let (lasting, read_lasting) = proxy::start(&runtime, LASTING_BYTES);
        let (live, read_live) = proxy::start(&runtime, LIVE_BYTES);
        relay.serve([read_lasting, read_live])?;
        let door = Door::open(runtime.handle(), Limits::USUAL, relay.routes())?;
        let [lasting, live] = [lasting, live].map(|sink: ProxySink| SharedSink(Arc::new(sink)));
        Ok(Self { lasting, live, door, runtime: Some(runtime) })
    }

    /// The target of streams for it.
    pub fn target(&self) -> Target {
        Target::Viewers { lasting: self.lasting.clone(), live: self.live.clone() }
    }

    /// The address for viewers.
    pub fn url(&self) -> String {
        format!("rerun+http://{}/proxy", self.door.address())
    }

    /// The page with the web viewer.
    pub fn page(&self) -> String {
        format!("http://{}{BROWSER_PATH}?hide_welcome_screen=1&url={}", self.door.address(), encoded(&self.url()))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

#[cfg(test)]
mod tests;
