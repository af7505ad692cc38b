//! Files that exist completely or not at all, also after a power cut, and that are where their path states: a link in
//! their place is replaced and never followed.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::own_folder;

/// Ending of the hidden name of a file that is not complete yet.
const ENDING: &str = "partial";

/// Replaces `path` by `bytes` so that a reader, or a machine that stops at any moment, sees the old content or the new
/// and never a part: written next to it under a new hidden name, flushed to the disk, renamed, the folder flushed.
///
/// The folder must exist. What an interrupted write leaves is known by [`is_partial`].
///
/// # Errors
/// Whatever the file system reports, and a folder that is reached through a link inside of a session or a data set; the
/// old content is then still in place.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = partial(path)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    sync_folder(parent(path))
}

/// An empty file in the place of `path`, for what is written bit by bit and read as far as it came.
///
/// # Errors
/// As [`write`](fn@write).
pub fn create(path: &Path) -> io::Result<File> {
    partial(path)?.persist(path).map_err(|e| e.error)
}

/// Whether a file of this name is the rest of an interrupted write of the file `of` in the same folder.
pub fn is_partial(name: &str, of: &str) -> bool {
    name.strip_prefix('.').and_then(|rest| rest.strip_prefix(of)).is_some_and(|rest| {
        // Earlier programs had no random part.
        rest.starts_with('.') && rest.ends_with(&format!(".{ENDING}"))
    })
}

/// Flushes the names in a folder to the disk, so that a rename in it survives a power cut.
///
/// # Errors
/// Whatever the file system reports.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    // Only Unix can open a folder as a file; elsewhere the file system journals names by itself.
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A new file next to `path` with an unpredictable name; it is deleted when dropped.
fn partial(path: &Path) -> io::Result<NamedTempFile> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, format!("{} is not a file name", path.display())))?;
    own_folder::check_folder(parent(path))?;
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(".");
    let ending = format!(".{ENDING}");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&hidden).suffix(&ending);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Permissions of any other new file: by the umask.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(parent(path))
}

#[cfg(test)]
#[path = "atomic_file_tests.rs"]
mod tests;
