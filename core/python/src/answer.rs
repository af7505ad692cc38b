//! Calibrations and diagnoses, as the documents that the command line writes.

use handeye_estimate::diagnose::doctor::{self, Detail};
use handeye_estimate::diagnose::findings::Finding;
use handeye_estimate::diagnose::{Calibration, calibrate_with};
use handeye_estimate::handeye::HandEyeError;
use handeye_estimate::{CalibrateError, Method, Options};
use handeye_result::{CalibrationResult, TARGET_OPTION, solve_options};
use pyo3::prelude::*;
use serde_json::Value;

use crate::background::run;
use crate::error::Failure;
use crate::input::Observations;

/// Not part of the result contract: the disagreement of pose pairs per axis, metres and radians.
type PairSigmas = Option<(f64, f64)>;

/// RMS distance \[m\] between reported poses and those of the arm, where these are not its poses: it is then not corrected.
type OtherChain = Option<f64>;

/// The result document as JSON, the disagreement of pose pairs, and whether the controller uses another arm.
#[pyfunction]
#[pyo3(signature = (observations, method, keep_outliers, free_scale, goal_mm, progress))]
pub fn calibrate(
    py: Python<'_>,
    observations: &Bound<'_, Observations>,
    method: &str,
    keep_outliers: bool,
    free_scale: bool,
    goal_mm: Option<f64>,
    progress: Option<&Bound<'_, PyAny>>,
) -> Result<(String, PairSigmas, OtherChain), Failure> {
    let method = method_by_name(method)?;
    let options = Options { keep_outliers, free_scale };
    let observations = observations.get();
    // A folder is calibrated without an arm that does not fit, as on the command line; who gives one with arrays means it.
    if let (None, Some(Err(why))) = (&observations.folder, &observations.arm) {
        return Err(why.clone().into());
    }
    let (mut result, sigmas, other_chain) = run(py, progress, |work| {
        let observed = &observations.observed;
        let wanted = observations.wanted(goal_mm);
        let calibration = calibrate_with(observed, method, options, &wanted, work)?;
        let (result, other_chain) = document(observations, &calibration, method, options);
        Ok((result, calibration.pose_fit.map(|fit| (fit.sigma_m, fit.sigma_rad)), other_chain))
    })?;
    result.provenance.input_sha256 = observations.folder.as_ref().map(|folder| folder.input_sha256(py)).transpose()?;
    Ok((result.to_json().map_err(|error| Failure::NoAnswer(error.to_string()))?, sigmas, other_chain))
}

/// Diagnosis of the data: JSON, the page of text, and whether no problem was found.
#[pyfunction]
pub fn diagnose(
    py: Python<'_>,
    observations: &Bound<'_, Observations>,
    goal_mm: Option<f64>,
    progress: Option<&Bound<'_, PyAny>>,
) -> Result<(String, String, bool), Failure> {
    let observations = observations.get();
    run(py, progress, |work| {
        let observed = &observations.observed;
        let wanted = observations.wanted(goal_mm);
        let diagnosis = match calibrate_with(observed, Method::Joint, Options::default(), &wanted, work) {
            Ok(calibration) => calibration.into_diagnosis(),
            Err(CalibrateError::HandEye(HandEyeError::Cancelled)) => return Err(HandEyeError::Cancelled.into()),
            // The diagnosis explains why there is no calibration.
            Err(_) => doctor::diagnose(observed, &wanted, work.cancel),
        };
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled.into());
        }
        let json = serde_json::to_string_pretty(&diagnosis).map_err(|error| Failure::NoAnswer(error.to_string()))?;
        Ok((json, diagnosis.report(Detail::Found), diagnosis.is_healthy()))
    })
}

fn method_by_name(name: &str) -> Result<Method, Failure> {
    Method::by_name(name)
        .ok_or_else(|| Failure::Input(format!("no method {name:?}: choose from {}", Method::names().join(", "))))
}

fn document(
    observations: &Observations,
    calibration: &Calibration,
    method: Method,
    options: Options,
) -> (CalibrationResult, OtherChain) {
    let mut reported = solve_options(method, options, &observations.observed.target);
    if !observations.target_is_known {
        reported.insert(TARGET_OPTION.to_owned(), Value::Null);
    }
    let mut result = CalibrationResult::of(calibration, env!("CARGO_PKG_VERSION"), None, reported);
    result.findings = calibration.diagnosis().findings.iter().map(Finding::to_record).collect();
    let other_chain = observations.arm().and_then(|arm| {
        let is_its_own = result.state_arm(calibration, arm);
        (!is_its_own).then(|| arm.placement.rms_m())
    });
    (result, other_chain)
}
