//! What serves a recording.

use std::io;

use tokio::runtime::{Builder, Handle, Runtime};

/// Threads of all servers and the page together, however many connections there are.
const THREADS: usize = 2;

/// The threads that do the work of the servers; they end when this is dropped, without being waited for.
pub(super) struct Engine(Option<Runtime>);

impl Engine {
    pub fn start() -> io::Result<Self> {
        let mut builder = Builder::new_multi_thread();
        Ok(Self(Some(builder.worker_threads(THREADS).thread_name("rerun-server").enable_all().build()?)))
    }

    pub fn handle(&self) -> io::Result<&Handle> {
        self.0.as_ref().map(Runtime::handle).ok_or_else(|| io::Error::other("the servers have ended"))
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        if let Some(runtime) = self.0.take() {
            runtime.shutdown_background();
        }
    }
}
