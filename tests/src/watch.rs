//! Waiting for files without polling.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use notify::event::{AccessKind, AccessMode, EventKind};
use notify::{RecommendedWatcher, RecursiveMode, Watcher as _};

/// Receives every change in a folder.
#[derive(Debug)]
pub struct Watch {
    events: Receiver<notify::Result<notify::Event>>,
    _watcher: RecommendedWatcher,
}

impl Watch {
    /// Watches a folder from now on.
    ///
    /// # Panics
    /// When the system cannot report it.
    pub fn folder(folder: &Path) -> Self {
        let (sender, events) = mpsc::channel();
        let mut watcher = notify::recommended_watcher(sender).expect("the system reports changes of files");
        watcher.watch(folder, RecursiveMode::NonRecursive).expect("the folder is there");
        Self { events, _watcher: watcher }
    }

    /// Ignores what has changed so far.
    pub fn forget(&self) {
        while self.events.try_recv().is_ok() {}
    }

    /// Waits for the next change; `false` when nothing changes for this long.
    pub fn changes_within(&self, patience: Duration) -> bool {
        self.events.recv_timeout(patience).is_ok()
    }

    /// Waits until a file has been written and closed; `false` when that takes longer.
    pub fn closes_within(&self, file: &Path, patience: Duration) -> bool {
        let deadline = Instant::now() + patience;
        let name = file.file_name().map(PathBuf::from);
        while let Ok(event) = self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            let Ok(event) = event else { continue };
            let is_closed = event.kind == EventKind::Access(AccessKind::Close(AccessMode::Write));
            if is_closed && event.paths.iter().any(|path| path.file_name().map(PathBuf::from) == name) {
                return true;
            }
        }
        false
    }
}
