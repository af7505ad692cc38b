//! What is recorded. Plain data that costs the sender only a few reference counts.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_plan::Surroundings;
use handeye_session::{CaptureId, Document};

use crate::capture::state::LiveDetection;
use crate::live::state::{FrameImages, FrameInfo};
use crate::messages::state::Severity;
use crate::session::state::Observed;
use crate::shell::state::Step;
use crate::solve::state::Solved;
use crate::track::state::Tracked;
use handeye_link::CellFacts;

/// Something to record.
#[derive(Debug, Clone)]
pub enum Entry {
    /// A cell was connected; its ground truth, if it publishes one.
    Cell(Arc<CellFacts>),
    Robot {
        /// Simulated time \[s\].
        sim_time_s: f64,
        /// The tip as the controller reports it.
        base_from_tip: Pose<Base, Tip>,
        /// Joints \[rad\].
        joints_rad: JointValues,
    },
    /// A live image.
    Image {
        /// When and from where.
        info: Box<FrameInfo>,
        /// The pixels.
        images: Arc<FrameImages>,
    },
    /// The board in a live image.
    Detection(Arc<LiveDetection>),
    /// The session is now like this; its images are below the folder.
    Document {
        /// The folder of the session.
        folder: Option<PathBuf>,
        /// The captures.
        document: Arc<Document>,
    },
    /// Corners of a capture.
    Observed {
        id: CaptureId,
        /// What was seen.
        observed: Arc<Observed>,
    },
    /// A calibration.
    Solved(Arc<Solved>),
    /// An image in which the board was tracked.
    Tracked(Arc<Tracked>),
    /// Tip poses that guided capture goes to, the next one first.
    Planned(Vec<Pose<Base, Tip>>),
    /// What the arm keeps clear of.
    KeepOut {
        /// The obstacles that the cell reports.
        scene_obstacles: Arc<Surroundings>,
        /// What the user keeps the arm out of.
        own: Arc<Surroundings>,
    },
    /// Captures that are selected in the window.
    Selected(Vec<CaptureId>),
    /// The step of the workflow, which decides what is shown.
    Step(Step),
    /// A line of the log.
    Message {
        /// How much it matters.
        severity: Severity,
        /// The words, in English.
        words: String,
    },
}
