//! A complete copy of a session under another name.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::JOURNAL;
use super::capture::DEPTH;
use super::derived::Derived;
use super::error::{SessionError, SessionProblem};
use super::lock::{FolderLock, LOCK};
use super::session_file::IMAGES;
use super::store::make_folder;
use super::{RESULT, Session, Store};
use handeye_files::atomic_file;

impl Store {
    /// Copies the session with everything that can be undone and redone, and the result next to it, to a folder that is
    /// empty or does not exist. The copy is written under a hidden name next to its goal and gets its name when it is
    /// complete. This session stays open as it is. Files that are not of the session are not copied.
    ///
    /// # Errors
    /// [`SessionProblem::Exists`] and [`SessionProblem::NotEmpty`] as [`Self::create`], [`SessionProblem::Locked`]
    /// when another program is copying to the same name, and whatever the file system reports; there is then nothing
    /// new under the name.
    pub fn save_as(&self, new_folder: &Path) -> Result<Self, SessionError> {
        check_is_empty(new_folder)?;
        let partial = partial_path(new_folder)?;
        if partial.is_symlink() {
            // Clearing what is behind it would destroy what is not ours.
            return Err(SessionError::new(&partial, SessionProblem::NotEmpty));
        }
        if !partial.join(LOCK).exists() {
            // Whatever has our name for unfinished copies and not our lock is not ours to clear.
            check_is_empty(&partial)?;
        }
        make_folder(&partial)?;
        let lock = FolderLock::take(&partial)?;
        let copied = clear(&partial).and_then(|()| self.copy_to(&partial)).and_then(|()| publish(&partial, new_folder));
        if let Err(error) = copied {
            // Best effort: the error that matters is the first.
            drop(fs::remove_dir_all(&partial));
            return Err(error);
        }
        // The lock was moved with the folder, so no other program has opened the copy.
        Self::open_locked(new_folder, lock)
    }

    fn copy_to(&self, goal: &Path) -> Result<(), SessionError> {
        for name in [IMAGES, DEPTH] {
            make_folder(&goal.join(name))?;
        }
        for (id, capture) in self.history.reachable_captures() {
            for name in capture.files() {
                let (from, to) = (self.folder.join(name), goal.join(name));
                // Undo itself reports when the files of a deleted capture are missing.
                if self.document().capture(id).is_none() && !from.is_file() {
                    continue;
                }
                if let Some(parent) = to.parent() {
                    make_folder(parent)?;
                }
                copy_file(&from, &to)?;
            }
        }
        let result = self.folder.join(RESULT);
        if result.is_file() {
            copy_file(&result, &goal.join(RESULT))?;
        }
        let journal = goal.join(JOURNAL);
        atomic_file::write(&journal, &self.journal.bytes()?).map_err(|e| SessionError::unwritable(&journal, &e))?;
        Derived::default().update(goal, &self.history, self.journal.sequence())?;
        for folder in [goal.join(IMAGES), goal.join(DEPTH), goal.to_path_buf()] {
            atomic_file::sync_folder(&folder).map_err(|e| SessionError::unwritable(&folder, &e))?;
        }
        Ok(())
    }
}

/// Gives the finished copy its name. The file system refuses it when something is there by now.
fn publish(partial: &Path, goal: &Path) -> Result<(), SessionError> {
    fs::rename(partial, goal).map_err(|e| match e.kind() {
        io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists => {
            SessionError::new(goal, SessionProblem::NotEmpty)
        }
        _ => SessionError::unwritable(goal, &e),
    })?;
    atomic_file::sync_folder(parent(goal)).map_err(|e| SessionError::unwritable(goal, &e))
}

/// An error when there is anything at all under a name but an empty folder.
fn check_is_empty(folder: &Path) -> Result<(), SessionError> {
    if Session::is_session(folder) {
        return Err(SessionError::new(folder, SessionProblem::Exists));
    }
    match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => Err(SessionError::new(folder, SessionProblem::NotEmpty)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(e) => Err(SessionError::unwritable(folder, &e)),
    }
}

/// Removes the rest of an interrupted copy; the lock shows that no program is working on it.
fn clear(partial: &Path) -> Result<(), SessionError> {
    let unwritable = |e| SessionError::unwritable(partial, &e);
    for entry in fs::read_dir(partial).map_err(unwritable)? {
        let entry = entry.map_err(unwritable)?;
        if entry.file_name() == LOCK {
            continue;
        }
        let is_folder = entry.file_type().map_err(unwritable)?.is_dir();
        let path = entry.path();
        if is_folder { fs::remove_dir_all(&path) } else { fs::remove_file(&path) }.map_err(unwritable)?;
    }
    Ok(())
}

fn copy_file(from: &Path, to: &Path) -> Result<(), SessionError> {
    let mut source = File::open(from).map_err(|e| SessionError::unreadable(from, &e))?;
    let mut copy = File::create_new(to).map_err(|e| SessionError::unwritable(to, &e))?;
    let copied = io::copy(&mut source, &mut copy).and_then(|_length| copy.sync_all());
    copied.map_err(|e| SessionError::unwritable(to, &e))
}

fn parent(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn partial_path(goal: &Path) -> Result<PathBuf, SessionError> {
    let no_name = || SessionError::new(goal, SessionProblem::Unwritable("it is not the name of a folder".into()));
    let name = goal.file_name().ok_or_else(no_name)?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(".partial");
    Ok(parent(goal).join(hidden))
}
