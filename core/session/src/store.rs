//! A session that is open for writing.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::RgbImage;

use super::JOURNAL;
use super::capture::{Capture, DEPTH};
use super::capture_id::CaptureId;
use super::derived::{self, Derived};
use super::document::{CaptureRecord, Document, SessionMeta};
use super::edit::Edit;
use super::error::{SessionError, SessionProblem};
use super::history::History;
use super::journal::{Entry, Journal};
use super::load::{self, Loaded};
use super::lock::{FolderLock, LOCK};
use super::session_file::IMAGES;
use super::{DOCUMENT, RESULT, Session};
use handeye_files::atomic_file::is_partial;
use handeye_files::{atomic_file, own_folder};
use handeye_geometry::depth::DepthImage;
use handeye_result::{CalibrationResult, ResultError};

/// A session folder and the right to change it. A change is on the disk when its method returns, and survives a kill or
/// a power cut.
#[derive(Debug)]
pub struct Store {
    pub(super) folder: PathBuf,
    pub(super) journal: Journal,
    pub(super) history: History,
    pub(super) derived: Derived,
    pub(super) _lock: FolderLock,
}

impl Store {
    /// Begins a session in a folder that is empty or not there yet.
    ///
    /// # Errors
    /// [`SessionProblem::Exists`] when the folder holds a session, [`SessionProblem::NotEmpty`] when it holds
    /// something else, [`SessionProblem::Edit`] when `meta` cannot be that of a session. Nothing is touched then.
    pub fn create(folder: &Path, meta: SessionMeta) -> Result<Self, SessionError> {
        Self::create_with(folder, Document::new(meta))
    }

    /// Begins a session with the contents of a document, for example taught poses, which then cannot be undone.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn create_with(folder: &Path, document: Document) -> Result<Self, SessionError> {
        let history = History::new(document);
        history.document().check().map_err(|e| SessionError::new(folder, e.into()))?;
        check_free(folder)?;
        make_folder(folder)?;
        let lock = FolderLock::take(folder)?;
        // Another program may have been faster.
        check_free(folder)?;
        let journal = Journal::create(folder, &history, 1)?;
        Self { folder: folder.to_path_buf(), journal, history, derived: Derived::default(), _lock: lock }.ready()
    }

    /// Goes on with a session, also with one that was interrupted, and brings the files up to date that follow from
    /// its journal.
    ///
    /// # Errors
    /// [`SessionProblem::Locked`] when the session is open elsewhere, and as [`Session::open`].
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        if !Session::is_session(folder) {
            // Says what is wrong, and leaves no lock where no session is.
            load::load(folder)?;
        }
        let lock = FolderLock::take(folder)?;
        Self::open_locked(folder, lock)
    }

    pub(super) fn open_locked(folder: &Path, lock: FolderLock) -> Result<Self, SessionError> {
        let Loaded { history, sequence, journal_length } = load::load(folder)?;
        load::check_files(folder, history.document())?;
        let journal = match journal_length {
            Some(length) => Journal::open(folder, length, sequence)?,
            // Past the number in the document, so that the document does not seem to be ahead of its journal.
            None => Journal::create(folder, &history, sequence + 1)?,
        };
        remove_partial_files(folder);
        let derived = Derived::look_at(folder);
        Self { folder: folder.to_path_buf(), journal, history, derived, _lock: lock }.ready()
    }

    /// Brings the files next to the journal up to date.
    fn ready(mut self) -> Result<Self, SessionError> {
        for name in [IMAGES, DEPTH] {
            make_folder(&self.folder.join(name))?;
        }
        self.derived.update(&self.folder, &self.history, self.journal.sequence())?;
        Ok(self)
    }

    /// The folder of the session.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The session as it is now.
    pub fn document(&self) -> &Arc<Document> {
        self.history.document()
    }

    /// The session with what can be undone and redone.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The number of the last entry in the journal. It grows with every change, undo and redo.
    pub fn sequence(&self) -> u64 {
        self.journal.sequence()
    }

    /// Records a capture.
    ///
    /// # Errors
    /// [`SessionProblem::Edit`] when the capture cannot be part of the session (not finite, another image size, a
    /// pose of the robot among captures without one or the reverse);
    /// otherwise as [`Self::apply`].
    pub fn add_capture(&mut self, capture: &Capture<'_>) -> Result<CaptureId, SessionError> {
        let refused = |e| SessionError::new(&self.folder, SessionProblem::Edit(e));
        let id = self.history.next_capture_id().map_err(refused)?;
        let record = capture.record(id, self.image_size()?).map_err(refused)?;
        self.document().check_robot(&record).map_err(refused)?;
        // The files first: from the moment the journal names them, they are whole.
        capture.write_files(&self.folder, &record)?;
        self.apply(Edit::AddCapture(Box::new(record)))?;
        Ok(id)
    }

    /// Changes the session. For captures with their files use [`Self::add_capture`].
    ///
    /// # Errors
    /// [`SessionProblem::Edit`] when the change does not fit, [`SessionProblem::Unwritable`] when the disk does not
    /// take it; the session is then as before. [`SessionProblem::Behind`] when the change is recorded and a file that
    /// follows from it could not be written.
    pub fn apply(&mut self, edit: Edit) -> Result<(), SessionError> {
        self.commit(Entry::Edit(edit))
    }

    /// Begins the session again with another document, as long as no capture was ever in it; whether it did. What was changed
    /// before can then no longer be undone.
    ///
    /// # Errors
    /// As [`Self::create_with`] for the document, and [`Self::apply`] for the disk; nothing more is written then until the
    /// session is opened again.
    pub fn begin_again(&mut self, document: Document) -> Result<bool, SessionError> {
        let is_empty = self.history.last_capture() == CaptureId(0) && document.captures.is_empty();
        if !is_empty || **self.document() == document {
            return Ok(false);
        }
        let history = History::new(document);
        history.document().check().map_err(|e| SessionError::new(&self.folder, e.into()))?;
        let sequence = self.journal.sequence() + 1;
        self.journal = match Journal::create(&self.folder, &history, sequence) {
            Ok(journal) => journal,
            Err(error) => {
                // The one that is open may no longer be that of the folder.
                self.journal.give_up();
                return Err(error);
            }
        };
        self.history = history;
        self.derived.update(&self.folder, &self.history, self.journal.sequence())?;
        Ok(true)
    }

    /// Takes the last change back.
    ///
    /// # Errors
    /// As [`Self::apply`]; also when a file of a capture that would be restored is missing.
    pub fn undo(&mut self) -> Result<(), SessionError> {
        self.commit(Entry::Undo)
    }

    /// Makes the change again that was undone last.
    ///
    /// # Errors
    /// As [`Self::undo`].
    pub fn redo(&mut self) -> Result<(), SessionError> {
        self.commit(Entry::Redo)
    }

    fn commit(&mut self, entry: Entry) -> Result<(), SessionError> {
        let refused = |e| SessionError::new(&self.folder, SessionProblem::Edit(e));
        let mut next = self.history.clone();
        let prepared = match self.journal.prepare(&entry) {
            Ok(prepared) => prepared,
            Err(error) => {
                // The error of the change is more useful than the error of writing it.
                step(&mut next, entry).map_err(refused)?;
                return Err(error);
            }
        };
        // The entry as it will be read, so that this and a replay of the journal are the same to the last bit.
        step(&mut next, prepared.entry.clone()).map_err(refused)?;
        let before: BTreeSet<CaptureId> = self.document().captures.iter().map(|capture| capture.id).collect();
        let comes_back = |capture: &&CaptureRecord| !before.contains(&capture.id);
        for capture in next.document().captures.iter().filter(comes_back) {
            load::check_files_of(&self.folder, capture)?;
        }
        self.journal.append(&prepared)?;
        self.history = next;
        self.derived.update(&self.folder, &self.history, self.journal.sequence())
    }

    /// Writes the result of a calibration next to the session, completely or not at all.
    ///
    /// # Errors
    /// [`ResultError`]; what was there before is then still there.
    pub fn write_result(&self, result: &CalibrationResult) -> Result<(), ResultError> {
        result.write(&self.folder.join(RESULT))
    }

    /// As [`Session::input_sha256`].
    ///
    /// # Errors
    /// As [`Session::input_sha256`].
    pub fn input_sha256(&self) -> Result<String, SessionError> {
        load::input_sha256(&self.folder, self.document())
    }

    /// The image of a capture.
    ///
    /// # Errors
    /// As [`Session::load_rgb`].
    pub fn load_rgb(&self, capture: &CaptureRecord) -> Result<RgbImage, SessionError> {
        load::rgb(&self.folder, capture)
    }

    /// The depth of a capture in metres; `None` when none was recorded.
    ///
    /// # Errors
    /// As [`Session::load_rgb`].
    pub fn load_depth_m(&self, capture: &CaptureRecord) -> Result<Option<DepthImage>, SessionError> {
        load::depth_m(&self.folder, capture)
    }

    /// Width and height in pixels of the images so far; `None` when there are none.
    fn image_size(&self) -> Result<Option<(u32, u32)>, SessionError> {
        let Some(first) = self.document().captures.first() else { return Ok(None) };
        let path = self.folder.join(&first.image);
        handeye_images::image_size(&path).map(Some).map_err(|e| SessionError::unreadable(&path, &e))
    }
}

fn step(history: &mut History, entry: Entry) -> Result<(), super::EditError> {
    match entry {
        // A session begins once, in its first entry.
        Entry::Begin(_) => Err(super::EditError::NoChange),
        Entry::Edit(edit) => history.apply(edit),
        Entry::Undo => history.undo(),
        Entry::Redo => history.redo(),
    }
}

/// An error when there is something in the folder.
fn check_free(folder: &Path) -> Result<(), SessionError> {
    if Session::is_session(folder) {
        return Err(SessionError::new(folder, SessionProblem::Exists));
    }
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(SessionError::unwritable(folder, &e)),
    };
    for entry in entries {
        let name = entry.map_err(|e| SessionError::unwritable(folder, &e))?.file_name();
        // A session that was killed before its journal was there has left these and nothing else; the third is from
        // programs that wrote no journal.
        let is_ours = |name: &str| name == LOCK || [JOURNAL, DOCUMENT].iter().any(|of| is_partial(name, of));
        if !name.to_str().is_some_and(is_ours) {
            return Err(SessionError::new(folder, SessionProblem::NotEmpty));
        }
    }
    Ok(())
}

/// Removes the rest of writes that a kill or a power cut interrupted. The lock shows that none is under way.
fn remove_partial_files(folder: &Path) {
    let of_capture = |name: &str| {
        let number: String = name.chars().skip(1).take_while(char::is_ascii_digit).collect();
        ["png", "tiff"].iter().any(|ending| is_partial(name, &format!("{number}.{ending}")))
    };
    let of_session = |name: &str| derived::NAMES.iter().chain(&[JOURNAL]).any(|of| is_partial(name, of));
    for sub in ["", IMAGES, DEPTH] {
        let folder = folder.join(sub);
        // Files behind a link do not belong to the session.
        let Ok(entries) = own_folder::check_folder(&folder).and_then(|()| fs::read_dir(&folder)) else { continue };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_left = if sub.is_empty() { of_session(&name) } else { of_capture(&name) };
            if is_left {
                // Best effort: it does no harm.
                drop(fs::remove_file(entry.path()));
            }
        }
    }
}

/// Makes a folder and those above it, so that their names survive a power cut.
pub(super) fn make_folder(folder: &Path) -> Result<(), SessionError> {
    own_folder::check_folder(folder).and_then(|()| make(folder)).map_err(|e| SessionError::unwritable(folder, &e))
}

fn make(folder: &Path) -> io::Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    make(parent)?;
    match fs::create_dir(folder) {
        Err(e) if !(e.kind() == io::ErrorKind::AlreadyExists && folder.is_dir()) => return Err(e),
        _ => {}
    }
    atomic_file::sync_folder(parent)
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
