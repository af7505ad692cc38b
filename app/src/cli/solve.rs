//! What `calibrate` and `auto` share: from a folder to a result, and from a result to files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use handeye_core::calibrate::{Method, Observations, ObservedView, Options};
use handeye_core::dataset::Dataset;
use handeye_core::export::{self, ExportInput, ExportNames};
use handeye_core::handeye::Mode;
use handeye_core::progress::CancelToken;
use handeye_core::result::CalibrationResult;
use handeye_core::session::{self, CaptureId, CaptureRecord, Document, Role, Session, SessionMeta};

use super::Failure;
use crate::model::{Goal, JobId, Observed, Solved, Step, Truth};
use crate::observe::{ObserveError, observe};
use crate::rerun_log::{Entry, Recorder};
use crate::worker::{self, SolveJob};

/// Name of the result in a session.
pub const RESULT_FILE: &str = session::RESULT;

/// The answer for a folder, with all that led to it.
pub struct Solution {
    folder: PathBuf,
    document: Arc<Document>,
    observations: Observations,
    solved: Arc<Solved>,
}

impl Solution {
    /// The document that is written.
    pub fn result(&self) -> &CalibrationResult {
        &self.solved.result
    }

    /// Records captures, corners and answer.
    pub fn note(&self, recorder: &Recorder) {
        if !recorder.is_on() {
            return;
        }
        recorder.note(Entry::Step(Step::Solve));
        let (folder, document) = (Some(self.folder.clone()), Arc::clone(&self.document));
        recorder.note(Entry::Document { folder, document });
        for (view, id) in self.observations.views.iter().zip(&self.solved.captures) {
            let observed = Observed {
                corners: view.corners.clone(),
                image_size: self.observations.image_size,
                // Nobody looks at small copies here.
                thumbnail: Arc::default(),
            };
            recorder.note(Entry::Observed { id: *id, observed: Arc::new(observed) });
        }
        recorder.note(Entry::Solved(Arc::clone(&self.solved)));
    }
}

/// Reads a folder, finds the target in its images and calibrates. The truth is only compared with.
pub fn folder(
    path: &Path,
    method: Method,
    options: Options,
    truth: Option<Truth>,
    cancel: &CancelToken,
) -> Result<Solution, Failure> {
    let dataset = Dataset::read(path).map_err(Failure::unusable)?;
    let mut observations = observations(&dataset, cancel)?;
    let document = if Session::is_session(path) {
        let session = Session::open(path).map_err(Failure::unusable)?;
        add_excluded(&session.document, &mut observations);
        session.document
    } else {
        Arc::new(as_document(&dataset))
    };
    let digest = dataset.input_sha256().map_err(Failure::unusable)?;
    let id_of = |view: &ObservedView| {
        let capture = document.captures.iter().find(|capture| capture.image == view.name);
        capture.map_or(CaptureId(0), |capture| capture.id)
    };
    let job = SolveJob {
        id: JobId(0),
        captures: observations.views.iter().map(id_of).collect(),
        observations,
        verification: Vec::new(),
        method,
        options,
        goal_m: Goal::default().0,
        truth,
    };
    let mut solved = worker::answer(&job, cancel.into()).map_err(Failure::failed)?;
    solved.result.provenance.input_sha256 = Some(digest);
    let SolveJob { observations, .. } = job;
    Ok(Solution { folder: path.to_path_buf(), document, observations, solved: Arc::new(solved) })
}

/// A data set as a session would have it.
fn as_document(dataset: &Dataset) -> Document {
    let mut document = Document::new(SessionMeta {
        created: String::new(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        mode: dataset.mode.unwrap_or(Mode::EyeInHand),
        target: dataset.target,
        camera: dataset.camera,
        seeds: BTreeMap::new(),
        ground_truth: None,
        arm: None,
    });
    for (entry, number) in dataset.entries.iter().zip(1..) {
        let Some(base_from_tip) = entry.base_from_tip else { continue };
        document.captures.push(CaptureRecord {
            id: CaptureId(number),
            image: entry.name.clone(),
            depth: None,
            base_from_tip,
            joints_rad: None,
            sim_time_s: None,
            role: Role::Calibration,
            excluded: false,
            frames: 1,
            corner_noise_px: None,
            settled_s: None,
            pose_name: None,
        });
    }
    document
}

/// Captures that were taken out of the fit stand in the result as such, and in their place, as when the window solves.
pub fn add_excluded(document: &Document, observations: &mut Observations) {
    let fitted = document.captures.iter().filter(|capture| capture.role == Role::Calibration);
    for (index, capture) in fitted.enumerate() {
        if capture.excluded && index <= observations.views.len() {
            let view = ObservedView {
                name: capture.image.clone(),
                base_from_tip: Some(capture.base_from_tip),
                corners: None,
                tip_by_joint: Vec::new(),
                camera_from_target: None,
                in_fit: false,
            };
            observations.views.insert(index, view);
        }
    }
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
