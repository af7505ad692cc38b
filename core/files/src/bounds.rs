//! Limits on the paths in the files of a recording, a data set or a session. Every access is checked here before a file
//! is opened.
//!
//! A user of this machine may name whatever the system lets them read. A user of a browser may name only what is in the
//! folder that was opened for them, whatever the files in it state: links are resolved before the check, `..` leads out of a
//! folder, and missing files count as outside.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

/// Deepest folder, and most names, that are checked for links.
const MAX_DEPTH: usize = 16;
const MAX_NAMES: usize = 100_000;

/// The part of the file system that files may name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Bounds(Option<PathBuf>);

impl Bounds {
    /// Whatever the system lets this program read.
    pub const ANYWHERE: Self = Self(None);

    /// This folder with all that is in it, without links that lead out of it.
    pub fn within(folder: &Path) -> Self {
        Self(Some(real(folder)))
    }

    /// Whether a file or folder, which need not exist, may be named.
    pub fn has(&self, path: &Path) -> bool {
        let Some(folder) = &self.0 else { return true };
        let path = real(path);
        !path.components().any(|part| part == Component::ParentDir) && path.starts_with(folder)
    }

    /// The folder; `None` where everything may be named.
    pub fn folder(&self) -> Option<&Path> {
        self.0.as_deref()
    }

    /// Refuses a folder with a link in it, however deep, that leads out.
    ///
    /// # Errors
    /// [`io::ErrorKind::PermissionDenied`] names the link, or states that there are too many entries to check.
    pub fn check_links(&self, folder: &Path) -> io::Result<()> {
        if self.0.is_none() {
            return Ok(());
        }
        let refused = |path: &Path, why: &str| {
            Err(io::Error::new(io::ErrorKind::PermissionDenied, format!("{} {why}", path.display())))
        };
        let mut left = MAX_NAMES;
        let mut open = vec![(folder.to_path_buf(), 0)];
        while let Some((here, depth)) = open.pop() {
            for entry in fs::read_dir(&here)? {
                let entry = entry?;
                let (path, kind) = (entry.path(), entry.file_type()?);
                if left == 0 || depth > MAX_DEPTH {
                    return refused(&here, "has more files than are looked at: open the folder of one recording");
                }
                left -= 1;
                if kind.is_symlink() && !self.has(&path) {
                    return refused(&path, "is a link that leads out of the folder that may be read from here");
                }
                if kind.is_dir() {
                    open.push((path, depth + 1));
                }
            }
        }
        Ok(())
    }
}

/// The path without links, as far as it exists; what does not exist is appended as it is.
fn real(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    for there in path.ancestors() {
        if let Ok(real) = there.canonicalize() {
            let rest = path.strip_prefix(there).unwrap_or_else(|_| Path::new(""));
            // Joining an empty path would add a separator, with which a file is not found.
            return if rest.as_os_str().is_empty() { real } else { real.join(rest) };
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_outside_is_had_by_dots_links_or_absolute_paths() {
        let home = tempfile::tempdir().expect("a folder");
        let inside = home.path().join("set");
        fs::create_dir_all(inside.join("images")).expect("made");
        fs::create_dir(home.path().join("set of others")).expect("made");
        fs::write(home.path().join("private.png"), "x").expect("written");
        fs::write(inside.join("own.png"), "x").expect("written");
        std::os::unix::fs::symlink(home.path().join("private.png"), inside.join("images/1.png")).expect("linked");
        std::os::unix::fs::symlink(inside.join("own.png"), inside.join("images/2.png")).expect("linked");
        std::os::unix::fs::symlink(home.path().join("not-there"), inside.join("images/3.png")).expect("linked");
        let bounds = Bounds::within(&inside);
        for path in ["own.png", "images/../own.png", "images/2.png", "images/new.png", "", "new/folder"] {
            assert!(bounds.has(&inside.join(path)), "{path}");
        }
        for path in ["../private.png", "images/1.png", "images/../../private.png", "/etc/passwd", "new/../../x", ".."] {
            assert!(!bounds.has(&inside.join(path)), "{path}");
            assert!(Bounds::ANYWHERE.has(&inside.join(path)), "{path}");
        }
        assert!(!bounds.has(&home.path().join("set of others")));
        let refused = bounds.check_links(&inside).expect_err("a link leads out").to_string();
        assert!(refused.contains("is a link"), "{refused}");
        Bounds::ANYWHERE.check_links(&inside).expect("a person may");
        fs::remove_file(inside.join("images/1.png")).expect("removed");
        fs::remove_file(inside.join("images/3.png")).expect("removed");
        bounds.check_links(&inside).expect("no link leads out");
    }
}
