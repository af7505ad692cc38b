//! Files that are there completely or not at all, also after a power cut.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// Replaces `path` by `bytes` so that a reader, or a machine that stops at any moment, sees the old content or the
/// new and never a part: written beside it under a hidden name, flushed to the disk, renamed, the folder flushed.
///
/// The folder must exist. A left-over hidden file of an interrupted write is overwritten by the next.
///
/// # Errors
/// Whatever the file system reports; the old content is then still in place.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let partial = partial_path(path)?;
    let mut file = File::create(&partial)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    drop(file);
    if let Err(error) = written.and_then(|()| fs::rename(&partial, path)) {
        // Best effort: the error that matters is the first.
        drop(fs::remove_file(&partial));
        return Err(error);
    }
    sync_folder(parent(path))
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

fn partial_path(path: &Path) -> io::Result<PathBuf> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, format!("{} is not a file name", path.display())))?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(".partial");
    Ok(parent(path).join(hidden))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_keeps_the_old_content_and_leaves_nothing_behind() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("result.json");
        write(&path, b"old").expect("first write");
        // A folder cannot be replaced by a file, so this rename fails after the bytes are written.
        let taken = folder.path().join("taken");
        fs::create_dir_all(taken.join("inside")).expect("a folder in the way");
        assert!(write(&taken, b"new").is_err());
        assert_eq!(fs::read(&path).expect("still there"), b"old");
        let names: Vec<_> = fs::read_dir(folder.path()).expect("list").map(|e| e.expect("entry").file_name()).collect();
        assert_eq!(names.len(), 2, "{names:?}");
    }

    #[test]
    fn a_new_write_replaces_the_whole_content() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("result.json");
        write(&path, b"a long old content").expect("first write");
        write(&path, b"new").expect("second write");
        assert_eq!(fs::read(&path).expect("read"), b"new");
    }
}
