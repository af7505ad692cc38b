//! Sessions and data sets are folders that are handed around, so their content may come from another user: nothing is
//! written through a link inside of one. A link above the folder, or to it, is the user's own and is followed.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Name of the description in a dataset folder.
pub const DESCRIPTION: &str = "dataset.toml";
/// Name of the document in a session folder.
pub const DOCUMENT: &str = "session.json";
/// Name of the journal in a session folder.
pub const JOURNAL: &str = "journal.jsonl";

/// Whether a folder is marked as a session.
pub fn is_session(folder: &Path) -> bool {
    [DOCUMENT, JOURNAL].iter().any(|name| folder.join(name).is_file())
}

/// The session or data set that contains a path, the nearest above it; `None` when there is none.
pub fn root_of(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    path.ancestors().skip(1).find(|folder| is_root(folder)).map(Path::to_path_buf)
}

/// Refuses to write into a folder that is reached through a link inside of a session or a data set. The folder need not be
/// there.
///
/// # Errors
/// [`ErrorKind::InvalidInput`] names the link and states what to do.
pub fn check_folder(folder: &Path) -> io::Result<()> {
    let folder = std::path::absolute(folder)?;
    let mut link = None;
    for part in folder.ancestors() {
        // A link may lead to another session, which does not make it the user's own.
        let is_link = is_link(part);
        if is_root(part) {
            match link {
                Some(link) => return Err(is_a_link(link)),
                None if !is_link => return Ok(()),
                None => {}
            }
        }
        if is_link {
            link = Some(part);
        }
    }
    Ok(())
}

/// Refuses to open a file of a session for writing that is a link, a pipe or a device. It need not be there.
///
/// # Errors
/// [`ErrorKind::InvalidInput`] names the file and states what to do.
pub fn check_file(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Ok(found) if found.is_symlink() => Err(is_a_link(path)),
        Ok(found) if !found.is_file() => Err(not_a_file(path)),
        Ok(_) => Ok(()),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
        Err(e) => Err(e),
    }
}

/// The bytes of a file. A pipe or a device in its place is an error, not something to wait for.
///
/// # Errors
/// Whatever the file system reports; [`ErrorKind::InvalidInput`] for anything that is not a file.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    if fs::metadata(path)?.is_file() { fs::read(path) } else { Err(not_a_file(path)) }
}

fn is_root(folder: &Path) -> bool {
    [DOCUMENT, JOURNAL, DESCRIPTION].iter().any(|mark| fs::symlink_metadata(folder.join(mark)).is_ok())
}

fn is_link(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| found.is_symlink())
}

fn is_a_link(link: &Path) -> io::Error {
    let what = format!(
        "{} is a link, and nothing is written through links inside of a session or a data set: remove the link, or name a \
         place outside",
        link.display()
    );
    io::Error::new(ErrorKind::InvalidInput, what)
}

fn not_a_file(path: &Path) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, format!("{} is not a file", path.display()))
}
