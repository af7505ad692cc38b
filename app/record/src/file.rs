//! Files of recordings.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

/// A file is not continued with live entries beyond this size. Lasting entries are a fraction of it.
pub const MAX_LIVE_BYTES: u64 = 512 * 1024 * 1024;

/// Makes an empty file in a folder, under a name that is not taken: `recording.rrd`, `recording-2.rrd`, ….
///
/// # Errors
/// When none can be created there.
pub fn create_next_to(folder: &Path) -> io::Result<PathBuf> {
    let mut number = 1;
    loop {
        let name = if number == 1 { "recording.rrd".to_owned() } else { format!("recording-{number}.rrd") };
        let path = folder.join(name);
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(_) => return Ok(path),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            Err(error) => return Err(error),
        }
    }
}

/// Creates the requested file. An existing one is replaced, as with every file that is named.
///
/// # Errors
/// When it cannot be created.
pub fn create_named(path: &Path) -> io::Result<()> {
    File::create(path).map(drop)
}

/// Size in bytes; 0 for a file that is gone.
pub fn size(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |metadata| metadata.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_earlier_recording_is_never_overwritten() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = create_next_to(folder.path()).expect("a file");
        fs::write(&first, "something").expect("written");
        let second = create_next_to(folder.path()).expect("a file");
        assert_eq!(second.file_name().and_then(|name| name.to_str()), Some("recording-2.rrd"));
        assert_eq!((size(&first), size(&second)), (9, 0));
        assert!(create_next_to(&folder.path().join("none")).is_err());
    }
}
