//! The browser of the system.

use std::ffi::OsStr;
use std::io;
use std::process::{Command, Stdio};
use std::thread::Builder;
use std::time::Duration;

use super::native;

/// The program that knows which browser there is.
const PROGRAM: &str = "xdg-open";

/// It says within this that there is none. One that goes on has become the browser itself.
const PATIENCE: Duration = Duration::from_secs(5);

/// Has the system show a page; whether there is a browser that does, as far as the system knows.
pub fn open(url: &str) -> bool {
    if std::env::var_os("DISPLAY").is_none() && std::env::var_os("WAYLAND_DISPLAY").is_none() {
        // Some systems would start a browser in the terminal.
        return false;
    }
    match open_with(OsStr::new(PROGRAM), url, PATIENCE) {
        Ok(shown) => shown,
        Err(error) => {
            tracing::info!(%error, "no browser was opened");
            false
        }
    }
}

fn open_with(program: &OsStr, url: &str, patience: Duration) -> io::Result<bool> {
    let mut command = Command::new(program);
    let mut asked = command.arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    if let Some(status) = native::wait(&mut asked, patience, || false)? {
        return Ok(status.success());
    }
    let waited = Builder::new().name("browser".to_owned()).spawn(move || asked.wait());
    tracing::debug!(?waited, "the browser goes on");
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_finds_no_browser_is_believed() {
        let long = Duration::from_mins(1);
        assert!(open_with(OsStr::new("true"), "http://127.0.0.1/", long).expect("it runs"));
        assert!(!open_with(OsStr::new("false"), "http://127.0.0.1/", long).expect("it runs"));
        assert!(open_with(OsStr::new("no program has this name"), "http://127.0.0.1/", long).is_err());
    }

    #[test]
    fn a_browser_that_stays_is_not_waited_for() {
        // What is opened here is the standard input of `sleep`: a second, a thousand times the patience.
        assert!(open_with(OsStr::new("sleep"), "1", Duration::from_millis(1)).expect("it runs"));
    }
}
