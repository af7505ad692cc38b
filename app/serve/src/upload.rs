//! Files that are dropped on a page: they are stored one by one in a new folder of the sessions, which is then opened.
//!
//! The state of uploads is bounded, and so is the number of simultaneous files, so that neither many uploads nor slow
//! ones block others.

use std::collections::HashMap;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::body::Body;
use http_body_util::BodyExt as _;
use tokio::io::AsyncWriteExt as _;
use tokio::sync::Semaphore;
use tokio::time::timeout;

/// Largest file \[bytes\].
const MOST_OF_A_FILE: u64 = 2 << 30;

/// All files of an upload together \[bytes\].
const MOST_OF_ALL: u64 = 8 << 30;

/// Files of an upload.
const MOST_FILES: usize = 20_000;

/// Uploads that are remembered; the least recently used is dropped first.
const MOST_UPLOADS: usize = 64;

/// Simultaneous files. A page sends one after the other; most of the connections are left for other things.
const MOST_AT_A_TIME: usize = 8;

/// Longest wait for the next piece of a file.
const PATIENCE: Duration = Duration::from_secs(30);

/// Name of the folder in that of the sessions.
const FOLDER: &str = "uploads";

/// The folder of all uploads, in that of the sessions.
pub fn folder(sessions: &Path) -> PathBuf {
    sessions.join(FOLDER)
}

/// The uploads of this process.
pub struct Uploads {
    folder: PathBuf,
    state: Mutex<State>,
    places: Semaphore,
}

#[derive(Default)]
struct State {
    begun: HashMap<String, Begun>,
    /// Files of all uploads so far.
    files: u64,
}

struct Begun {
    folder: PathBuf,
    bytes: u64,
    files: usize,
    /// Files in progress.
    coming: usize,
    /// Number of its latest file among all.
    latest: u64,
}

/// A file in progress.
struct Coming<'a> {
    uploads: &'a Uploads,
    upload: &'a str,
    folder: PathBuf,
}

impl Drop for Coming<'_> {
    fn drop(&mut self) {
        if let Some(begun) = self.uploads.state().begun.get_mut(self.upload) {
            begun.coming -= 1;
        }
    }
}

/// Why a file was not taken.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
pub(crate) enum UploadError {
    /// The path leads elsewhere or is invalid.
    #[error("the name of a file may not lead out of its folder")]
    Name,
    /// There is too much.
    #[error("an upload holds up to 20,000 files, 2 GiB in one file and 8 GiB in all")]
    TooMuch,
    /// Too many others are in progress.
    #[error("{MOST_AT_A_TIME} files are coming already")]
    Busy,
    /// No more data arrives.
    #[error("nothing came of a file for {seconds} s", seconds = PATIENCE.as_secs())]
    Stalled,
    /// The connection or the disk failed.
    #[error("a file could not be kept: {0}")]
    Io(#[from] io::Error),
}

impl Uploads {
    /// Into a folder inside that of the sessions.
    pub fn new(sessions: &Path) -> Self {
        Self { folder: folder(sessions), state: Mutex::default(), places: Semaphore::new(MOST_AT_A_TIME) }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a file; the name of its upload is chosen by the page.
    ///
    /// # Errors
    /// See [`UploadError`]; what was written of the file is then removed.
    pub async fn take(&self, upload: &str, path: &str, mut body: Body) -> Result<(), UploadError> {
        let relative = harmless(path).ok_or(UploadError::Name)?;
        let Ok(_place) = self.places.try_acquire() else { return Err(UploadError::Busy) };
        let coming = self.begun(upload)?;
        let file = coming.folder.join(&relative);
        if let Some(parent) = file.parent() {
            tokio::fs::create_dir_all(parent).await?;
        }
        let mut written = tokio::fs::OpenOptions::new().write(true).create_new(true).open(&file).await?;
        let outcome = async {
            let mut bytes = 0;
            loop {
                let Ok(frame) = timeout(PATIENCE, body.frame()).await else { return Err(UploadError::Stalled) };
                let Some(frame) = frame else { break };
                let frame = frame.map_err(io::Error::other)?;
                let Some(data) = frame.data_ref() else { continue };
                bytes += data.len() as u64;
                if bytes > MOST_OF_A_FILE || self.grew(upload, data.len() as u64) > MOST_OF_ALL {
                    return Err(UploadError::TooMuch);
                }
                written.write_all(data).await?;
            }
            written.sync_all().await?;
            Ok(())
        }
        .await;
        if outcome.is_err() {
            let _removed = tokio::fs::remove_file(&file).await.is_ok();
        }
        outcome
    }

    /// One more file of an upload, whose folder is created with the first one.
    fn begun<'a>(&'a self, upload: &'a str) -> Result<Coming<'a>, UploadError> {
        if upload.is_empty() || upload.len() > 40 || !upload.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
            return Err(UploadError::Name);
        }
        let mut state = self.state();
        state.files += 1;
        let latest = state.files;
        if let Some(begun) = state.begun.get_mut(upload) {
            if begun.files >= MOST_FILES {
                return Err(UploadError::TooMuch);
            }
            (begun.files, begun.coming, begun.latest) = (begun.files + 1, begun.coming + 1, latest);
            return Ok(Coming { uploads: self, upload, folder: begun.folder.clone() });
        }
        if state.begun.len() >= MOST_UPLOADS {
            let idle = state.begun.iter().filter(|(_, begun)| begun.coming == 0);
            let oldest = idle.min_by_key(|(_, begun)| begun.latest).map(|(name, _)| name.clone());
            state.begun.remove(&oldest.ok_or(UploadError::Busy)?);
        }
        let folder = self.new_folder()?;
        let begun = Begun { folder: folder.clone(), bytes: 0, files: 1, coming: 1, latest };
        state.begun.insert(upload.to_owned(), begun);
        Ok(Coming { uploads: self, upload, folder })
    }

    fn new_folder(&self) -> Result<PathBuf, UploadError> {
        std::fs::create_dir_all(&self.folder)?;
        let name = handeye_workbench::worker::timestamp();
        // Two uploads in one second are two folders.
        let folder = (1..)
            .map(|number| match number {
                1 => self.folder.join(&name),
                number => self.folder.join(format!("{name}-{number}")),
            })
            .find_map(|folder| match std::fs::create_dir(&folder) {
                Ok(()) => Some(Ok(folder)),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => None,
                Err(error) => Some(Err(error)),
            });
        Ok(folder.ok_or(UploadError::TooMuch)??)
    }

    fn grew(&self, upload: &str, bytes: u64) -> u64 {
        self.state().begun.get_mut(upload).map_or(0, |begun| {
            begun.bytes += bytes;
            begun.bytes
        })
    }

    /// What to open of an upload: the one dropped folder or file, or all dropped files.
    pub fn finished(&self, upload: &str) -> Option<PathBuf> {
        let folder = self.state().begun.get(upload)?.folder.clone();
        let mut entries = std::fs::read_dir(&folder).ok()?.filter_map(Result::ok);
        match (entries.next(), entries.next()) {
            (Some(only), None) => Some(only.path()),
            _ => Some(folder),
        }
    }
}

/// The path, if it is relative and does not go up.
fn harmless(path: &str) -> Option<PathBuf> {
    let path = Path::new(path);
    let goes_down = path.components().all(|part| matches!(part, Component::Normal(_)));
    let is_sensible = goes_down
        && path.as_os_str().len() <= 1024
        && path.components().next().is_some()
        && !path.to_string_lossy().contains(['\0', '\\']);
    is_sensible.then(|| path.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_down_only() {
        for path in ["image.png", "set/images/0.png", "图像/一.png", "a..b/c", ".hidden"] {
            assert!(harmless(path).is_some(), "{path}");
        }
        for path in ["", "/etc/passwd", "../x", "a/../../x", "a/..", "..", "a\\..\\b", "a\0b", "./"] {
            assert!(harmless(path).is_none(), "{path:?}");
        }
    }

    #[test]
    fn an_upload_of_one_folder_is_that_folder_and_of_several_files_all_of_them() {
        let sessions = tempfile::tempdir().expect("a folder");
        let uploads = Uploads::new(sessions.path());
        assert_eq!(uploads.finished("nothing"), None);
        let folder = uploads.begun("one").expect("begun").folder.clone();
        std::fs::create_dir(folder.join("my set")).expect("made");
        assert_eq!(uploads.finished("one"), Some(folder.join("my set")));
        let folder = uploads.begun("two").expect("begun").folder.clone();
        std::fs::write(folder.join("poses.csv"), "x").expect("written");
        std::fs::write(folder.join("a.png"), "x").expect("written");
        assert_eq!(uploads.finished("two"), Some(folder));
        for name in ["", "../x", "a/b", &"x".repeat(41)] {
            assert!(uploads.begun(name).is_err(), "{name}");
        }
    }

    #[test]
    fn however_many_uploads_there_were_another_is_taken_and_those_that_come_are_not_forgotten() {
        let sessions = tempfile::tempdir().expect("a folder");
        let uploads = Uploads::new(sessions.path());
        let coming = uploads.begun("first").expect("begun");
        for number in 0..3 * MOST_UPLOADS {
            assert!(uploads.begun(&number.to_string()).is_ok(), "{number}");
        }
        assert!(uploads.finished("first").is_some(), "a file of it is on its way");
        assert!(uploads.finished("0").is_none());
        assert!(uploads.finished(&(3 * MOST_UPLOADS - 1).to_string()).is_some());
        assert_eq!(uploads.state().begun.len(), MOST_UPLOADS);
        drop(coming);
        for number in 0..MOST_UPLOADS {
            assert!(uploads.begun(&format!("more{number}")).is_ok(), "{number}");
        }
        assert!(uploads.finished("first").is_none(), "nothing of it comes any more");
    }
}
