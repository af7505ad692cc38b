//! Session folders: what a capture leaves, and what `calibrate` reads.
//!
//! ```text
//! session.json      the session: mode, target, seeds, truth, and every capture with pose, joints and time
//! dataset.toml      the same folder as a dataset folder, see [`crate::dataset`]
//! poses.csv
//! images/0001.png   8-bit RGB
//! depth/0001.tiff   32-bit float, metres, see [`DepthImage`](crate::depth::DepthImage)
//! ```
//!
//! A capture counts from the moment `session.json` names it. That file is replaced as a whole and last, after the
//! image, the depth and the pose table are on the disk; so a kill or a power cut at any moment leaves a session with
//! every acknowledged capture. What an interrupted capture leaves besides (an image, a row in `poses.csv`) does no
//! harm and is overwritten by the next capture.

mod depth;
mod document;
mod edit;
mod error;
mod history;
pub(crate) mod pose_record;
mod session_file;
mod writer;

use std::fs;
use std::path::{Path, PathBuf};

use image::RgbImage;

pub use document::{CaptureId, CaptureRecord, Document, GroundTruth, Role, SessionMeta};
pub use edit::{Edit, EditError, TaughtChange};
pub use error::{SessionError, SessionProblem};
pub use history::{History, UNDO_STEPS};
pub use session_file::{FORMAT, MAJOR_VERSION, MINOR_VERSION};
pub use writer::{Capture, SessionWriter};

use crate::depth::DepthImage;
use crate::image_file::{self, one_line};

/// Name of the document in a session folder.
pub const DOCUMENT: &str = "session.json";

/// A session that was read.
#[derive(Debug, Clone)]
pub struct Session {
    /// The folder.
    pub folder: PathBuf,
    /// What was known when it began.
    pub meta: SessionMeta,
    /// The captures in their order.
    pub captures: Vec<CaptureRecord>,
}

impl Session {
    /// Whether a folder claims to be a session.
    pub fn is_session(folder: &Path) -> bool {
        folder.join(DOCUMENT).is_file()
    }

    /// Reads a session. The files of every capture must be there; they are not decoded.
    ///
    /// # Errors
    /// [`SessionError`]: no session, an unknown major version, a damaged document, a file that is gone.
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        let document = read_document(folder)?;
        for (i, capture) in document.captures.iter().enumerate() {
            for name in std::iter::once(&capture.image).chain(&capture.depth) {
                let path = folder.join(name);
                if !path.is_file() {
                    let problem = SessionProblem::Unreadable(format!("captures[{i}] in {DOCUMENT} names this file"));
                    return Err(SessionError::new(&path, problem));
                }
            }
        }
        Ok(Self { folder: folder.to_path_buf(), meta: document.meta, captures: document.captures })
    }

    /// The image of a capture.
    ///
    /// # Errors
    /// [`SessionError`] when it is damaged, truncated or gone.
    pub fn load_rgb(&self, capture: &CaptureRecord) -> Result<RgbImage, SessionError> {
        let path = self.folder.join(&capture.image);
        image_file::load_rgb(&path).map_err(|e| SessionError::new(&path, SessionProblem::Unreadable(one_line(&e))))
    }

    /// The depth of a capture in metres; `None` when none was recorded.
    ///
    /// # Errors
    /// As [`Self::load_rgb`].
    pub fn load_depth_m(&self, capture: &CaptureRecord) -> Result<Option<DepthImage>, SessionError> {
        let Some(name) = &capture.depth else { return Ok(None) };
        let path = self.folder.join(name);
        depth::load(&path).map(Some).map_err(|e| SessionError::new(&path, SessionProblem::Unreadable(e)))
    }
}

fn read_document(folder: &Path) -> Result<Document, SessionError> {
    let path = folder.join(DOCUMENT);
    let text = match fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound && folder.is_dir() => {
            return Err(SessionError::new(folder, SessionProblem::NotASession));
        }
        Err(e) => return Err(SessionError::new(&path, SessionProblem::Unreadable(one_line(&e)))),
    };
    session_file::from_json(&text).map(|file| file.document).map_err(|problem| SessionError::new(&path, problem))
}

#[cfg(test)]
mod tests;
