//! The tracked board, and the arm that follows it.

use std::collections::VecDeque;
use std::sync::Arc;

use handeye_coppeliasim::cell::{self, BoardPath};
use handeye_geometry::frames::{Base, Camera, Pose, Target};
use handeye_track::Update;
use serde::{Deserialize, Serialize};

use super::worker::TrackedBy;
use crate::text::Text;

/// Points of the history that is shown: half a minute at the usual rates.
pub const MAX_TRACK_POINTS: usize = 900;

/// The tracking result for one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracked {
    /// Number of the image, see [`crate::live::state::FrameInfo::number`].
    pub frame: u64,
    /// The board.
    pub update: Update,
    /// From the arrival of the image to the published pose \[s\].
    pub latency_s: f64,
    /// Poses per second.
    pub rate_hz: f64,
    /// Compared with where a simulated cell reports the board at the time of the image.
    pub error: Option<TrackError>,
    /// The true pose, where the cell publishes it.
    pub truth: Option<Pose<Base, Target>>,
}

/// An estimate against the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackError {
    /// Distance of the board's centre from its true place \[m\].
    pub position_m: f64,
    /// Angle between the axes \[rad\].
    pub rotation_rad: f64,
}

/// One point of the plots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// Time of the image \[s\].
    pub time_s: f64,
    /// Origin of the board in the base \[m\]; `None` while it is not known.
    pub position_m: Option<[f64; 3]>,
    /// 95 % of the position: radius \[m\].
    pub position_95_m: Option<f64>,
    /// Against the truth.
    pub error: Option<TrackError>,
    /// From image to pose \[s\].
    pub latency_s: f64,
}

/// What the arm should do about the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FollowRequest {
    /// Keep the camera where it is relative to the board now.
    KeepView,
    /// The same; if the arm has no room to follow the board from there, from the nearest place where it has room.
    KeepViewWithRoom,
    /// Keep the camera at this pose relative to the board.
    KeepPose(Pose<Camera, Target>),
    /// Bring the tip to a corner of the board, this far off along its normal \[m\].
    Corner {
        /// Index of the corner.
        index: usize,
        /// Distance of the tip from it \[m\].
        stand_off_m: f64,
    },
}

/// What the arm does about the board.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum FollowStatus {
    /// Nothing.
    #[default]
    Off,
    /// It moves to a place from which it has room to follow.
    MakingRoom,
    Following {
        /// Distance of the tip from its goal \[m\].
        distance_m: f64,
        /// Angle between tip and goal \[rad\].
        angle_rad: f64,
        /// Whether the arm does not go to its goal, because it would come too close to something.
        is_kept_off: bool,
    },
    /// It is at rest until the board is seen again.
    Waiting,
    /// It came to rest by itself, and this is why.
    Ended(Text),
}

/// Tracking as the window shows it.
#[derive(Debug, Clone, Default)]
pub struct TrackState {
    /// Whether images are tracked.
    pub on: bool,
    /// The tracker set-up; `None` while nothing is tracked.
    pub by: Option<Arc<TrackedBy>>,
    /// Whether tip poses and commands should be corrected for the errors of the arm; until the user decides, they are if that
    /// brings the tip nearer.
    pub wants_corrected: Option<bool>,
    /// What the arm was requested to do.
    pub request: Option<FollowRequest>,
    /// What the arm does.
    pub follow: FollowStatus,
    /// The newest image.
    pub newest: Option<Arc<Tracked>>,
    /// The last images, oldest first.
    pub history: VecDeque<TrackPoint>,
    /// How the built-in cell moves its board, as far as this program requested it.
    pub board: BoardMotion,
    /// Whether this program asked the cell to hide its board.
    pub board_hidden: bool,
}

/// How a simulated cell moves its board.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct BoardMotion {
    /// Along which path.
    pub path: BoardPath,
    /// How fast [m/s].
    pub speed_m_s: f64,
}

impl BoardMotion {
    /// As a request to the cell: with the sizes that it uses by default.
    pub(crate) fn of_cell(&self) -> cell::BoardMotion {
        cell::BoardMotion::along(self.path, self.speed_m_s)
    }
}
