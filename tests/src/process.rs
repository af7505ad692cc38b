//! Signals to processes, and their end.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Longest wait for a process to end. Only a failure takes this long.
const PATIENCE: Duration = Duration::from_mins(10);

/// Starts `handeye`; with its standard error.
///
/// # Panics
/// When it does not run.
pub fn start(arguments: &[&str]) -> (Child, BufReader<ChildStderr>) {
    let mut child = Command::new(crate::handeye_binary())
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("handeye runs");
    let stderr = BufReader::new(child.stderr.take().expect("its messages"));
    (child, stderr)
}

/// Reads a process's output until something is reported.
///
/// # Panics
/// When it ends before that.
pub fn until_message(stderr: &mut BufReader<ChildStderr>, what: &str) {
    let mut all = String::new();
    while !all.contains(what) {
        assert!(stderr.read_line(&mut all).is_ok_and(|bytes| bytes > 0), "{all}");
    }
}

/// Sends a signal by its name, for example `TERM`.
///
/// # Panics
/// When there is no such process.
pub fn signal(process: &Child, name: &str) {
    let sent = Command::new("kill").args(["-s", name, &process.id().to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()), "kill -s {name} {}", process.id());
}

/// Stops a process where it is, as a computer that falls asleep does, and waits until it has stopped.
///
/// # Panics
/// When it does not.
pub fn put_to_sleep(process: &Child) {
    signal(process, "STOP");
    let deadline = Instant::now() + PATIENCE;
    let stat = format!("/proc/{}/stat", process.id());
    // The state comes after the name, which is in parentheses.
    let stands = || {
        let stat = std::fs::read_to_string(&stat).unwrap_or_default();
        stat.rsplit_once(')').is_some_and(|(_, rest)| rest.trim_start().starts_with('T'))
    };
    while !stands() {
        assert!(Instant::now() < deadline, "the process does not stop");
        std::thread::yield_now();
    }
}

/// Waits for the end of a process.
///
/// # Panics
/// When it does not end; it is killed then.
pub fn end_of(process: &mut Child) -> ExitStatus {
    let (ended, watch) = channel::<()>();
    let id = process.id().to_string();
    let watchdog = std::thread::spawn(move || {
        let late = watch.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout);
        late && Command::new("kill").args(["-s", "KILL", &id]).status().is_ok()
    });
    let status = process.wait().expect("a child can be waited for");
    drop(ended);
    assert!(!watchdog.join().expect("no panic"), "the process did not end by itself");
    status
}
