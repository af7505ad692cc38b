//! Session folders: what a capture leaves, what a person does with it, and what `calibrate` reads.
//!
//! ```text
//! journal.jsonl     everything that was done, entry by entry: the session itself
//! session.json      the session as it is now: mode, target, seeds, truth, and every capture with pose, joints and time
//! dataset.toml      the captures in use as a dataset folder, see [`handeye_dataset`]
//! poses.csv
//! images/0001.png   8-bit RGB
//! depth/0001.tiff   32-bit float, metres, see [`DepthImage`]
//! result.json       the last result, see [`Store::write_result`]
//! ```
//!
//! A change counts from the moment its line in the journal is on the disk; `session.json`, `dataset.toml` and
//! `poses.csv` follow from the journal and are written again when they lag. So a kill or a power cut at any moment
//! leaves a session with every acknowledged change, and with everything that can be undone and redone. Files of an
//! interrupted capture do no harm and are overwritten by the next; files of deleted captures stay, for undo.
//!
//! [`Document`] is the contents of a session, [`Edit`] a change of it, [`History`] both with undo, [`Store`] all three
//! on a disk. The layout is described in `docs/reference/session.md`.
//!
//! ```
//! use handeye_estimate::handeye::Mode;
//! use handeye_geometry::targets::{Grid, TargetSpec};
//! use handeye_session::{Edit, SessionMeta, Store};
//!
//! let folder = tempfile::tempdir()?;
//! let meta = SessionMeta {
//!     created: "2026-01-01T00:00:00Z".to_owned(),
//!     tool_version: "example".to_owned(),
//!     mode: Mode::EyeInHand,
//!     target: TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 }),
//!     camera: None,
//!     seeds: [].into(),
//!     ground_truth: None,
//!     arm: None,
//!     joint_kinds: None,
//!     tool_m: None,
//!     robot_accuracy_mm: None,
//! };
//! let mut store = Store::create(&folder.path().join("session"), meta)?;
//! store.apply(Edit::SetMode(Mode::EyeToHand))?;
//! store.undo()?;
//! assert_eq!(store.document().meta.mode, Mode::EyeInHand);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Never depends on a detector or a window.

#![warn(missing_docs)]

mod arm_use;
mod capture;
mod capture_id;
mod depth;
mod derived;
mod document;
mod edit;
mod edit_error;
mod error;
pub mod guided;
mod history;
mod journal;
mod load;
mod lock;
mod observations;
mod save_as;
mod session_file;
mod store;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::RgbImage;

pub use capture::Capture;
pub use capture_id::CaptureId;
pub use document::{CaptureRecord, Document, GroundTruth, Role, SessionMeta};
pub use edit::Edit;
pub use edit_error::{EditError, TaughtChange};
pub use error::{SessionError, SessionProblem};
pub use history::{History, UNDO_STEPS};
pub use lock::FolderLock;
pub use observations::SessionObservations;
pub use session_file::{FORMAT, MAJOR_VERSION, MINOR_VERSION};
pub use store::Store;

pub use handeye_files::own_folder::{DOCUMENT, JOURNAL};

use handeye_files::own_folder;
use handeye_geometry::depth::DepthImage;

/// Name of the result in a session folder.
pub const RESULT: &str = "result.json";

/// A session that was read, without the right to change it.
#[derive(Debug, Clone)]
pub struct Session {
    /// The folder that was read.
    pub folder: PathBuf,
    /// The session as it was when it was read.
    pub document: Arc<Document>,
}

impl Session {
    /// Whether a folder is marked as a session.
    pub fn is_session(folder: &Path) -> bool {
        own_folder::is_session(folder)
    }

    /// Reads a session, also while another program writes it; nothing in the folder is changed. The image of every
    /// capture must be there; it is not decoded. Depth images are not needed for a calibration.
    ///
    /// # Errors
    /// [`SessionError`]: no session, an unknown major version, a damaged journal, a file that is gone.
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        let loaded = load::load(folder)?;
        let document = loaded.history.document().clone();
        load::check_images(folder, &document)?;
        Ok(Self { folder: folder.to_path_buf(), document })
    }

    /// Width and height in pixels, by the headers of the images; `None` when there are no captures.
    ///
    /// # Errors
    /// [`SessionError`] when one cannot be read, or is not of the size of the first.
    pub fn image_size(&self) -> Result<Option<(u32, u32)>, SessionError> {
        let mut size = None;
        for capture in &self.document.captures {
            let path = self.folder.join(&capture.image);
            let (width, height) = handeye_images::image_size(&path).map_err(|e| SessionError::unreadable(&path, &e))?;
            let need = *size.get_or_insert((width, height));
            if (width, height) != need {
                let (need_width, need_height) = need;
                let what = format!("it is {width}×{height} px, and the first image {need_width}×{need_height} px");
                return Err(SessionError::unreadable(&path, &what));
            }
        }
        Ok(size)
    }

    /// SHA-256 of the captures in use, the same as [`handeye_dataset::Dataset::input_sha256`] of the session's data set,
    /// whose files need not exist.
    ///
    /// # Errors
    /// [`SessionError`] when an image can no longer be read.
    pub fn input_sha256(&self) -> Result<String, SessionError> {
        load::input_sha256(&self.folder, &self.document)
    }

    /// The image of a capture.
    ///
    /// # Errors
    /// [`SessionError`] when it is damaged, truncated or gone.
    pub fn load_rgb(&self, capture: &CaptureRecord) -> Result<RgbImage, SessionError> {
        load::rgb(&self.folder, capture)
    }

    /// The depth of a capture in metres; `None` when none was recorded.
    ///
    /// # Errors
    /// As [`Self::load_rgb`].
    pub fn load_depth_m(&self, capture: &CaptureRecord) -> Result<Option<DepthImage>, SessionError> {
        load::depth_m(&self.folder, capture)
    }
}

#[cfg(all(test, unix))]
mod foreign_tests;
#[cfg(test)]
mod tests;
