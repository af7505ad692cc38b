//! All processes that come from a driver, wherever they have gone.
//!
//! A process leaves its group when it begins a new session (`setsid`, a daemon, Python's `start_new_session`), and the
//! parent of an orphan is no longer the driver. All of them have the environment that they were started with: a driver
//! gets a mark in it, which its children inherit. A process started without the environment is still found below a living
//! parent. Where there is no `/proc`, only the group is known.

use std::collections::HashSet;
use std::fs;
use std::io::Read as _;
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

/// Name of the mark in the environment.
const MARK: &str = "HANDEYE_DRIVER";

/// Largest environment that is looked through \[bytes\]; the system allows less for one of its texts.
const LARGEST: u64 = 4 << 20;

/// A process that is killed is gone after this; new ones of a driver that starts some without end are left alone then.
const PATIENCE: Duration = Duration::from_secs(2);

/// Between two looks.
const LOOK: Duration = Duration::from_millis(5);

/// The processes of a driver.
#[derive(Debug)]
pub struct Family {
    mark: String,
}

impl Family {
    /// For a program that is about to be started.
    pub fn of(command: &mut Command) -> Self {
        static STARTED: AtomicU64 = AtomicU64::new(0);
        let number = STARTED.fetch_add(1, Ordering::Relaxed);
        let mark = format!("{}-{number}", std::process::id());
        command.env(MARK, &mark);
        Self { mark: format!("{MARK}={mark}") }
    }

    /// Who lives of it, and below the process of this number.
    pub fn living(&self, first: Option<i32>) -> Vec<Process> {
        let processes = all();
        let mut family: HashSet<i32> = first.into_iter().collect();
        family.extend(processes.iter().map(|process| process.id).filter(|id| self.is_marked(*id)));
        loop {
            let below = processes.iter().filter(|process| family.contains(&process.parent)).map(|process| process.id);
            let below: Vec<i32> = below.filter(|id| !family.contains(id)).collect();
            if below.is_empty() {
                break;
            }
            family.extend(below);
        }
        let own = std::process::id().cast_signed();
        processes.into_iter().filter(|process| family.contains(&process.id) && process.id != own).collect()
    }

    fn is_marked(&self, id: i32) -> bool {
        let mut environment = Vec::new();
        // A process of another user, or one that has just ended, cannot be read.
        let read = fs::File::open(format!("/proc/{id}/environ"));
        let read = read.and_then(|file| file.take(LARGEST).read_to_end(&mut environment));
        read.is_ok() && environment.split(|byte| *byte == 0).any(|text| text == self.mark.as_bytes())
    }

    /// Kills these processes and all others of the driver, until none is left.
    pub fn kill(&self, mut living: Vec<Process>) {
        let until = Instant::now() + PATIENCE;
        loop {
            living.retain(|process| Process::of(process.id).is_some_and(|now| now.began == process.began));
            living.extend(self.living(None));
            if living.is_empty() {
                return;
            }
            if Instant::now() > until {
                tracing::warn!("some processes of a driver do not end and are left alone");
                return;
            }
            for process in &living {
                // Who has ended in between needs no more.
                let _gone_already = kill(Pid::from_raw(process.id), Signal::SIGKILL).is_err();
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// A process that has not ended.
#[derive(Debug)]
pub struct Process {
    id: i32,
    parent: i32,
    /// When, in ticks: another that gets the same number has begun later.
    began: u64,
}

impl Process {
    fn of(id: i32) -> Option<Self> {
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
        // The name, in parentheses, may have anything in it.
        let (_, rest) = stat.rsplit_once(')')?;
        let fields: Vec<&str> = rest.split_whitespace().collect();
        let (state, parent, began) = (*fields.first()?, fields.get(1)?.parse().ok()?, fields.get(19)?.parse().ok()?);
        (!matches!(state, "Z" | "X")).then_some(Self { id, parent, began })
    }
}

fn all() -> Vec<Process> {
    let Ok(entries) = fs::read_dir("/proc") else { return Vec::new() };
    let ids = entries.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    ids.filter_map(Process::of).collect()
}
