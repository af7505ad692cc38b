//! Failures as the exceptions of the Python module.

use handeye_estimate::CalibrateError;
use handeye_estimate::handeye::HandEyeError;
use handeye_estimate::placement::PlacementError;
use pyo3::PyErr;

/// The classes, which are Python's.
mod python {
    pyo3::import_exception!(handeye._errors, InputError);
    pyo3::import_exception!(handeye._errors, CalibrationError);
}

/// Why a call has no answer.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The given input cannot be used.
    #[error("{0}")]
    Input(String),
    /// It can be used, and has no answer.
    #[error("{0}")]
    NoAnswer(String),
    /// Python raised something on the way, such as KeyboardInterrupt.
    #[error(transparent)]
    Python(#[from] PyErr),
}

impl Failure {
    /// An error of the given input.
    pub fn input(error: impl ToString) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<CalibrateError> for Failure {
    fn from(error: CalibrateError) -> Self {
        match error {
            CalibrateError::NothingObserved { .. } => Self::input(error),
            error => Self::NoAnswer(error.to_string()),
        }
    }
}

impl From<PlacementError> for Failure {
    fn from(error: PlacementError) -> Self {
        match error {
            PlacementError::NotPlaced(_) => Self::NoAnswer(error.to_string()),
            error => Self::input(error),
        }
    }
}

impl From<HandEyeError> for Failure {
    fn from(error: HandEyeError) -> Self {
        Self::NoAnswer(error.to_string())
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Input(message) => python::InputError::new_err(message),
            Failure::NoAnswer(message) => python::CalibrationError::new_err(message),
            Failure::Python(error) => error,
        }
    }
}
