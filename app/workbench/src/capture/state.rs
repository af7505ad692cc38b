//! The newest sight of the board, and the capture that is under way.

use handeye_arm::JointValues;
use handeye_capture::Wait;
use handeye_detect::VisionError;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::observation::Corners;
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// The board in the newest image that was searched.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveDetection {
    pub frame: u64,
    /// The corners; `None` when the board was not found.
    pub corners: Option<Corners>,
    /// The board's pose with the intrinsics at hand.
    pub camera_from_target: Option<Pose<Camera, Target>>,
    /// Where the tip was, where that is known.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// The joints at the same instant \[rad\]; empty where the robot does not report them.
    pub joints_rad: JointValues,
    /// How long the search took \[s\].
    pub took_s: f64,
    /// Why the image could not be searched at all, as opposed to a board that is not in it.
    pub problem: Option<VisionError>,
    /// Frames so far that were never searched, because newer ones came first.
    pub dropped: u64,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum CapturePurpose {
    /// It enters the fit.
    #[default]
    Calibrate,
    /// It never enters the fit and shows how good it is.
    Verify,
}

/// How captures are taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CaptureOptions {
    /// Images that are averaged.
    pub frames: u32,
    /// Captures closer than this to an earlier one in both distance \[m\] and angle are refused.
    pub least_distance_m: f64,
    /// See `least_distance_m` \[rad\].
    pub least_angle_rad: f64,
    /// Longest wait \[s\] for robot and image to settle.
    pub settle_limit_s: f64,
}

impl Default for CaptureOptions {
    fn default() -> Self {
        Self { frames: 1, least_distance_m: 0.005, least_angle_rad: 1.0_f64.to_radians(), settle_limit_s: 10.0 }
    }
}

/// Why a capture is not there yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum CaptureWait {
    /// More images are needed.
    Images(Wait),
    /// The board is looked for and measured.
    Measuring,
    /// It is being written to the disk.
    Saving,
}

/// The capture that is under way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaptureUnderWay {
    /// Its number, from the command.
    pub number: u64,
    pub purpose: CapturePurpose,
    pub wait: CaptureWait,
    /// Since when.
    pub since_s: f64,
}

/// Why there was no capture: what is wrong and what to do, in words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaptureRefused {
    /// Which kind of refusal, for tests and for deciding what comes next.
    pub kind: RefusalKind,
    /// The words.
    pub why: Text,
    /// When.
    pub at_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RefusalKind {
    /// The board was not found.
    NoBoard,
    /// Robot or image did not come to rest.
    NotSettled,
    /// The simulation is paused.
    Paused,
    /// The image is blurred.
    Blurred,
    /// There is a capture from almost the same pose.
    TooSimilar,
    /// No images come.
    NoImages,
    /// It was cancelled.
    Cancelled,
    /// The disk did not take it.
    NotSaved,
}

impl RefusalKind {
    /// Whether other poses may give a capture all the same: then a sequence skips this one and continues.
    pub fn concerns_the_pose(self) -> bool {
        match self {
            Self::NoBoard | Self::NotSettled | Self::Blurred | Self::TooSimilar => true,
            Self::Paused | Self::NoImages | Self::Cancelled | Self::NotSaved => false,
        }
    }
}
