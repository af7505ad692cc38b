//! What the user wants and what the workers report, as plain data that can be logged and replayed.

use std::collections::BTreeSet;
use std::panic::Location;
use std::path::PathBuf;
use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::CellPaths;
use handeye_dataset::CameraInput;
use handeye_dataset::taught_poses::TaughtPose;
use handeye_estimate::handeye::Mode;
use handeye_export::ExportNames;
use handeye_geometry::depth::ColourMap;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::Stage;
use handeye_geometry::targets::TargetSpec;
use handeye_plan::Surroundings;
use handeye_plan::surroundings::KeepOutFile;
use handeye_print::Page;
use handeye_session::CaptureId;
use serde::{Deserialize, Serialize};

use crate::by_hand::state::HandChoice;
use crate::guided::state::ChoiceOutcome;
use crate::model::{
    BoardMotion, CaptureOptions, CapturePurpose, CaptureRefused, CaptureWait, CellFacts, CellSource, Converted,
    DepthScale, Dialog, FolderListing, FollowStatus, FollowWish, Found, FrameImages, FrameInfo, ImagePoint, ImportWork,
    JobId, Jog, JogSettings, Link, LinkState, LiveDetection, MotionGoal, MotionId, MotionOutcome, Observed, Overlays,
    Pane, Preview, RecentSession, RerunState, RobotState, RotationFormat, SceneView, SessionState, Severity, Solved,
    Step, ThemeChoice, Tracked, Viewport, WorkBox, Written,
};
use crate::text::{Language, Text};

/// What the user wants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Have the arm stay where it is, now.
    Stop,
    /// Let simulated time advance.
    StartSimulation,
    /// Try to connect now, without waiting for the next try.
    Reconnect,
    /// Start drivers that are gone no more, until [`Command::Reconnect`].
    StopTrying,
    /// Light or dark.
    SetTheme(ThemeChoice),
    /// How rotations are written.
    SetRotationFormat(RotationFormat),
    /// Which depths the colour map covers.
    SetDepthScale(DepthScale),
    /// Of all words.
    SetLanguage(Language),
    /// The pointer is over a pixel of the images, or over none.
    PointAt(Option<ImagePoint>),
    /// Move the arm to a place, which the words name.
    Move {
        /// Where to.
        goal: MotionGoal,
        /// In words.
        what: Text,
    },
    /// A jog button is pressed: one step, or the beginning of holding it.
    Jog(Jog),
    /// It is still held. The arm stops by itself when this does not come.
    JogHeld(Jog),
    /// It was released.
    JogReleased,
    /// The target of the recording that is imported, as it is typed; empty: as its files have it.
    SetImportTarget(String),
    /// Read the files of the recording again, for so many seconds at the most.
    SetImportTime(u32),
    /// A convention of that recording, which the data need not tell.
    FixConvention {
        /// Its key, as `handeye import --set` has it.
        key: String,
        /// Its value; `None`: as the data tell.
        value: Option<String>,
    },
    /// Take this hypothesis about the recording, by its place in the list.
    ChooseHypothesis(usize),
    /// Make a session of the recording.
    ConvertRecording,
    /// Makes a session of the images alone, to calibrate the camera by itself.
    ConvertImages,
    /// How the tip is jogged.
    SetJog(JogSettings),
    /// Take a capture as soon as robot and image have settled.
    Capture(CapturePurpose),
    /// Not now.
    CancelCapture,
    /// How captures are taken.
    SetCaptureOptions(CaptureOptions),
    /// Work with another cell.
    Connect(CellSource),
    /// Let a robot behind a driver be moved from here, or no longer.
    Arm(bool),
    /// The pose that the robot's pendant shows, where nothing reports it.
    TypePose(Pose<Base, Tip>),
    /// Say where the scene has the parts of the cell, and connect again.
    SetObjects(CellPaths),
    /// The boxes that the arm keeps out of are these.
    SetKeepOut(Box<KeepOutFile>),
    /// Read them from a file.
    ImportKeepOut(PathBuf),
    /// Write them to a file.
    ExportKeepOut(PathBuf),
    /// Which step of the work is in front.
    GoToStep(Step),
    /// Which dialog is open.
    SetDialog(Option<Dialog>),
    /// A message needs no more attention.
    DismissMessage(u64),
    /// What is drawn over the images.
    SetOverlays(Overlays),
    /// Which part of the images is shown, and how large.
    SetViewport(Viewport),
    /// From where the 3D pane looks.
    SetSceneView(SceneView),
    /// The colours of depths.
    SetDepthColours(ColourMap),
    /// Remember the place of the arm as a taught pose.
    Teach {
        /// Its name; one is found when there is none.
        name: Option<String>,
    },
    /// Forget a taught pose.
    RemoveTaught(String),
    /// Call a taught pose something else.
    RenameTaught {
        /// Its name now.
        from: String,
        /// Its name afterwards.
        to: String,
    },
    /// Visit a taught pose earlier or later.
    ReorderTaught {
        /// Which.
        name: String,
        /// Its place afterwards, counted from 0.
        to: usize,
    },
    /// The ten reference poses instead of those that are taught.
    TeachReference,
    /// Take the taught poses of other cells for those of this one.
    AdoptTaught,
    /// Taught poses from a file, after those that are there.
    ImportTaught(PathBuf),
    /// Taught poses into a file.
    ExportTaught(PathBuf),
    /// Move to a taught pose.
    GoToTaught(String),
    /// Move to where a capture was taken.
    GoToCapture(CaptureId),
    /// Visit all taught poses.
    RunSequence {
        /// What is captured at each; `None` only moves.
        purpose: Option<CapturePurpose>,
    },
    /// Go on with the sequence that was broken off, at the pose at which it was.
    ContinueSequence,
    /// Move to where the arm stood when the cell was connected.
    GoHome,
    /// Start the built-in cell again.
    ResetCell,
    /// Choose poses, visit them and capture there until the goal is reached.
    CalibrateForMe,
    /// Let the arm make the move that waits for it.
    ConfirmMove,
    /// Leave out the move that waits; a sequence goes on with another pose.
    SkipMove,
    /// Whether each move to a chosen pose waits to be confirmed.
    SetConfirmMoves(bool),
    /// Say how the board is to look in the image, and capture when it does, until the goal is reached: for an arm that a
    /// person moves.
    GuideByHand,
    /// Leave out the view that is wanted, and ask for another one.
    SkipView,
    /// No more views.
    StopGuiding,
    /// Have poses planned that are not in the fit, visit them, and capture for verification at each.
    VerifyAtPlanned,
    /// No more poses.
    StopSequence,
    /// Which captures are selected; the last one's image is shown.
    Select(Vec<CaptureId>),
    /// Show the live image again.
    BackToLive,
    /// Take captures out of the fit, or back in.
    SetExcluded {
        /// Which.
        ids: Vec<CaptureId>,
        /// Out.
        excluded: bool,
    },
    /// Captures enter the fit or verify it.
    SetPurpose {
        /// Which.
        ids: Vec<CaptureId>,
        /// What they are for.
        purpose: CapturePurpose,
    },
    /// Delete captures; undo brings them back.
    Delete(Vec<CaptureId>),
    /// Take the last change of the session back.
    Undo,
    /// Make the change again that was taken back.
    Redo,
    /// Another target.
    SetTarget(TargetSpec),
    /// Write the target for a printer, on such a page.
    PrintTarget(Page),
    /// The camera sits elsewhere.
    SetMode(Mode),
    /// What is known of the camera.
    SetCamera(Option<CameraInput>),
    /// Solve again.
    Solve,
    /// Stop solving.
    CancelSolve,
    /// Which answer is asked for, by its name.
    SetMethod(String),
    /// Whether views and corners that do not fit the others stay in the answer.
    SetKeepOutliers(bool),
    /// The box of the workspace over which the error is stated; `None` is that about the target.
    SetTipBox(Option<WorkBox>),
    /// The error that is good enough \[m\].
    SetGoal(f64),
    /// Where the line between good and bad residuals is \[px\]; `None` takes it away.
    SetOutlierLine(Option<f64>),
    /// Measure the point at a pixel of the image in base coordinates.
    Pick(Option<ImagePoint>),
    /// Which formats are exported.
    ChooseFormats(BTreeSet<String>),
    /// The format whose text is shown.
    ShowFormat(Option<String>),
    /// Names of frames and files.
    SetExportNames(ExportNames),
    /// Where exports go; `None` is `exports` in the session.
    SetExportFolder(Option<PathBuf>),
    /// Write the chosen formats.
    Export,
    /// Begin a session, in a folder or under the folder of sessions.
    NewSession(Option<PathBuf>),
    /// Go on with a session, or copy a data set into one.
    Open(PathBuf),
    /// Copy the recorded sample that comes with the program into a session.
    OpenSample,
    /// Go on with a complete copy in another folder.
    SaveAs(PathBuf),
    /// Read the folders in a folder.
    ListFolder(PathBuf),
    /// Show a folder in the file manager of the system.
    OpenFolder(PathBuf),
    /// Track the board in every image, or no more.
    SetTracking(bool),
    /// Have the arm follow the board; `None` has it come to rest.
    SetFollow(Option<FollowWish>),
    /// Have the simulated cell move its board.
    MoveBoard(BoardMotion),
    /// Hide the board of the simulated cell, or show it again.
    HideBoard(bool),
    /// Look at the recording in Rerun.
    OpenRerun,
    /// Bring a pane to the front.
    ShowPane(Pane),
    /// Put every pane where it was at first.
    ResetLayout,
}

/// What happened outside the thread of the window.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// Time has passed.
    Tick {
        /// The present time.
        now_s: f64,
    },
    /// A connection is in another state.
    Link {
        /// Which one.
        link: Link,
        /// How it is now.
        state: LinkState,
    },
    /// The robot was read.
    Robot(RobotState),
    /// Nobody says any more where the robot is.
    NoRobot,
    /// New images.
    Frame {
        /// Their circumstances.
        info: FrameInfo,
        /// Frames so far that were never shown.
        dropped: u64,
        /// The pixels, which a log does not keep.
        #[serde(skip)]
        images: Option<Arc<FrameImages>>,
    },
    /// The arm was told to stay where it is.
    Stopped,
    /// A cell was connected.
    Cell(Box<CellFacts>),
    /// A driver said something for people.
    Heard {
        /// How much it matters.
        severity: Severity,
        /// Its name and its words.
        words: String,
    },
    /// A motion has ended.
    Moved {
        /// Which one.
        id: MotionId,
        /// How.
        outcome: MotionOutcome,
    },
    /// The next pose of a guided sequence was chosen, or cannot be.
    #[serde(skip)]
    Guided {
        /// The number of the request.
        id: MotionId,
        /// What was chosen.
        outcome: ChoiceOutcome,
    },
    /// The next view for an arm that a person moves was chosen, or cannot be.
    #[serde(skip)]
    ViewChosen {
        /// The number of the request.
        number: u64,
        /// What was chosen.
        choice: Box<HandChoice>,
    },
    /// Poses to look at the board from were planned, or cannot be.
    Planned {
        /// The number of the request.
        id: MotionId,
        /// The joints at each \[rad\]; or why there are none.
        views: Result<Vec<JointValues>, Text>,
    },
    /// A held jog button can do no more, or may not: the arm stands.
    JogEnded {
        /// Why, when it was not released.
        why: Option<Text>,
    },
    /// The newest image was searched for the board.
    #[serde(skip)]
    Detection(Box<LiveDetection>),
    /// The capture that is under way waits for something else.
    CaptureWaits {
        /// Its number.
        number: u64,
        /// For what.
        wait: CaptureWait,
    },
    /// There is no capture.
    CaptureRefused {
        /// Its number.
        number: u64,
        /// Why.
        refused: CaptureRefused,
    },
    /// The session is now like this, on the disk.
    Document(Box<SessionState>),
    /// Another session is open.
    SessionOpened {
        /// Whether its folder has files of exports that are younger than its last change.
        exported: bool,
    },
    /// A session could not be begun, opened or copied.
    SessionFailed {
        /// Why.
        why: Text,
    },
    /// There is neither a session nor a data set: it may be somebody's recording.
    NoSession(PathBuf),
    /// How far a recording is looked at, or converted.
    ImportProgress {
        /// The number of the request.
        number: u64,
        /// How far.
        work: ImportWork,
    },
    /// A recording was looked at.
    #[serde(skip)]
    RecordingLooked {
        /// The number of the request.
        number: u64,
        /// What was found; `None` where its files cannot be read.
        found: Option<Arc<Found>>,
        /// Why no more was.
        trouble: Option<Text>,
    },
    /// A recording was made a data set, or cannot be.
    #[serde(skip)]
    RecordingConverted {
        /// The number of the request.
        number: u64,
        /// The data set.
        converted: Result<Arc<Converted>, Text>,
    },
    /// A capture is on the disk.
    Captured {
        /// The number of the request.
        number: u64,
        /// Its number in the session.
        id: CaptureId,
    },
    /// A capture was looked at.
    Observed {
        /// Which.
        id: CaptureId,
        /// What was looked for.
        target: TargetSpec,
        /// What was seen; `None` when the image cannot be read.
        #[serde(skip)]
        observed: Option<Arc<Observed>>,
    },
    /// The images of a capture were read.
    Review {
        /// Which capture.
        id: CaptureId,
        /// The pixels, which a log does not keep.
        #[serde(skip)]
        images: Option<Arc<FrameImages>>,
    },
    /// A solve goes on.
    SolveProgress {
        /// Which.
        job: JobId,
        /// What it does.
        stage: Stage,
        /// How much of that is done, 0 to 1.
        part: f64,
    },
    /// A solve has ended.
    #[serde(skip)]
    SolveEnded {
        /// Which.
        job: JobId,
        /// How.
        outcome: SolveOutcome,
    },
    /// Folders were read.
    Folder(FolderListing),
    /// The text of every format.
    Previews(Vec<(String, Preview)>),
    /// Exports were written, or not.
    Exported(Written),
    /// What the cell says stands around, now that the arm keeps out of the boxes, too; or why it does not.
    #[serde(skip)]
    Standing(Result<Arc<Surroundings>, Text>),
    /// Boxes to keep out of, from a file.
    KeepOutRead(Box<KeepOutFile>),
    /// Taught poses were read from a file.
    PosesRead {
        /// Them.
        poses: Vec<TaughtPose>,
    },
    /// Sessions that were open before.
    Recent(Vec<RecentSession>),
    /// The board in the newest image that was tracked.
    #[serde(skip)]
    Tracked(Arc<Tracked>),
    /// The board is tracked no more.
    TrackFailed {
        /// Why, and what to do.
        why: Text,
    },
    /// The arm follows the board, or does not.
    #[serde(skip)]
    Follow(FollowStatus),
    /// The recording is in another state.
    Rerun(RerunState),
    /// The web viewer is served, and the system has no browser to show it.
    NoBrowser,
    /// Something to tell the user.
    Notice {
        /// How much it matters.
        severity: Severity,
        /// The words.
        text: Text,
    },
}

/// How a solve ended.
#[derive(Debug, Clone)]
pub enum SolveOutcome {
    /// With an answer.
    Solved(Arc<Solved>),
    /// Without one, and this is why.
    Failed(Text),
    /// It was cancelled.
    Cancelled,
}

/// Collects the commands of one frame of the window. They are applied after it is drawn.
#[derive(Debug, Default)]
pub struct Outbox {
    commands: Vec<(Command, &'static Location<'static>)>,
}

impl Outbox {
    /// Asks for a command, which remembers the place in the code that asked.
    #[track_caller]
    pub fn send(&mut self, command: Command) {
        self.commands.push((command, Location::caller()));
    }

    /// Whether nobody asked for anything.
    pub fn is_empty(&self) -> bool {
        self.commands.is_empty()
    }

    /// The commands in the order in which they were asked for.
    pub fn drain(&mut self) -> impl Iterator<Item = (Command, &'static Location<'static>)> + '_ {
        self.commands.drain(..)
    }
}
