//! What `calibrate` and `auto` share: from a folder to a result, and from a result to files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use handeye_core::calibrate::{self, Method, Observations, ObservedView};
use handeye_core::dataset::Dataset;
use handeye_core::export::{self, ExportInput, ExportNames};
use handeye_core::progress::CancelToken;
use handeye_core::result::CalibrationResult;
use handeye_core::session::{self, Role, Session};

use super::Failure;
use crate::observe::{ObserveError, observe};

/// Name of the result in a session.
pub const RESULT_FILE: &str = session::RESULT;

/// Reads a folder, finds the target in its images and calibrates.
pub fn folder(path: &Path, method: Method) -> Result<CalibrationResult, Failure> {
    let dataset = Dataset::read(path).map_err(Failure::unusable)?;
    let cancel = cancel_on_ctrl_c();
    let mut observations = observations(&dataset, &cancel)?;
    if Session::is_session(path) {
        add_excluded(path, &mut observations)?;
    }
    let digest = dataset.input_sha256().map_err(Failure::unusable)?;
    solve(&observations, method, Some(digest), &cancel)
}

/// Captures that were taken out of the fit stand in the result as such, and in their place, as when the window solves.
fn add_excluded(folder: &Path, observations: &mut Observations) -> Result<(), Failure> {
    let session = Session::open(folder).map_err(Failure::unusable)?;
    let fitted = session.document.captures.iter().filter(|capture| capture.role == Role::Calibration);
    for (index, capture) in fitted.enumerate() {
        if capture.excluded && index <= observations.views.len() {
            let view = ObservedView {
                name: capture.image.clone(),
                base_from_tip: Some(capture.base_from_tip),
                corners: None,
                camera_from_target: None,
                in_fit: false,
            };
            observations.views.insert(index, view);
        }
    }
    Ok(())
}

/// Calibrates observations and states the result.
pub fn solve(
    observations: &Observations,
    method: Method,
    input_sha256: Option<String>,
    cancel: &CancelToken,
) -> Result<CalibrationResult, Failure> {
    let calibration = calibrate::calibrate(observations, method, cancel).map_err(Failure::failed)?;
    let options = BTreeMap::from([("method".to_owned(), serde_json::Value::from(method.name()))]);
    Ok(calibration.to_result(env!("CARGO_PKG_VERSION"), input_sha256, options))
}

/// Finds the target in every image, with a line of progress.
pub fn observations(dataset: &Dataset, cancel: &CancelToken) -> Result<Observations, Failure> {
    let progress = |done: usize, of: usize| tracing::debug!(done, of, "image");
    let observations = observe(dataset, &progress, cancel).map_err(|error| match error {
        ObserveError::Dataset(error) => Failure::unusable(error),
        other => Failure::failed(other),
    })?;
    let found = observations.views.iter().filter(|v| v.corners.is_some()).count();
    tracing::info!("target found in {found} of {} images", observations.views.len());
    Ok(observations)
}

/// Every format that the result has the data for, into a folder. Poses of images are left to `export`: their files have
/// to lie beside the images.
pub fn write_exports(folder: &Path, result: &CalibrationResult) -> Result<Vec<PathBuf>, Failure> {
    let names = ExportNames::default();
    let input = ExportInput::new(result, &names);
    let formats: Vec<_> =
        export::formats().iter().copied().filter(|format| export::preview(*format, &input).is_ok()).collect();
    let written = export::write_all(folder, &formats, &input).map_err(Failure::failed)?;
    tracing::info!("wrote {} files to {}", written.len(), folder.display());
    Ok(written)
}

/// A token that Ctrl-C cancels. A second Ctrl-C ends the process at once.
pub fn cancel_on_ctrl_c() -> CancelToken {
    let cancel = CancelToken::default();
    let shared = Arc::new(cancel.clone());
    let handler = move || {
        if shared.is_cancelled() {
            std::process::exit(130);
        }
        shared.cancel();
    };
    // A second handler in one process is refused; the first one then serves.
    if let Err(error) = ctrlc::set_handler(handler) {
        tracing::debug!(%error, "Ctrl-C is already handled");
    }
    cancel
}
