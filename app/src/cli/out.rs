//! The one way to standard output and standard error. `println!` panics where nobody reads or the disk is full; nothing
//! here does, and clippy keeps it the one way.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use anyhow::anyhow;

use super::Failure;

/// Writes a result to standard output.
///
/// # Errors
/// As [`finished`].
pub fn print(text: &str) -> Result<(), Failure> {
    bytes(text.as_bytes())
}

/// Writes one line of a result to standard output.
///
/// # Errors
/// As [`finished`].
pub fn line(line: impl Display) -> Result<(), Failure> {
    print(&format!("{line}\n"))
}

/// Writes bytes to standard output.
///
/// # Errors
/// As [`finished`].
pub fn bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    // Flushed here: at the end of the program nobody would hear that it failed.
    finished(stdout.write_all(bytes).and_then(|()| stdout.flush()), "standard output")
}

/// How writing to something that is no file has ended. A pipe whose reader has gone is no failure: it has seen what it
/// wanted.
///
/// # Errors
/// Whatever else the system reports.
pub fn finished(written: io::Result<()>, place: impl Display) -> Result<(), Failure> {
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::failed(anyhow!("{place} cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

/// Writes one line for a person to standard error. That this fails cannot be said anywhere.
pub fn note(line: impl Display) {
    let _said = Log.write_all(format!("{line}\n").as_bytes()).is_ok();
}

/// Standard error for lines that must not stop the work: it takes all of them.
#[derive(Debug, Clone, Copy)]
pub struct Log;

impl Write for Log {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let _said = io::stderr().lock().write_all(line).is_ok();
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
