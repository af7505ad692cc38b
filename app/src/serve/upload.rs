//! Files that are dropped on a page: they come one by one into a new folder of the sessions, which is then opened.

use std::collections::HashMap;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use http_body_util::BodyExt as _;
use hyper::body::Incoming;
use tokio::io::AsyncWriteExt as _;

/// Largest file \[bytes\].
const MOST_OF_A_FILE: u64 = 2 << 30;

/// All files of an upload together \[bytes\].
const MOST_OF_ALL: u64 = 8 << 30;

/// Files of an upload.
const MOST_FILES: usize = 20_000;

/// Uploads that are remembered.
const MOST_UPLOADS: usize = 64;

/// Name of the folder in that of the sessions.
const FOLDER: &str = "uploads";

/// The folder of all uploads, in that of the sessions.
pub fn folder(sessions: &Path) -> PathBuf {
    sessions.join(FOLDER)
}

/// The uploads of this process.
pub struct Uploads {
    folder: PathBuf,
    begun: Mutex<HashMap<String, Begun>>,
}

struct Begun {
    folder: PathBuf,
    bytes: u64,
    files: usize,
}

/// Why a file was not taken.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// The path leads elsewhere or is none.
    #[error("the name of a file may not lead out of its folder")]
    Name,
    /// There is too much.
    #[error("an upload holds up to 20,000 files, 2 GiB in one file and 8 GiB in all")]
    TooMuch,
    /// The connection or the disk failed.
    #[error("a file could not be kept: {0}")]
    Io(#[from] io::Error),
}

impl Uploads {
    /// Into a folder of that of the sessions.
    pub fn new(sessions: &Path) -> Self {
        Self { folder: folder(sessions), begun: Mutex::default() }
    }

    /// Takes a file; the name of its upload is chosen by the page.
    ///
    /// # Errors
    /// See [`UploadError`]; what was written of the file is then removed.
    pub async fn take(&self, upload: &str, path: &str, mut body: Incoming) -> Result<(), UploadError> {
        let relative = harmless(path).ok_or(UploadError::Name)?;
        let folder = self.begun(upload)?;
        let file = folder.join(&relative);
        if let Some(parent) = file.parent() {
            tokio::fs::create_dir_all(parent).await?;
        }
        let mut written = tokio::fs::OpenOptions::new().write(true).create_new(true).open(&file).await?;
        let outcome = async {
            let mut bytes = 0;
            while let Some(frame) = body.frame().await {
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

    /// The folder of an upload, made when its first file comes.
    fn begun(&self, upload: &str) -> Result<PathBuf, UploadError> {
        if upload.is_empty() || upload.len() > 40 || !upload.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
            return Err(UploadError::Name);
        }
        let mut begun = self.begun.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(begun) = begun.get_mut(upload) {
            begun.files += 1;
            return if begun.files > MOST_FILES { Err(UploadError::TooMuch) } else { Ok(begun.folder.clone()) };
        }
        if begun.len() >= MOST_UPLOADS {
            return Err(UploadError::TooMuch);
        }
        std::fs::create_dir_all(&self.folder)?;
        let name = crate::worker::timestamp();
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
        let folder = folder.ok_or(UploadError::TooMuch)??;
        begun.insert(upload.to_owned(), Begun { folder: folder.clone(), bytes: 0, files: 1 });
        Ok(folder)
    }

    fn grew(&self, upload: &str, bytes: u64) -> u64 {
        let mut begun = self.begun.lock().unwrap_or_else(PoisonError::into_inner);
        begun.get_mut(upload).map_or(0, |begun| {
            begun.bytes += bytes;
            begun.bytes
        })
    }

    /// What is to be opened of an upload: the one folder or file that was dropped, or all files that were.
    pub fn finished(&self, upload: &str) -> Option<PathBuf> {
        let folder = self.begun.lock().unwrap_or_else(PoisonError::into_inner).get(upload)?.folder.clone();
        let mut entries = std::fs::read_dir(&folder).ok()?.filter_map(Result::ok);
        match (entries.next(), entries.next()) {
            (Some(only), None) => Some(only.path()),
            _ => Some(folder),
        }
    }
}

/// The path, if it is a relative one that goes only down.
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
        let folder = uploads.begun("one").expect("begun");
        std::fs::create_dir(folder.join("my set")).expect("made");
        assert_eq!(uploads.finished("one"), Some(folder.join("my set")));
        let folder = uploads.begun("two").expect("begun");
        std::fs::write(folder.join("poses.csv"), "x").expect("written");
        std::fs::write(folder.join("a.png"), "x").expect("written");
        assert_eq!(uploads.finished("two"), Some(folder));
        for name in ["", "../x", "a/b", &"x".repeat(41)] {
            assert!(uploads.begun(name).is_err(), "{name}");
        }
    }
}
