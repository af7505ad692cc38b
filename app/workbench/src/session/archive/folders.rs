//! Where new sessions go.

use std::path::{Path, PathBuf};

use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;
use time::macros::format_description;

/// The present moment as the name of a folder, `2026-05-02T10-11-12` in UTC.
pub fn timestamp() -> String {
    // The format has no part that can fail.
    OffsetDateTime::now_utc()
        .format(format_description!("[year]-[month]-[day]T[hour]-[minute]-[second]"))
        .unwrap_or_else(|_unformattable| "session".to_owned())
}

/// The present moment for the document.
pub fn timestamp_rfc3339() -> String {
    OffsetDateTime::now_utc().format(&Rfc3339).unwrap_or_default()
}

/// A folder of that name that is not there yet.
pub fn free_folder(under: &Path, name: &str) -> PathBuf {
    (1..u32::MAX)
        .map(|n| if n == 1 { under.join(name) } else { under.join(format!("{name}-{n}")) })
        .find(|folder| !folder.exists())
        .unwrap_or_else(|| under.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sessions_of_one_second_get_two_folders() {
        let under = tempfile::tempdir().expect("a folder");
        let first = free_folder(under.path(), "now");
        std::fs::create_dir(&first).expect("created");
        let second = free_folder(under.path(), "now");
        assert_eq!((first.ends_with("now"), second.ends_with("now-2")), (true, true));
    }
}
