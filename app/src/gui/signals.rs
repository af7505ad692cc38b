//! Signals that ask the window to end: it closes as if a person had closed it.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// So long after a signal the program ends whatever it does. Who asks a program to end waits for a few seconds and then
/// kills it.
const LIMIT: Duration = Duration::from_millis(1900);

/// Whether the system has asked for the end (SIGINT, SIGTERM, SIGHUP).
#[derive(Default)]
pub struct Signals {
    asked: OnceLock<()>,
    ctx: OnceLock<egui::Context>,
}

impl Signals {
    /// Listens from now on, on a thread of its own.
    pub fn listen() -> Arc<Self> {
        let signals = Arc::new(Self::default());
        let heard = Arc::clone(&signals);
        if let Err(error) = ctrlc::set_handler(move || heard.asked()) {
            tracing::warn!(%error, "a signal will end the program at once");
        }
        signals
    }

    /// The first signal counts; others come to a thread that waits already.
    fn asked(&self) {
        let _first = self.asked.set(()).is_ok();
        if let Some(ctx) = self.ctx.get() {
            ctx.request_repaint();
        }
        std::thread::sleep(LIMIT);
        tracing::error!("the window did not close in time; what was captured is on the disk");
        std::process::exit(1);
    }

    /// The window to wake up.
    pub fn wakes(&self, ctx: &egui::Context) {
        let _first = self.ctx.set(ctx.clone()).is_ok();
    }

    /// Whether there was one.
    pub fn is_asked(&self) -> bool {
        self.asked.get().is_some()
    }
}
