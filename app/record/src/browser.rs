//! The browser of the system.

use std::time::Duration;

/// The system reports within this time if there is no browser. A program that keeps running is the browser itself.
const PATIENCE: Duration = Duration::from_secs(5);

/// Makes the system show a page; whether there is a browser that does, as far as the system knows.
pub fn open(url: &str) -> bool {
    if std::env::var_os("DISPLAY").is_none() && std::env::var_os("WAYLAND_DISPLAY").is_none() {
        // Some systems would start a browser in the terminal.
        return false;
    }
    match open::that_detached_with_timeout(url, PATIENCE) {
        Ok(()) => true,
        Err(error) => {
            tracing::info!(%error, "no browser was opened");
            false
        }
    }
}
