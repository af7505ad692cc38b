//! From observations to an examined calibration.

use super::doctor;
use super::findings::FindingOptions;
use crate::diagnose::calibration::Calibration;
use crate::handeye::HandEyeError;
use crate::{self as estimate, CalibrateError, Fit, Method, Observations, Options};
use handeye_geometry::progress::Work;

/// Calibrates from observations, and examines the answer.
///
/// `work` is a `&CancelToken`, or a [`Work`] to follow the progress too. Its requirements are those of
/// [`estimate::fit`].
///
/// # Errors
/// [`CalibrateError`] states what is missing and what to do; [`HandEyeError::Cancelled`] inside it when `work` was.
pub fn calibrate<'a>(
    observations: &Observations,
    method: Method,
    work: impl Into<Work<'a>>,
) -> Result<Calibration, CalibrateError> {
    calibrate_with(observations, method, Options::default(), &FindingOptions::default(), work)
}

/// As [`calibrate`], with options and what is wanted of the answer.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_with<'a>(
    observations: &Observations,
    method: Method,
    options: Options,
    wanted: &FindingOptions<'_>,
    work: impl Into<Work<'a>>,
) -> Result<Calibration, CalibrateError> {
    let work = work.into();
    let fit = estimate::fit_with(observations, method, options, work)?;
    examine(observations, fit, wanted, work.cancel)
}

/// Examines a fit of these observations: what contradicts it, and which error may be stated in spite of that.
///
/// # Errors
/// [`HandEyeError::Cancelled`]: half an examination states nothing.
pub fn examine<'a>(
    observations: &Observations,
    fit: Fit,
    wanted: &FindingOptions<'_>,
    work: impl Into<Work<'a>>,
) -> Result<Calibration, CalibrateError> {
    let work = work.into();
    let calibration = doctor::examined(observations, fit, wanted, &work);
    if work.is_cancelled() { Err(HandEyeError::Cancelled.into()) } else { Ok(calibration) }
}
