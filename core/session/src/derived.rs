//! The files that follow from the journal, for other programs: `session.json`, and the session as a dataset folder.

use std::path::Path;

use super::error::{SessionError, SessionProblem};
use super::history::History;
use super::{DOCUMENT, session_file};
use handeye_dataset as dataset;
use handeye_files::{atomic_file, own_folder};
use handeye_wording::one_line;

pub(super) const NAMES: [&str; 3] = [dataset::DESCRIPTION, dataset::write::POSE_TABLE, DOCUMENT];

/// Known contents of the files.
#[derive(Debug, Default)]
pub(super) struct Derived {
    written: [Option<String>; 3],
}

impl Derived {
    /// Looks at what is in a folder.
    pub fn look_at(folder: &Path) -> Self {
        // A file that cannot be read lags behind.
        let text = |name| String::from_utf8(own_folder::read(&folder.join(name)).ok()?).ok();
        Self { written: NAMES.map(text) }
    }

    /// Brings the files up to date with entry `sequence` of the journal, the document last.
    ///
    /// # Errors
    /// [`SessionProblem::Behind`]: the journal has the change.
    pub fn update(&mut self, folder: &Path, history: &History, sequence: u64) -> Result<(), SessionError> {
        let document = history.document();
        let json = session_file::to_json(document, sequence, history.last_capture())
            .map_err(|problem| SessionError::new(&folder.join(DOCUMENT), problem))?;
        let (description, pose_table) = document.as_dataset();
        let texts = [Some(description), pose_table, Some(json)];
        for ((name, text), written) in NAMES.into_iter().zip(texts).zip(&mut self.written) {
            let Some(text) = text.filter(|text| written.as_ref() != Some(text)) else { continue };
            // Not known until it is written.
            *written = None;
            let path = folder.join(name);
            atomic_file::write(&path, text.as_bytes())
                .map_err(|e| SessionError::new(&path, SessionProblem::Behind(one_line(&e))))?;
            *written = Some(text);
        }
        Ok(())
    }
}
