//! Errors of a session folder.

use std::path::{Path, PathBuf};

use super::edit_error::EditError;

/// An error, with its file or folder.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[error("{file}: {problem}", file = file.display())]
#[non_exhaustive]
pub struct SessionError {
    /// The file or folder.
    pub file: PathBuf,
    /// The error.
    pub problem: SessionProblem,
}

impl SessionError {
    pub(super) fn new(file: &Path, problem: SessionProblem) -> Self {
        Self { file: file.to_path_buf(), problem }
    }

    pub(super) fn unreadable(file: &Path, error: &dyn std::fmt::Display) -> Self {
        Self::new(file, SessionProblem::Unreadable(handeye_wording::one_line(error)))
    }

    pub(super) fn unwritable(file: &Path, error: &dyn std::fmt::Display) -> Self {
        Self::new(file, SessionProblem::Unwritable(handeye_wording::one_line(error)))
    }

    /// Whether a change was refused because the session is like that already.
    pub fn is_no_change(&self) -> bool {
        matches!(self.problem, SessionProblem::Edit(EditError::NoChange))
    }
}

/// The error of a session.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum SessionProblem {
    /// There is something in the folder, and it is not a session.
    #[error("is not empty and not a session, so it is not overwritten: name another folder")]
    NotEmpty,
    /// There is a session in the folder already.
    #[error("holds a session already, which is never replaced: open it, or name another folder")]
    Exists,
    /// There is neither `session.json` nor a journal.
    #[error(
        "has no session.json and no journal.jsonl: it is not a session folder; for images and a pose table \
         `handeye calibrate` prints a dataset.toml to fill in"
    )]
    NotASession,
    /// Another program has the session open.
    #[error("is open in another program: close it there first")]
    Locked,
    /// `session.json` or the journal is something else.
    #[error("is not a session: format is {0:?}")]
    Format(String),
    /// A layout that is not known here.
    #[error("has version {found:?}, this program reads version {known}: use a newer handeye")]
    Version {
        /// The value found.
        found: String,
        /// The major version that is read.
        known: u32,
    },
    /// Not JSON, or a key of another kind.
    #[error("cannot be understood: {0}")]
    Json(String),
    /// An entry of the journal is not what was written.
    #[error(
        "row {row}: {what}; bring the file back from a copy, or move it out of the folder: the session then opens as \
         session.json has it, and what was done before can no longer be undone"
    )]
    Damaged {
        /// Line of the journal as an editor counts it, from 1.
        row: u64,
        /// The error.
        what: String,
    },
    /// An entry of the journal is whole and not known here.
    #[error("row {row}: cannot be understood ({what}): use a newer handeye")]
    Unknown {
        /// Line of the journal as an editor counts it, from 1.
        row: u64,
        /// The unknown name.
        what: String,
    },
    /// `session.json` was written by a program that knows no journal, after the journal was there.
    #[error(
        "was changed by an older program that keeps no journal: move this file out of the folder to go on with the \
         journal, or move journal.jsonl out to go on with this file"
    )]
    OlderProgram,
    /// A change that the session cannot take, or a value that it must not have.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The file system does not give it.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The file system does not take it. Nothing was changed.
    #[error("cannot be written: {0}")]
    Unwritable(String),
    /// The change is recorded in the journal, and a file that follows from it could not be brought up to date.
    #[error("the change is recorded, but this file could not be brought up to date: {0}; the next change tries again")]
    Behind(String),
    /// The journal could not be written and could not be put back.
    #[error("could not be put back after a failed write, so nothing more is recorded: open the session again")]
    Broken,
}
