//! The files that follow from the journal, for other programs: `session.json`, and the session as a dataset folder.

use std::path::Path;

use super::document::Document;
use super::error::{SessionError, SessionProblem};
use super::history::History;
use super::{DOCUMENT, session_file};
use crate::image_file::one_line;
use crate::{atomic_file, dataset};

const NAMES: [&str; 3] = [dataset::DESCRIPTION, dataset::write::POSE_TABLE, DOCUMENT];

/// What is known to be in the files.
#[derive(Debug, Default)]
pub(super) struct Derived {
    written: [Option<String>; 3],
}

impl Derived {
    /// Looks at what is in a folder.
    pub fn look_at(folder: &Path) -> Self {
        // A file that cannot be read lags behind.
        Self { written: NAMES.map(|name| std::fs::read_to_string(folder.join(name)).ok()) }
    }

    /// Brings the files up to date with entry `sequence` of the journal, the document last.
    ///
    /// # Errors
    /// [`SessionProblem::Behind`]: the journal has the change.
    pub fn update(&mut self, folder: &Path, history: &History, sequence: u64) -> Result<(), SessionError> {
        let document = history.document();
        let json = session_file::to_json(document, sequence, history.last_capture())
            .map_err(|problem| SessionError::new(&folder.join(DOCUMENT), problem))?;
        for ((name, text), written) in
            NAMES.into_iter().zip([description(document), pose_table(document), json]).zip(&mut self.written)
        {
            if written.as_ref() == Some(&text) {
                continue;
            }
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

fn description(document: &Document) -> String {
    let meta = &document.meta;
    dataset::write::description(meta.mode, &meta.target, meta.camera.as_ref())
}

/// The captures in use and no others, so that the command line solves what the window solves.
fn pose_table(document: &Document) -> String {
    dataset::write::pose_table(document.in_use().map(|c| (c.image.as_str(), &c.base_from_tip)))
}
