//! What a program holds after many sessions: threads and memory are released with their session.
//!
//! Threads are counted for a whole process, so each count has a process of its own, which is this program again.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use handeye_record::RerunChoice;
use handeye_tests::workbench::Workbench;
use handeye_workbench::model::{CellSource, Step, ViewerState};
use handeye_workbench::{session, shell};

/// Set for the process in which threads are counted.
const COUNTED: &str = "HANDEYE_TEST_COUNTED";

/// Until all one-time allocations are done.
const FIRST: usize = 10;

/// Sessions after those.
const SESSIONS: usize = 100;

/// Threads that may still be started, however many sessions there are: two for the layout of every step, in which the
/// library creates it. A slow recording skips steps, and creates their layouts later.
const MADE_ONCE: usize = 2 * Step::ALL.len();

/// What may remain of a session that is over: names, entries of the log, parts of pages that the allocator keeps \[MB\].
const MOST_MB: f64 = 20.0;

/// What the servers of a viewer keep of every session in addition, for viewers that come later, up to their limit \[MB\].
const KEPT_MB: f64 = 0.4 * SESSIONS as f64;

/// Longer than threads take to end on a busy machine.
const SOON: Duration = Duration::from_mins(2);

fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").expect("the system says").count()
}

fn names() -> Vec<String> {
    let tasks = std::fs::read_dir("/proc/self/task").expect("the system says").flatten();
    let mut names: Vec<_> = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok()).collect();
    names.sort();
    names.iter().map(|name| name.trim().to_owned()).collect()
}

fn megabytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("the system says");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
    line.split_whitespace().next().and_then(|kilobytes| kilobytes.parse::<f64>().ok()).expect("a number") / 1024.0
}

/// Runs a test of this program alone.
fn alone(test: &str) {
    let run = Command::new(std::env::current_exe().expect("this program"))
        .args(["--exact", test, "--nocapture", "--test-threads", "1"])
        .env(COUNTED, "1")
        // No browser is opened.
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .expect("it runs");
    let reported = String::from_utf8_lossy(&run.stdout);
    println!("{reported}");
    assert!(run.status.success(), "{reported}{}", String::from_utf8_lossy(&run.stderr));
    assert!(reported.contains("sessions: "), "{reported}");
}

/// One more session, in which the user goes through all steps.
fn go_through(bench: &mut Workbench, folder: &Path) {
    bench.click(session::Command::New(Some(folder.to_path_buf())));
    bench.until("the new session", |model| model.session.folder.as_deref() == Some(folder));
    for step in Step::ALL {
        bench.click(shell::Command::GoToStep(step));
        bench.until("the step", |model| model.step == step);
    }
}

/// Waits until there are no more threads than this; returns how many there are at last.
fn settled(bench: &mut Workbench, most: usize) -> usize {
    let deadline = Instant::now() + SOON;
    while threads() > most && Instant::now() < deadline {
        // Time is part of the model: this waits for the next update.
        let now_s = bench.model().now_s;
        bench.until("a moment", |model| model.now_s > now_s);
    }
    threads()
}

fn count(rerun: RerunChoice) {
    let home = tempfile::tempdir().expect("a folder");
    let viewer = matches!(rerun, RerunChoice::Web);
    let mut bench = Workbench::start_recording(CellSource::default(), &home.path().join("sessions"), None, rerun);
    bench.until("an image", |model| model.frame.is_some() && model.control.is_connected());
    if viewer {
        bench.until("the servers of the viewer", |model| matches!(model.rerun.viewer, ViewerState::Web { .. }));
    }
    for number in 0..FIRST {
        go_through(&mut bench, &home.path().join(format!("first-{number}")));
    }
    let (before, before_mb) = (threads(), megabytes());
    for number in 0..SESSIONS {
        go_through(&mut bench, &home.path().join(number.to_string()));
    }
    let most = before + MADE_ONCE;
    let (after, grown_mb) = (settled(&mut bench, most), megabytes() - before_mb);
    println!("{SESSIONS} sessions: {before} threads before, {after} after; {before_mb:.0} MB, {grown_mb:+.0} MB");
    assert!(after <= most, "{} threads have been left behind: {:?}", after - before, names());
    let most_mb = if viewer { MOST_MB + KEPT_MB } else { MOST_MB };
    assert!(grown_mb < most_mb, "{grown_mb:.0} MB have been left behind");
}

#[test]
fn threads_and_memory_end_with_their_sessions() {
    if std::env::var_os(COUNTED).is_none() {
        return alone("slow::many_sessions::threads_and_memory_end_with_their_sessions");
    }
    count(RerunChoice::Record);
}

#[test]
fn threads_and_memory_end_with_their_sessions_while_a_viewer_is_served() {
    if std::env::var_os(COUNTED).is_none() {
        return alone("slow::many_sessions::threads_and_memory_end_with_their_sessions_while_a_viewer_is_served");
    }
    count(RerunChoice::Web);
}
