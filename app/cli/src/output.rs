//! Options that name a file to write: a file is replaced as a whole, a pipe or a device is written to.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use handeye_files::{atomic_file, own_folder};

use super::{Failure, out};

/// Where an output goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Output {
    /// `-`, and every name of standard output, such as `/dev/stdout`.
    Standard,
    /// A pipe, a device or an open file of this process, which is written to and never replaced.
    Direct(PathBuf),
    /// A file, or nothing yet. A link to a file is replaced and not followed.
    File(PathBuf),
}

impl From<OsString> for Output {
    fn from(name: OsString) -> Self {
        let path = PathBuf::from(name);
        if path.as_os_str() == "-" {
            return Self::Standard;
        }
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_symlink() => Self::of_link(path),
            Ok(found) if !found.is_file() && !found.is_dir() => Self::direct(path),
            _ => Self::File(path),
        }
    }
}

impl Output {
    fn of_link(path: PathBuf) -> Self {
        // In a folder of another user, the link may be another user's as well.
        if own_folder::root_of(&path).is_some() {
            return Self::File(path);
        }
        let leads_to_a_file = fs::metadata(&path).map_or(true, |found| found.is_file() || found.is_dir());
        // Links of the system to files that are open already, such as /dev/fd/3, cannot be replaced.
        let folder = path.parent().map(|folder| folder.canonicalize().unwrap_or_default()).unwrap_or_default();
        let is_of_system = ["/dev", "/proc"].iter().any(|system| folder.starts_with(system));
        if leads_to_a_file && !is_of_system && !is_standard_output(&path) {
            Self::File(path)
        } else {
            Self::direct(path)
        }
    }

    fn direct(path: PathBuf) -> Self {
        if is_standard_output(&path) { Self::Standard } else { Self::Direct(path) }
    }

    /// Whether it replaces what is otherwise printed.
    pub fn is_standard(&self) -> bool {
        *self == Self::Standard
    }

    /// Writes all of it.
    ///
    /// # Errors
    /// When it cannot be written. A pipe that was closed by its reader is not a failure.
    pub fn write(&self, bytes: &[u8]) -> Result<(), Failure> {
        match self {
            Self::Standard => out::bytes(bytes),
            Self::Direct(path) => {
                let written = open(path).and_then(|mut file| file.write_all(bytes));
                out::finished(written, path.display())
            }
            Self::File(path) => atomic_file::write(path, bytes).map_err(|error| cannot_write(path, &error)),
        }
    }

    /// Opens it to be written piece by piece; a file then contains what has been written so far.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(&self) -> io::Result<Box<dyn Write>> {
        Ok(match self {
            Self::Standard => Box::new(out::Results),
            Self::Direct(path) => Box::new(open(path)?),
            Self::File(path) => Box::new(atomic_file::create(path)?),
        })
    }
}

impl std::fmt::Display for Output {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Standard => f.write_str("standard output"),
            Self::Direct(path) | Self::File(path) => path.display().fmt(f),
        }
    }
}

/// Opens a pipe or a device. A file behind it is continued at its end, as the shell left it.
fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().append(true).open(path)
}

fn cannot_write(path: &Path, error: &io::Error) -> Failure {
    Failure::failed(anyhow!("{} cannot be written: {error}", path.display()))
}

/// Whether a path leads to standard output.
#[cfg(unix)]
fn is_standard_output(path: &Path) -> bool {
    use std::os::fd::AsFd as _;
    use std::os::unix::fs::MetadataExt as _;

    let ours = io::stdout().as_fd().try_clone_to_owned().map(File::from).and_then(|stdout| stdout.metadata());
    let (Ok(ours), Ok(theirs)) = (ours, fs::metadata(path)) else { return false };
    (ours.dev(), ours.ino()) == (theirs.dev(), theirs.ino())
}

#[cfg(not(unix))]
fn is_standard_output(_path: &Path) -> bool {
    false
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn output(path: &Path) -> Output {
        Output::from(path.as_os_str().to_owned())
    }

    #[test]
    fn a_file_is_replaced_and_what_is_none_is_written_to() {
        let home = tempfile::tempdir().expect("a folder");
        let at = |name: &str| home.path().join(name);
        fs::write(at("file"), "old").expect("written");
        symlink(at("file"), at("to-file")).expect("a link");
        symlink(at("not-there"), at("dangling")).expect("a link");
        symlink("/dev/null", at("to-null")).expect("a link");
        assert_eq!(Output::from(OsString::from("-")), Output::Standard);
        for name in ["file", "to-file", "dangling", "new"] {
            assert_eq!(output(&at(name)), Output::File(at(name)), "{name}");
        }
        // The runner's own standard output may be the null device.
        assert!(!matches!(output(&at("to-null")), Output::File(_)));
        let reader = File::open(at("file")).expect("a file");
        let descriptor = PathBuf::from(format!("/dev/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&reader)));
        assert_eq!(output(&descriptor), Output::Direct(descriptor.clone()), "an open file is not replaced");
        // The owner of this folder created the link as well.
        fs::write(at("session.json"), "{}").expect("written");
        assert_eq!(output(&at("to-null")), Output::File(at("to-null")));
    }
}
