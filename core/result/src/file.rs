//! The document as text and as a file.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{BadResult, CalibrationResult, FORMAT, VERSION};
use handeye_files::json_text;
use handeye_wording::one_line;

/// Why a result file could not be read or written.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[error("{file}: {problem}", file = file.display())]
#[non_exhaustive]
pub struct ResultError {
    /// The file that was read or written.
    pub file: PathBuf,
    /// The error.
    pub problem: ResultProblem,
}

/// What is wrong with a result.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum ResultProblem {
    /// The file system does not give it.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The file system does not take it.
    #[error("cannot be written: {0}")]
    Unwritable(String),
    /// Not JSON, or a key of another kind.
    #[error("is not a calibration result: {0}")]
    Json(String),
    /// Another document.
    #[error("is not a calibration result: format is {0:?}, not {FORMAT:?}")]
    Format(String),
    /// A layout that is not known here.
    #[error("has version {0}, this program reads version {VERSION}: use a newer handeye, or solve again")]
    Version(u64),
    /// A value that a result must not have.
    #[error("{0}")]
    Bad(#[from] BadResult),
}

#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: String,
    #[serde(default)]
    version: u64,
}

impl CalibrationResult {
    /// The document as JSON with every digit that a number has.
    ///
    /// # Errors
    /// [`ResultProblem::Bad`] when a value must not be: a NaN would silently become `null`.
    pub fn to_json(&self) -> Result<String, ResultProblem> {
        self.check()?;
        json_text::pretty(self).map_err(|e| ResultProblem::Json(one_line(&e)))
    }

    /// The document from JSON, checked. Keys that are not known here are ignored.
    ///
    /// # Errors
    /// [`ResultProblem`] for another document, another version, or a value that must not be.
    pub fn from_json(text: &str) -> Result<Self, ResultProblem> {
        let json_error = |e: serde_json::Error| ResultProblem::Json(one_line(&e));
        let header: Header = serde_json::from_str(text).map_err(json_error)?;
        if header.format != FORMAT {
            return Err(ResultProblem::Format(header.format.chars().take(40).collect()));
        }
        if header.version != u64::from(VERSION) {
            return Err(ResultProblem::Version(header.version));
        }
        let result: Self = serde_json::from_str(text).map_err(json_error)?;
        result.check()?;
        Ok(result)
    }

    /// Reads a result file.
    ///
    /// # Errors
    /// [`ResultError`] names the file and what is wrong with it.
    pub fn read(file: &Path) -> Result<Self, ResultError> {
        fs::read_to_string(file)
            .map_err(|e| ResultProblem::Unreadable(one_line(&e)))
            .and_then(|text| Self::from_json(&text))
            .map_err(|problem| ResultError { file: file.to_path_buf(), problem })
    }

    /// Writes a result file so that it is there completely or not at all.
    ///
    /// # Errors
    /// [`ResultError`]; what was there before is then still there.
    #[cfg(feature = "writing")]
    pub fn write(&self, file: &Path) -> Result<(), ResultError> {
        self.to_json()
            .and_then(|text| {
                handeye_files::atomic_file::write(file, text.as_bytes())
                    .map_err(|e| ResultProblem::Unwritable(one_line(&e)))
            })
            .map_err(|problem| ResultError { file: file.to_path_buf(), problem })
    }
}
