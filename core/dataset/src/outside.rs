//! Files that a table names outside of its folder, through `../`.

use std::path::{Component, Path};

use super::error::{DatasetError, DatasetProblem, shown};
use super::text::TextFile;
use handeye_files::bounds::Bounds;
use handeye_files::own_folder::is_session;

/// Whether a normalized path in a data set is outside of it.
pub(super) fn leaves(path: &Path) -> bool {
    path.components().next() == Some(Component::ParentDir)
}

/// Collects files outside. A data set may be next to its images; a session is complete, so that a name outside of it was
/// not written by this program.
pub(super) struct Outside<'a> {
    folder: &'a Path,
    bounds: &'a Bounds,
    is_session: bool,
    names: Vec<String>,
}

impl<'a> Outside<'a> {
    pub fn of(folder: &'a Path, bounds: &'a Bounds) -> Self {
        Self { folder, bounds, is_session: is_session(folder), names: Vec::new() }
    }

    /// Looks at the file that a row names, before it is opened; `path` is it in the data set, tidied.
    pub fn look_at(&mut self, file: &Path, row: Option<usize>, name: &str, path: &Path) -> Result<(), DatasetError> {
        if !self.bounds.has(&self.folder.join(path)) {
            return Err(DatasetError::new(file, row, DatasetProblem::OutOfReach(shown(name))));
        }
        if !leaves(path) {
            return Ok(());
        }
        if self.is_session {
            return Err(DatasetError::new(file, row, DatasetProblem::OutsideSession(shown(name))));
        }
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Logs the files outside and returns them.
    #[cfg_attr(not(feature = "tracing"), expect(unused_variables, reason = "there is nobody to say it to"))]
    pub fn problems(self, table: Option<&TextFile>) -> Vec<String> {
        #[cfg(feature = "tracing")]
        if let Some(first) = self.names.first() {
            let file = table.map_or_else(|| self.folder.display(), |table| table.path.display());
            let (count, first) = (self.names.len(), shown(first));
            tracing::warn!(
                "{file}: {count} of the files that it names lie outside of the data set, the first is {first:?}"
            );
        }
        self.names
    }
}
