//! One program writes a session at a time.

use std::fs::{File, TryLockError};
use std::path::Path;

use super::error::{SessionError, SessionProblem};
use handeye_files::own_folder;

/// The file that is locked. It stays when the session is closed: removing it would let two programs lock two files of
/// the same name.
pub(super) const LOCK: &str = ".lock";

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
        match file.try_lock() {
            Ok(()) => Ok(Self { _file: file }),
            Err(TryLockError::WouldBlock) => Err(SessionError::new(folder, SessionProblem::Locked)),
            Err(TryLockError::Error(e)) => Err(unwritable(e)),
        }
    }
}
