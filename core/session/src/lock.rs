//! One program writes a session at a time.

use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::{Duration, Instant};

use super::error::{SessionError, SessionProblem};
use handeye_files::own_folder;

/// The file that is locked. It stays when the session is closed: removing it would let two programs lock two files of
/// the same name.
pub(super) const LOCK: &str = ".lock";

/// Longest wait for a lock. Starting a program takes milliseconds.
const WAIT: Duration = Duration::from_millis(300);
/// Interval between two checks of the lock.
const LOOK: Duration = Duration::from_millis(10);

/// The right to write a folder. The operating system takes it back when the process ends, however it ends.
#[derive(Debug)]
pub struct FolderLock {
    _file: File,
}

impl FolderLock {
    /// Takes the lock of a folder, which must be there.
    ///
    /// # Errors
    /// [`SessionProblem::Locked`] when another program, or another [`super::Store`] of this one, has it.
    pub fn take(folder: &Path) -> Result<Self, SessionError> {
        let path = folder.join(LOCK);
        let unwritable = |e| SessionError::unwritable(&path, &e);
        own_folder::check_file(&path).map_err(unwritable)?;
        let file = File::options().create(true).truncate(false).write(true).open(&path).map_err(unwritable)?;
        let began = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => return Ok(Self { _file: file }),
                // A program that is being started by this one holds all of its files for a moment, a lock that was let go among them.
                Err(TryLockError::WouldBlock) if began.elapsed() < WAIT => std::thread::sleep(LOOK),
                Err(TryLockError::WouldBlock) => return Err(SessionError::new(folder, SessionProblem::Locked)),
                Err(TryLockError::Error(e)) => return Err(unwritable(e)),
            }
        }
    }
}
