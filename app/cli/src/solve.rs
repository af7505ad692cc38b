//! What `calibrate` and `auto` share: from a folder to a result, and from a result to files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use handeye_dataset::template::{CHOICE, template};
use handeye_dataset::{DESCRIPTION, Dataset, DatasetError, DatasetProblem};
use handeye_estimate::diagnose::doctor::diagnose;
use handeye_estimate::diagnose::findings::{Finding, FindingCode, FindingOptions};
use handeye_estimate::handeye::{HandEyeError, Mode};
use handeye_estimate::{CalibrateError, Method, Observations, ObservedView, Options};
use handeye_export::{ExportInput, ExportNames};
use handeye_geometry::progress::CancelToken;
use handeye_result::guided_record::GuidedRecord;
use handeye_result::{CalibrationResult, ViewRecordStatus};
use handeye_session::{self as session, CaptureId, CaptureRecord, Document, Session, SessionMeta, SessionObservations};

use super::output::Output;
use super::robot_args::RobotArgs;
use super::{Failure, out};
use handeye_record::Recorder;
use handeye_workbench::model::{Goal, JobId, Observed, Solved, Step, Truth};
use handeye_workbench::observe::{ObserveError, observe, observe_session};
use handeye_workbench::recording::{Entry, Recording as _};
use handeye_workbench::report;
use handeye_workbench::session::start;
use handeye_workbench::worker::{self, SolveJob};

/// Name of the result in a session.
pub const RESULT_FILE: &str = session::RESULT;

/// The content of a folder: a session if it has a document, whatever else it contains, or a data set.
pub struct Input {
    /// The captures; those of a data set as a session would have them.
    pub document: Arc<Document>,
    /// What was observed in them.
    pub seen: SessionObservations,
    /// Digest of what the fit is made from.
    pub sha256: String,
}

/// Reads a folder and finds the target in its images.
pub fn read(folder: &Path, cancel: &CancelToken) -> Result<Input, Failure> {
    let progress = |done: usize, of: usize| tracing::debug!(done, of, "image");
    let input = if Session::is_session(folder) {
        let session = Session::open(folder).map_err(Failure::unusable)?;
        if session.document.captures.is_empty() {
            let folder = folder.display();
            return Err(Failure::unusable(anyhow!(
                "{folder} has no captures: capture the board in the window or by auto"
            )));
        }
        let seen = observe_session(&session, &progress, cancel).map_err(not_observed)?;
        let sha256 = session.input_sha256().map_err(Failure::unusable)?;
        Input { document: session.document, seen, sha256 }
    } else {
        let dataset = Dataset::read(folder).map_err(|error| not_a_data_set(folder, error))?;
        let observations = observe(&dataset, &progress, cancel).map_err(not_observed)?;
        let document = as_document(&dataset);
        let id_of = |view: &ObservedView| {
            let capture = document.captures.iter().find(|capture| capture.image == view.name);
            capture.map_or(CaptureId(0), |capture| capture.id)
        };
        let captures = observations.views.iter().map(id_of).collect();
        let sha256 = dataset.input_sha256().map_err(Failure::unusable)?;
        let (arm, robot_accuracy) = (dataset.arm_of_views().and_then(Result::ok), dataset.robot_accuracy());
        let seen = SessionObservations { observations, captures, verification: Vec::new(), arm, robot_accuracy };
        Input { document: Arc::new(document), seen, sha256 }
    };
    let views = &input.seen.observations.views;
    let found = views.iter().filter(|view| view.corners.is_some()).count();
    tracing::info!("target found in {found} of {} images", views.len());
    if !input.seen.verification.is_empty() {
        let captures = out::counted(input.seen.verification.len(), "capture is", "captures are");
        tracing::info!("{captures} for verification and not in the fit");
    }
    Ok(input)
}

fn not_observed(error: ObserveError) -> Failure {
    match error {
        ObserveError::Dataset(_) | ObserveError::Session(_) | ObserveError::OtherChessboard { .. } => {
            Failure::unusable(error)
        }
        ObserveError::Vision { .. } | ObserveError::Cancelled => Failure::failed(error),
    }
}

/// For a folder without a description, the answer is a description to fill in.
fn not_a_data_set(folder: &Path, error: DatasetError) -> Failure {
    // A file is empty if a shell creates it before the template is written into it.
    let is_undescribed = match error.problem {
        DatasetProblem::NotADataset => folder.is_dir(),
        DatasetProblem::Empty(_) => error.file == folder.join(DESCRIPTION),
        _ => false,
    };
    if !is_undescribed {
        return Failure::unusable(error);
    }
    let Some(template) = template(folder) else { return Failure::unusable(error) };
    if let Err(unprinted) = out::print(&template) {
        return unprinted;
    }
    Failure::unusable(anyhow!(
        "{} has no dataset.toml, or an empty one: the text on standard output is one with what was found; save it in the \
         folder under this name and take in what is true of the lines that begin with {:?}; of somebody's recording `handeye \
         import {}` makes a data set, and tries what the files leave open",
        folder.display(),
        CHOICE.trim_end(),
        folder.display()
    ))
}

/// The answer for a folder, with everything that led to it.
pub struct Solution {
    folder: PathBuf,
    input: Input,
    solved: Arc<Solved>,
}

impl Solution {
    /// For a folder, from what was read and found in it.
    pub fn new(folder: &Path, input: Input, mut solved: Solved) -> Self {
        solved.result.provenance.input_sha256 = Some(input.sha256.clone());
        Self { folder: folder.to_path_buf(), input, solved: Arc::new(solved) }
    }

    /// Records that its poses were chosen along the way, and why.
    pub fn guided_by(&mut self, record: Option<GuidedRecord>) {
        Arc::make_mut(&mut self.solved).result.guided = record;
    }

    /// The document that is written.
    pub fn result(&self) -> &CalibrationResult {
        &self.solved.result
    }

    /// The folder as it was given.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How many views are in the fit.
    pub fn views(&self) -> usize {
        self.result().views.iter().filter(|view| view.status == ViewRecordStatus::Used).count()
    }

    /// The whole report. It ends with a newline.
    fn report(&self) -> String {
        report::page(&self.solved)
    }

    /// Writes the JSON where requested and prints the report, unless the JSON is printed instead.
    pub fn publish(&self, json: Option<&Output>) -> Result<(), Failure> {
        if let Some(output) = json {
            let text = self.result().to_json().map_err(Failure::failed)?;
            output.write(text.as_bytes())?;
        }
        if json.is_some_and(Output::is_standard) { Ok(()) } else { out::print(&self.report()) }
    }

    /// Records captures, corners and answer.
    pub fn note(&self, recorder: &Recorder) {
        if !recorder.is_on() {
            return;
        }
        recorder.note(Entry::Step(Step::Solve));
        let (folder, document) = (Some(self.folder.clone()), Arc::clone(&self.input.document));
        recorder.note(Entry::Document { folder, document });
        let SessionObservations { observations, captures, verification, .. } = &self.input.seen;
        let fitted = captures.iter().zip(&observations.views).map(|(id, view)| (id, view.corners.clone(), view.depth));
        let verifying = verification.iter().map(|(id, view)| (id, Some(view.corners.clone()), view.depth));
        for (id, corners, depth) in fitted.chain(verifying) {
            let observed = Observed {
                corners,
                depth,
                image_size: observations.image_size,
                // Thumbnails are not shown here.
                thumbnail: Arc::default(),
            };
            recorder.note(Entry::Observed { id: *id, observed: Arc::new(observed) });
        }
        recorder.note(Entry::Solved(Arc::clone(&self.solved)));
    }
}

/// What is requested for a folder.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Which answer.
    pub method: Method,
    /// The changed options.
    pub options: Options,
    /// The error (95 %) to reach, metres.
    pub goal_m: f64,
    /// What is stated about the robot, overriding what the folder states.
    pub robot: RobotArgs,
}

/// Reads a folder, finds the target in its images, calibrates, and checks the answer on the captures that are kept for it; the
/// truth is only used for comparison.
pub fn folder(path: &Path, wanted: Wanted, truth: Option<Truth>, cancel: &CancelToken) -> Result<Solution, Failure> {
    let mut input = read(path, cancel)?;
    let Wanted { method, options, goal_m, robot } = wanted;
    robot.put_into(&mut input.seen, &input.document);
    let job = SolveJob { goal_m, truth, ..job(&input, method, options) };
    let solved =
        worker::answer(&job, cancel.into()).map_err(|error| unsolved(error, path, &input.seen.observations, cancel))?;
    Ok(Solution::new(path, input, solved))
}

/// The job for a folder that was read.
pub fn job(input: &Input, method: Method, options: Options) -> SolveJob {
    let SessionObservations { observations, captures, verification, arm, robot_accuracy } = input.seen.clone();
    let (id, goal_m, truth) = (JobId(0), Goal::default().0, None);
    SolveJob { id, observations, captures, verification, method, options, goal_m, arm, robot_accuracy, truth }
}

/// If there is no answer the data may be at fault: a wrong convention of the poses is reported at once, the rest by the
/// doctor.
pub fn unsolved(error: CalibrateError, folder: &Path, observations: &Observations, cancel: &CancelToken) -> Failure {
    match error {
        CalibrateError::HandEye(HandEyeError::Cancelled) => Failure::failed(error),
        error => match misread(observations, cancel) {
            Some(why) => Failure::failed(anyhow!("{error}: {why}")),
            None => Failure::failed(anyhow!("{error}; `handeye doctor {}` examines the data", folder.display())),
        },
    }
}

/// A message that the poses were written differently than stated, in another unit or direction, if they were.
fn misread(observations: &Observations, cancel: &CancelToken) -> Option<String> {
    let findings = diagnose(observations, &FindingOptions::default(), cancel).findings;
    let is_so = |finding: &&Finding| {
        matches!(
            finding.code,
            FindingCode::WrongLengthUnit
                | FindingCode::WrongAngleUnit
                | FindingCode::WrongQuaternionOrder
                | FindingCode::InvertedPoses
                | FindingCode::WrongMode
                | FindingCode::InvertedTargetPoses
                | FindingCode::ShiftedPoses
        )
    };
    findings.iter().find(is_so).map(ToString::to_string)
}

/// A data set as a session would have it.
fn as_document(dataset: &Dataset) -> Document {
    let mut document = Document::new(SessionMeta {
        mode: dataset.mode.unwrap_or(Mode::EyeInHand),
        target: dataset.target,
        camera: dataset.camera,
        tool_m: dataset.tool_m,
        robot_accuracy_mm: dataset.robot_accuracy_mm,
        ..start::meta(None, String::new())
    });
    for (entry, number) in dataset.entries.iter().zip(1..) {
        document.captures.push(CaptureRecord::new(CaptureId(number), entry.name.clone(), entry.base_from_tip));
    }
    document
}

/// Every format that the result has the data for, into a folder. Poses of images are left to `export`: their files have
/// to be next to the images.
pub fn write_exports(folder: &Path, result: &CalibrationResult) -> Result<Vec<PathBuf>, Failure> {
    let names = ExportNames::default();
    let input = ExportInput::new(result, &names);
    let formats: Vec<_> = handeye_export::formats()
        .iter()
        .copied()
        .filter(|format| handeye_export::preview(*format, &input).is_ok())
        .collect();
    let written = handeye_export::write_all(folder, &formats, &input).map_err(Failure::failed)?;
    tracing::info!("wrote {} to {}", out::counted(written.len(), "file", "files"), folder.display());
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
    // A second handler in one process is refused; the first one is then used.
    if let Err(error) = ctrlc::set_handler(handler) {
        tracing::debug!(%error, "Ctrl-C is already handled");
    }
    cancel
}
