//! What the window shows: state of the connections, of the robot, the newest pictures, and how they are looked at.
//!
//! Only [`crate::gui::App::apply`] and [`crate::gui::App::absorb`] change a [`Model`]; panes read it. Times are seconds
//! on the clock that the application was started with.

mod capture;
mod motion;

use std::fmt;
use std::sync::Arc;

use handeye_core::depth::{ColourMap, DepthImage, DepthSample};
use handeye_core::frames::{Base, Pose, Tip};
use handeye_core::image::RgbImage;
use handeye_sim_link::client::cell::JointAngles;
use serde::{Deserialize, Serialize};

pub use capture::{
    CaptureOptions, CapturePurpose, CaptureRefused, CaptureUnderWay, CaptureWait, LiveDetection, RefusalKind,
};
pub use motion::{
    Axis, CellFacts, Jog, JogFrame, JogSettings, JogStep, Motion, MotionGoal, MotionId, MotionOutcome, MotionRequest,
    Truth,
};

use crate::text::{Language, Text};

/// How depths are coloured, in pictures and in the bar that explains them.
pub const DEPTH_COLOURS: ColourMap = ColourMap::Turbo;

/// Which cell the window works with.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum CellSource {
    /// The cell inside this program, started by it.
    BuiltIn,
    /// A server that runs already.
    Address(String),
}

/// The connections to the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Link {
    /// Joints, tip, simulation, stop.
    Control,
    /// Pictures.
    Camera,
    /// Motions.
    Motion,
}

/// How a connection is doing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum LinkState {
    /// The built-in cell is being started.
    StartingCell {
        /// Why the last try failed.
        why: Option<String>,
    },
    /// It has never been connected yet.
    Searching {
        /// Where a server is expected.
        address: String,
        /// How many times it was tried, this one included.
        attempt: u32,
        /// Why the last try failed.
        why: Option<String>,
    },
    /// It works.
    Connected {
        /// Where the server is.
        address: String,
        /// What it is, for example `CoppeliaSim 4.10.0`.
        server: String,
    },
    /// It worked and broke; the next try comes after a pause.
    Lost {
        /// When it broke.
        since_s: f64,
        /// Why.
        why: String,
        /// How many times it was tried since.
        attempt: u32,
    },
    /// It worked and broke, and is being tried right now.
    Retrying {
        /// When it broke.
        since_s: f64,
        /// Why it broke, or why the last try failed.
        why: String,
        /// How many times it was tried since, this one included.
        attempt: u32,
    },
    /// Trying again cannot help until the user does something.
    Failed {
        /// What is wrong and what to do.
        why: String,
    },
}

impl LinkState {
    /// Whether calls get through.
    pub fn is_connected(&self) -> bool {
        matches!(self, Self::Connected { .. })
    }
}

/// Whether simulated time advances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Simulation {
    /// It does not; pictures are not renewed.
    Stopped,
    /// It does not for now.
    Paused,
    /// It does.
    Running,
}

/// The robot at one instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotState {
    /// The tip as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Positions of the joints from the base up [rad].
    pub joints_rad: JointAngles,
    /// Simulated time [s].
    pub sim_time_s: f64,
    /// Whether it advances.
    pub simulation: Simulation,
}

/// What is known about a frame besides its pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameInfo {
    /// Counts the frames since the start of the program; grows with every frame that the camera worker takes.
    pub number: u64,
    /// Simulated time of the pictures [s].
    pub sim_time_s: f64,
    /// When they arrived.
    pub received_s: f64,
    /// Frames per second that arrive.
    pub rate_hz: f64,
    /// Depths [m] at the two ends of the colour map.
    pub depth_range_m: [f32; 2],
    /// The sensor's far plane [m]: depths there are no surface.
    pub far_plane_m: f32,
    /// The tip as the controller reported it at the instant of the pictures.
    pub base_from_tip: Pose<Base, Tip>,
    /// The joints at the same instant [rad].
    pub joints_rad: JointAngles,
}

/// The pixels of a frame.
#[derive(Clone, PartialEq)]
pub struct FrameImages {
    /// Colour, row 0 on top.
    pub rgb: RgbImage,
    /// Depth in metres, row 0 on top.
    pub depth: DepthImage,
    /// Depth as the window shows it, same size as `depth`.
    pub depth_coloured: RgbImage,
}

/// Sizes only: a million pixels say nothing in a log.
impl fmt::Debug for FrameImages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rgb, depth, depth_coloured: _ } = self;
        let depth = (depth.width, depth.height);
        f.debug_struct("FrameImages").field("rgb", &rgb.dimensions()).field("depth", &depth).finish()
    }
}

impl FrameImages {
    /// Colour of a pixel; `None` outside.
    pub fn rgb_at(&self, point: ImagePoint) -> Option<[u8; 3]> {
        self.rgb.get_pixel_checked(point.column, point.row).map(|pixel| pixel.0)
    }

    /// Depth at a pixel of the colour image; the depth image may have another size.
    pub fn depth_at(&self, point: ImagePoint, far_plane_m: f32) -> DepthSample {
        let (width, height) = self.rgb.dimensions();
        if point.column >= width || point.row >= height {
            return DepthSample::Invalid;
        }
        let scaled = |at: u32, of: u32, to: u32| (u64::from(at) * u64::from(to) / u64::from(of)) as u32;
        let column = scaled(point.column, width, self.depth.width);
        let row = scaled(point.row, height, self.depth.height);
        self.depth.sample(column, row, far_plane_m)
    }
}

/// A pair of pictures with its circumstances.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveFrame {
    /// When, how often, which range.
    pub info: FrameInfo,
    /// The pixels.
    pub images: Arc<FrameImages>,
}

/// A pixel of the colour image; (0, 0) is the top left one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImagePoint {
    /// Column from the left.
    pub column: u32,
    /// Row from the top.
    pub row: u32,
}

/// Which depths the colour map covers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum DepthScale {
    /// Those that are in the picture.
    #[default]
    Auto,
    /// Those that the sensor can measure.
    Full,
}

/// Light or dark.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ThemeChoice {
    /// Dark surfaces.
    #[default]
    Dark,
    /// Light surfaces.
    Light,
}

impl ThemeChoice {
    /// The one that this is not.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Dark => Self::Light,
            Self::Light => Self::Dark,
        }
    }
}

/// How the rotation of the tip is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum RotationFormat {
    /// Roll, pitch, yaw in degrees, URDF's order.
    #[default]
    RollPitchYaw,
    /// Quaternion x, y, z, w.
    Quaternion,
}

/// What the window remembers from one start to the next.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ViewSettings {
    /// Light or dark.
    pub theme: ThemeChoice,
    /// Of all words.
    pub language: Language,
    /// How rotations are written.
    pub rotation: RotationFormat,
    /// Which depths the colour map covers.
    pub depth_scale: DepthScale,
}

/// How much a message matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Severity {
    /// It went as asked.
    Info,
    /// Not as asked, or soon not.
    Warning,
    /// It failed.
    Error,
}

/// The last thing that happened, in words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Message {
    /// How much it matters.
    pub severity: Severity,
    /// The words.
    pub text: Text,
    /// When it happened.
    pub at_s: f64,
}

/// Everything that the window shows.
#[derive(Debug, Clone)]
pub struct Model {
    /// Which cell.
    pub source: CellSource,
    /// The present time.
    pub now_s: f64,
    /// The connection for joints, tip, simulation and stop.
    pub control: LinkState,
    /// The connection for pictures.
    pub camera: LinkState,
    /// The connection for motions.
    pub mover: LinkState,
    /// What is known of the cell since it was connected.
    pub cell: Option<CellFacts>,
    /// What the arm does, as far as this program moves it.
    pub motion: Motion,
    /// The robot, as it was when it was last heard of.
    pub robot: Option<RobotState>,
    /// The newest pictures.
    pub frame: Option<LiveFrame>,
    /// Frames that arrived but were never shown, because newer ones came first.
    pub dropped_frames: u64,
    /// A stop was pressed and the robot has not confirmed it yet.
    pub stop_pending: bool,
    /// The pixel under the pointer, in both pictures.
    pub cursor: Option<ImagePoint>,
    /// What is remembered from one start to the next.
    pub view: ViewSettings,
    /// The last thing that happened.
    pub message: Option<Message>,
}

impl Model {
    /// Before anything has happened.
    pub fn new(source: CellSource, view: ViewSettings) -> Self {
        let first = LinkState::first(&source);
        Self {
            source,
            now_s: 0.0,
            control: first.clone(),
            camera: first.clone(),
            mover: first,
            cell: None,
            motion: Motion::Idle,
            robot: None,
            frame: None,
            dropped_frames: 0,
            stop_pending: false,
            cursor: None,
            view,
            message: None,
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

    /// Age of the newest pictures [s].
    pub fn frame_age_s(&self) -> Option<f64> {
        self.frame.as_ref().map(|frame| (self.now_s - frame.info.received_s).max(0.0))
    }

    /// Whether the simulation is known not to run, while the connection works.
    pub fn resting_simulation(&self) -> Option<Simulation> {
        let robot = self.robot.as_ref().filter(|_| self.control.is_connected())?;
        (robot.simulation != Simulation::Running).then_some(robot.simulation)
    }
}

impl LinkState {
    /// The state before the first try.
    pub fn first(source: &CellSource) -> Self {
        match source {
            CellSource::BuiltIn => Self::StartingCell { why: None },
            CellSource::Address(address) => Self::Searching { address: address.clone(), attempt: 1, why: None },
        }
    }
}
