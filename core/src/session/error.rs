//! What can go wrong with a session folder.

use std::path::{Path, PathBuf};

/// What is wrong, and with which file or folder.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", file.display())]
#[non_exhaustive]
pub struct SessionError {
    /// The file or folder.
    pub file: PathBuf,
    /// What is wrong.
    pub problem: SessionProblem,
}

impl SessionError {
    pub(super) fn new(file: &Path, problem: SessionProblem) -> Self {
        Self { file: file.to_path_buf(), problem }
    }

    /// Whether what was to be read or used is at fault, and not the disk that was to be written: exit code 2.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self.problem, SessionProblem::Unwritable(_))
    }
}

/// What is wrong with a session.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionProblem {
    /// There is something in the folder, and it is not a session.
    #[error("is not empty and not a session, so it is not overwritten: name another folder")]
    NotEmpty,
    /// There is no `session.json`.
    #[error("has no session.json: it is not a session folder")]
    NotASession,
    /// `session.json` is something else.
    #[error("is not a session: format is {0:?}")]
    Format(String),
    /// A layout that is not known here.
    #[error("has version {found:?}, this program reads version {known}: use a newer handeye")]
    Version {
        /// What it says.
        found: String,
        /// The major version that is read.
        known: u32,
    },
    /// Not JSON, or a key of another kind.
    #[error("cannot be understood: {0}")]
    Json(String),
    /// A value that a session must not have.
    #[error("{at}: {what}")]
    Bad {
        /// Which value.
        at: String,
        /// What is wrong with it.
        what: String,
    },
    /// The file system does not give it.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The file system does not take it.
    #[error("cannot be written: {0}")]
    Unwritable(String),
}
