//! Whether a session has exports of what is in it.

use std::io;
use std::path::Path;
use std::time::SystemTime;

use handeye_session::JOURNAL;

use crate::live::state::exports_of;

/// Whether the folder for exports has a file that is no older than the last change of the session. A folder that cannot
/// be read counts as empty.
pub fn is_exported(session: &Path) -> bool {
    is_younger(session).unwrap_or(false)
}

fn is_younger(session: &Path) -> io::Result<bool> {
    let changed = session.join(JOURNAL).metadata()?.modified()?;
    let mut newest = SystemTime::UNIX_EPOCH;
    for entry in exports_of(session).read_dir()? {
        newest = newest.max(entry?.metadata()?.modified()?);
    }
    Ok(newest >= changed)
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::time::Duration;

    use super::*;

    #[test]
    fn files_count_that_are_no_older_than_the_last_change() {
        let folder = tempfile::tempdir().expect("a folder");
        let session = folder.path();
        assert!(!is_exported(session), "there is no session");
        fs::write(session.join(JOURNAL), "").expect("written");
        assert!(!is_exported(session), "there are no exports");
        fs::create_dir(exports_of(session)).expect("made");
        assert!(!is_exported(session), "there are no files");
        fs::write(exports_of(session).join("a.yaml"), "").expect("written");
        let change =
            |at| File::options().write(true).open(session.join(JOURNAL)).and_then(|file| file.set_modified(at));
        let written = exports_of(session).join("a.yaml").metadata().and_then(|file| file.modified()).expect("a time");
        change(written).expect("changed");
        assert!(is_exported(session));
        change(written + Duration::from_secs(1)).expect("changed");
        assert!(!is_exported(session), "they are of other captures");
    }
}
