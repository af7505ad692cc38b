//! What the window shows: state of the connections, of the robot, the newest images, and how they are looked at.
//!
//! Only [`crate::app::App::apply`] and [`crate::app::App::absorb`] change a [`Model`]; panes read it. Times are seconds
//! on the clock that the application was started with.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use handeye_arm::{JointKind, JointValues};
use handeye_coppeliasim::cell::CellPaths;
use handeye_estimate::Method;
use handeye_estimate::handeye::HandEye;
use handeye_estimate::verify::Predictor;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Tip};
use handeye_plan::guided::choose::Proposal;
use handeye_session::{CaptureId, Document};

pub use crate::by_hand::state::ByHand;
pub use crate::capture::state::{
    CaptureOptions, CapturePurpose, CaptureRefused, CaptureUnderWay, CaptureWait, LiveDetection, RefusalKind,
};
pub use crate::connect::state::{Link, LinkState};
pub use crate::export::state::{ExportState, PreviewFile, Written};
pub use crate::import::state::{Found, ImportState, ImportWork};
pub use crate::live::state::{
    ColouredDepth, FrameImages, FrameInfo, ImagePoint, LiveFrame, MeasuredTwice, Overlays, PickedPoint, Viewport,
    exports_of,
};
pub use crate::messages::state::{Home, Message, Messages, Severity};
pub use crate::motion::state::{JogSettings, JogStep, Motion, MotionId, MotionRequest, PendingMove};
pub use crate::recording::state::{RerunState, ViewerState};
pub use crate::scene::view::SceneView;
pub use crate::session::state::{
    FolderEntry, FolderKind, FolderListing, Observed, PoseSequence, RecentSession, Review, SessionState, StopOutcome,
};
pub use crate::shell::state::{Dialog, Pane, Step};
pub use crate::shell::view::{DepthScale, Goal, RotationFormat, ThemeChoice, ViewSettings};
pub use crate::solve::estimated::estimated;
pub use crate::solve::state::{Corrected, JobId, SolveState, SolveStatus, Solved};
pub use crate::solve::tip_box::{BoxState, WorkBox, judge_box};
pub use crate::track::state::{BoardMotion, FollowRequest, FollowStatus, TrackError, TrackPoint, TrackState, Tracked};
pub use crate::track::trail::Trail;
pub use handeye_coppeliasim::cell::BoardPath;
pub use handeye_link::{
    ArmDoubt, Axis, CellFacts, CellSource, Drivers, Jog, JogFrame, JointFacts, MotionGoal, MotionOutcome, Moves,
    RobotState, Simulation, Truth,
};

use crate::keep_out::state::KeepOut;
use crate::motion::state::Stopping;
use crate::session::start;

/// Age \[s\] from which it is reported: of an image or a reading of the robot that should come many times a second.
pub const STALE_AFTER_S: f64 = 1.0;

/// Everything that the window shows.
#[expect(clippy::struct_excessive_bools, reason = "each is a state of its own")]
#[derive(Debug, Clone)]
pub struct Model {
    /// Whether the window is shown in browsers, on other machines than the one whose files are read and written.
    pub in_browser: bool,
    pub source: CellSource,
    /// The present time.
    pub now_s: f64,
    /// The connection for joints, tip, simulation and stop.
    pub control: LinkState,
    /// The connection for images.
    pub camera: LinkState,
    /// The connection for motions.
    pub mover: LinkState,
    /// What is known about the cell since it was connected.
    pub cell: Option<CellFacts>,
    /// What the arm does, as far as this program moves it.
    pub motion: Motion,
    /// The robot, as last reported.
    pub robot: Option<RobotState>,
    /// When that was.
    pub robot_read_s: Option<f64>,
    /// The newest images.
    pub frame: Option<LiveFrame>,
    /// Frames that arrived but were never shown, because newer ones came first.
    pub dropped_frames: u64,
    /// A stop was pressed and the robot has not confirmed it yet.
    pub stop_pending: bool,
    /// The arm was commanded to stop, and its states do not show yet that it is at rest.
    pub stopping: Option<Stopping>,
    /// The pixel under the pointer, in both images.
    pub cursor: Option<ImagePoint>,
    /// What is remembered from one start to the next.
    pub view: ViewSettings,
    /// What happened, in words.
    pub messages: Messages,
    /// Addresses that were connected to before, newest first.
    pub addresses: Vec<String>,
    /// Drivers that were connected to before, newest first.
    pub drivers: Vec<Drivers>,
    /// Where a scene other than the built-in one has the parts of the cell.
    pub objects: CellPaths,
    /// What the arm keeps out of.
    pub keep_out: KeepOut,
    /// The board in the newest image that was searched.
    pub detection: Option<LiveDetection>,
    /// When the board was last found in the live image.
    pub board_seen_s: Option<f64>,
    /// The capture that is under way.
    pub capture: Option<CaptureUnderWay>,
    /// Why there was no capture the last time.
    pub refused: Option<CaptureRefused>,
    /// The sequence that is under way, or the last one.
    pub sequence: Option<PoseSequence>,
    /// Whether that sequence is still under way.
    pub sequence_runs: bool,
    /// Whether the user has allowed a move since that sequence began or continued.
    pub let_go: bool,
    /// The move that waits until the user allows it.
    pub asked: Option<PendingMove>,
    /// Where the arm was when the cell was connected.
    pub home: Option<JointValues>,
    /// Counts the connected cells.
    pub cells: u64,
    /// The poses of a sequence are being planned.
    pub planning: bool,
    /// The user is guided from view to view.
    pub by_hand: Option<Box<ByHand>>,
    /// The recording that is being imported.
    pub import: Option<Box<ImportState>>,
    pub session: SessionState,
    /// Whether a session is being opened.
    pub opening: bool,
    /// Where new sessions go.
    pub sessions: PathBuf,
    /// What was seen in its captures; `None` for an image that cannot be read. One that is not here is being searched.
    pub observed: BTreeMap<CaptureId, Option<Arc<Observed>>>,
    /// Captures that are selected, the last one last.
    pub selection: Vec<CaptureId>,
    /// The capture whose image is shown instead of the live one.
    pub review: Option<Review>,
    /// The solver and its newest answer.
    pub solve: SolveState,
    /// Which answer is requested.
    pub method: String,
    /// Whether it uses every view and corner, also those that do not fit the others.
    pub keep_outliers: bool,
    /// The box of the workspace over which the error is stated.
    pub tip_box: BoxState,
    /// The line between good and bad residuals \[px\].
    pub outlier_line_px: Option<f64>,
    /// The point that was picked.
    pub picked: Option<PickedPoint>,
    /// The export dialog.
    pub export: ExportState,
    /// The step in front.
    pub step: Step,
    /// The dialog that is open.
    pub dialog: Option<Dialog>,
    /// What the dialogs that open and save show.
    pub folder: Option<FolderListing>,
    /// Sessions that were open before.
    pub recent: Vec<RecentSession>,
    /// The part of the images that is shown.
    pub viewport: Viewport,
    /// From where the 3D pane looks.
    pub scene: SceneView,
    /// Whether that view was fitted to the cell and the session that are here.
    pub scene_is_fitted: bool,
    /// Where the tip went.
    pub trail: Trail,
    /// The board as it is tracked, and the arm that follows it.
    pub track: TrackState,
    /// The recording for Rerun.
    pub rerun: RerunState,
}

impl Model {
    /// How a joint, counted from 0 at the base, moves, as given by the cell or else by the session. If neither does, it
    /// is revolute.
    pub fn joint_kind(&self, index: usize) -> JointKind {
        let of_cell = self.cell.as_ref().map(|cell| cell.joints.get(index).map(|joint| joint.kind));
        let of_session = || self.document().meta.joint_kinds.as_ref()?.get(index).copied();
        of_cell.unwrap_or_else(of_session).unwrap_or(JointKind::Revolute)
    }

    /// Values of all joints as displayed, each with its unit.
    pub fn joints_text(&self, joints: &[f64]) -> String {
        let reported =
            |(i, &value): (usize, &f64)| format!("{:.1}", self.joint_kind(i).quantity(value)).replace('-', "−");
        joints.iter().enumerate().map(reported).collect::<Vec<_>>().join("  ")
    }

    /// Before anything has happened.
    pub fn new(source: CellSource, view: ViewSettings) -> Self {
        let first = LinkState::first(&source);
        Self {
            in_browser: false,
            source,
            now_s: 0.0,
            control: first.clone(),
            camera: first.clone(),
            mover: first,
            cell: None,
            motion: Motion::Idle,
            robot: None,
            robot_read_s: None,
            frame: None,
            dropped_frames: 0,
            stop_pending: false,
            stopping: None,
            cursor: None,
            view,
            messages: Messages::default(),
            addresses: Vec::new(),
            drivers: Vec::new(),
            objects: CellPaths::default(),
            keep_out: KeepOut::default(),
            detection: None,
            board_seen_s: None,
            capture: None,
            refused: None,
            sequence: None,
            sequence_runs: false,
            let_go: false,
            asked: None,
            home: None,
            cells: 0,
            by_hand: None,
            import: None,
            planning: false,
            session: SessionState {
                folder: None,
                document: Arc::new(Document::new(start::meta(None, String::new()))),
                undo: None,
                redo: None,
            },
            opening: false,
            sessions: PathBuf::new(),
            observed: BTreeMap::new(),
            selection: Vec::new(),
            review: None,
            solve: SolveState::default(),
            method: Method::default().name().to_owned(),
            keep_outliers: false,
            tip_box: BoxState::default(),
            outlier_line_px: None,
            picked: None,
            export: ExportState::default(),
            step: Step::default(),
            dialog: None,
            folder: None,
            recent: Vec::new(),
            viewport: Viewport::default(),
            scene: SceneView::default(),
            scene_is_fitted: false,
            trail: Trail::default(),
            track: TrackState::default(),
            rerun: RerunState::default(),
        }
    }

    /// State of one connection.
    pub fn link(&self, link: Link) -> &LinkState {
        match link {
            Link::Control => &self.control,
            Link::Camera => &self.camera,
            Link::Motion => &self.mover,
        }
    }

    /// Age of the newest images \[s\].
    pub fn frame_age_s(&self) -> Option<f64> {
        self.frame.as_ref().map(|frame| (self.now_s - frame.info.received_s).max(0.0))
    }

    /// Whether what is known about the robot is current, and not from when it was last read.
    pub fn is_robot_live(&self) -> bool {
        let is_new = |read_s: f64| self.now_s - read_s <= STALE_AFTER_S;
        self.control.is_connected() && self.robot.is_some() && self.robot_read_s.is_none_or(is_new)
    }

    /// Whether there is something under way in this program that a stop would end.
    pub fn is_under_way(&self) -> bool {
        let follows = !matches!(self.track.follow, FollowStatus::Off | FollowStatus::Ended(_));
        self.motion != Motion::Idle || self.sequence_runs || self.planning || self.capture.is_some() || follows
    }

    /// The captures and what they are for.
    pub fn document(&self) -> &Document {
        &self.session.document
    }

    /// What was seen in a capture; `None` while it is not known, or when the image cannot be read.
    pub fn observed(&self, id: CaptureId) -> Option<&Observed> {
        self.observed.get(&id)?.as_deref()
    }

    /// The camera: as calibrated, or else from its settings.
    pub fn intrinsics(&self) -> Option<Intrinsics> {
        let calibrated = self.solve.solved.as_ref().and_then(|solved| solved.calibration.intrinsics());
        calibrated.or_else(|| self.cell.as_ref()?.nominal_intrinsics)
    }

    /// The camera on the tip, by the newest calibration; `None` without one, or for a camera next to the robot (eye to
    /// hand).
    pub(crate) fn tip_from_camera(&self) -> Option<Pose<Tip, Camera>> {
        match self.calibrated()?.hand_eye {
            HandEye::EyeInHand { tip_from_camera, .. } => Some(tip_from_camera),
            HandEye::EyeToHand { .. } => None,
        }
    }

    /// The newest calibration, for predicting and measuring.
    pub fn calibrated(&self) -> Option<&Predictor> {
        self.solve.solved.as_ref()?.calibrated.as_ref()
    }

    /// Poses that guided capture goes to, the next one first; empty while it does not run.
    pub fn planned_poses(&self) -> &[Proposal] {
        let sequence = self.sequence.as_ref().filter(|_| self.sequence_runs);
        sequence.and_then(|sequence| sequence.guided.as_deref()).map_or(&[], |guided| &guided.ahead)
    }

    /// Whether the arm may be real: anywhere but in the built-in cell, also behind an address.
    pub(crate) fn may_be_real(&self) -> bool {
        !self.source.is_built_in()
    }

    /// Whether each move of the arm to a chosen pose waits to be confirmed: as the user wants it, or else wherever the arm may be
    /// real.
    pub fn confirms_moves(&self) -> bool {
        self.view.confirm_moves.unwrap_or(self.may_be_real())
    }

    /// Share of its fastest speed at which the arm moves: as the user wants it, or else a quarter, and half in the built-in
    /// cell, because an arm behind an address may be real.
    pub fn speed(&self) -> f64 {
        let usual = if self.may_be_real() { 0.25 } else { 0.5 };
        self.view.jog.speed.unwrap_or(usual)
    }

    /// How the arm may be moved; freely as long as that is not known.
    pub fn moves(&self) -> Moves {
        self.cell.as_ref().map_or(Moves::Freely, |cell| cell.moves)
    }

    /// Whether the program may choose poses and move the arm to them, once its chain of joints is known.
    pub fn takes_chosen_poses(&self) -> bool {
        match self.moves() {
            Moves::Freely => true,
            Moves::OnceArmed { joints, .. } => {
                joints && self.cell.as_ref().is_some_and(|cell| cell.arm.is_some() || cell.arm_doubt.is_some())
            }
            Moves::Never => false,
        }
    }

    /// Whether the arm may be moved, as far as the user has to allow it.
    pub fn is_armed(&self) -> bool {
        !matches!(self.moves(), Moves::OnceArmed { .. }) || self.robot.as_ref().is_some_and(|robot| robot.is_armed)
    }

    /// How far one press of a jog button moves: a robot that only moves in steps has no button to hold.
    pub fn jog_step(&self) -> JogStep {
        match (self.view.jog.step, self.moves()) {
            (JogStep::Hold, Moves::OnceArmed { .. }) => JogStep::Step { metres: 1e-3, radians: 1_f64.to_radians() },
            (step, _) => step,
        }
    }

    /// Whether the simulation is known not to run, while the connection works.
    pub fn resting_simulation(&self) -> Option<Simulation> {
        let robot = self.robot.as_ref().filter(|_| self.control.is_connected())?;
        (robot.simulation != Simulation::Running).then_some(robot.simulation)
    }
}
