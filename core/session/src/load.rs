//! Reading a session: the journal, or a document from before there were journals.

use std::io::ErrorKind;
use std::path::Path;

use image::RgbImage;

use super::JOURNAL;
use super::document::{CaptureRecord, Document};
use super::error::{SessionError, SessionProblem};
use super::history::History;
use super::journal::{self, Replayed};
use super::session_file::{self, SessionFile};
use super::{DOCUMENT, depth};
use handeye_dataset as dataset;
use handeye_files::digest::Listing;
use handeye_files::own_folder;
use handeye_geometry::depth::DepthImage;

/// The committed state of a session.
#[derive(Debug)]
pub(super) struct Loaded {
    pub history: History,
    /// The number of the last entry; 0 when there was never one.
    pub sequence: u64,
    /// Valid bytes of the journal; `None` when there is no journal.
    pub journal_length: Option<u64>,
}

pub(super) fn load(folder: &Path) -> Result<Loaded, SessionError> {
    // First the document: a program that writes meanwhile then only lets the journal be further.
    let file = read_file(folder);
    let path = folder.join(JOURNAL);
    let bytes = match own_folder::read(&path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == ErrorKind::NotFound => return file.map(without_journal),
        Err(e) => return Err(SessionError::unreadable(&path, &e)),
    };
    let seen = match file {
        Ok(file) => file.sequence,
        // A document of something else, or of a newer version, is not ours to replace.
        Err(error) if matches!(error.problem, SessionProblem::Format(_) | SessionProblem::Version { .. }) => {
            return Err(error);
        }
        // The journal has everything that a missing or damaged document had.
        Err(_) => Some(0),
    };
    let replayed = journal::replay(&bytes).map_err(|problem| SessionError::new(&path, problem))?;
    let Some(seen) = seen else {
        // Without a number it is older than the journal, which then has only its first entry.
        return if replayed.rows == 1 {
            Ok(from_journal(replayed))
        } else {
            Err(SessionError::new(&folder.join(DOCUMENT), SessionProblem::OlderProgram))
        };
    };
    if seen > replayed.sequence {
        // The document follows the journal, so that entry was on the disk.
        let what = format!("entry {seen} is in {DOCUMENT} and no longer in the journal");
        return Err(SessionError::new(&path, SessionProblem::Damaged { row: replayed.rows + 1, what }));
    }
    Ok(from_journal(replayed))
}

fn from_journal(replayed: Replayed) -> Loaded {
    let journal_length = Some(replayed.length as u64);
    Loaded { history: replayed.history, sequence: replayed.sequence, journal_length }
}

fn without_journal(file: SessionFile) -> Loaded {
    let history = History::new(file.document).with_numbers_used(file.last_capture);
    Loaded { history, sequence: file.sequence.unwrap_or(0), journal_length: None }
}

fn read_file(folder: &Path) -> Result<SessionFile, SessionError> {
    let path = folder.join(DOCUMENT);
    let bytes = match own_folder::read(&path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == ErrorKind::NotFound && folder.is_dir() => {
            return Err(SessionError::new(folder, SessionProblem::NotASession));
        }
        Err(e) => return Err(SessionError::unreadable(&path, &e)),
    };
    let text = String::from_utf8(bytes).map_err(|e| SessionError::unreadable(&path, &e))?;
    session_file::from_json(&text).map_err(|problem| SessionError::new(&path, problem))
}

/// Whether the image of every capture exists; it is not decoded.
pub(super) fn check_images(folder: &Path, document: &Document) -> Result<(), SessionError> {
    document.captures.iter().try_for_each(|capture| check_file_of(folder, capture, &capture.image))
}

/// Whether the files of every capture exist; they are not decoded.
pub(super) fn check_files(folder: &Path, document: &Document) -> Result<(), SessionError> {
    document.captures.iter().try_for_each(|capture| check_files_of(folder, capture))
}

pub(super) fn check_files_of(folder: &Path, capture: &CaptureRecord) -> Result<(), SessionError> {
    capture.files().try_for_each(|name| check_file_of(folder, capture, name))
}

fn check_file_of(folder: &Path, capture: &CaptureRecord, name: &str) -> Result<(), SessionError> {
    let path = folder.join(name);
    if path.is_file() {
        return Ok(());
    }
    let what = format!("it is not there and capture {} needs it: bring it back from a copy", capture.id);
    Err(SessionError::new(&path, SessionProblem::Unreadable(what)))
}

/// The digest of the session's data set.
pub(super) fn input_sha256(folder: &Path, document: &Document) -> Result<String, SessionError> {
    let (description, pose_table) = document.as_dataset();
    let mut listing = Listing::default();
    listing.add(dataset::DESCRIPTION, description.as_bytes());
    if let Some(pose_table) = pose_table {
        listing.add(dataset::write::POSE_TABLE, pose_table.as_bytes());
    }
    for capture in document.in_use() {
        let path = folder.join(&capture.image);
        listing.add_file(&capture.image, &path).map_err(|e| SessionError::unreadable(&path, &e))?;
    }
    Ok(listing.digest())
}

pub(super) fn rgb(folder: &Path, capture: &CaptureRecord) -> Result<RgbImage, SessionError> {
    let path = folder.join(&capture.image);
    handeye_images::load_rgb(&path).map_err(|e| SessionError::unreadable(&path, &e))
}

impl CaptureRecord {
    /// Its depth in metres, from the folder of its session; `None` when none was recorded.
    ///
    /// # Errors
    /// [`SessionError`] when the file is damaged, truncated or gone.
    pub fn load_depth_m(&self, folder: &Path) -> Result<Option<DepthImage>, SessionError> {
        depth_m(folder, self)
    }
}

pub(super) fn depth_m(folder: &Path, capture: &CaptureRecord) -> Result<Option<DepthImage>, SessionError> {
    let Some(name) = &capture.depth else { return Ok(None) };
    let path = folder.join(name);
    depth::load(&path).map(Some).map_err(|e| SessionError::unreadable(&path, &e))
}
