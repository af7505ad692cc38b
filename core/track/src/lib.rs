//! Following the board from image to image: where it is in the base frame, how fast it moves, and how sure that is.
//!
//! | part | does |
//! | --- | --- |
//! | [`Tracker`] | corners near where they are expected, pose, filter; lost and found |
//! | [`Rest`] | whether the board rests, so that an arm which follows it does |
//! | [`Keep`] | where the tip has to be, so that the camera keeps its view of the board |
//!
//! Nothing here reads a clock or knows a thread: time is the simulated (or recorded) time of the images.
//!
//! `examples/track_board.rs` follows a board through a folder of images, each of which goes into [`Tracker::see`]:
//!
//! ```
//! use handeye_estimate::handeye::HandEye;
//! use handeye_estimate::verify::Predictor;
//! use handeye_geometry::camera::Intrinsics;
//! use handeye_geometry::frames::Pose;
//! use handeye_geometry::targets::{Grid, TargetSpec};
//! use handeye_track::{MotionModel, Setup, Tracker};
//!
//! let calibrated = Predictor::known(
//!     HandEye::EyeInHand { tip_from_camera: Pose::identity(), base_from_target: Pose::identity() },
//!     Intrinsics::pinhole(640, 480, 600.0),
//! );
//! let target = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 });
//! let tracker = Tracker::new(Setup { target, calibrated, motion: MotionModel::default() })?;
//! assert!(tracker.at(0.0).is_none(), "no image was seen");
//! # Ok::<(), handeye_track::TrackError>(())
//! ```
//!
//! Depends on `handeye_detect` and `handeye_estimate`; never on a window or a socket.

#![warn(missing_docs)]

mod by_depth;
mod corner;
mod depth_tilt;
mod detection;
mod error;
mod filter;
mod glance;
mod goal;
mod motion;
#[cfg(test)]
mod moving_board;
mod noise;
mod pose;
mod rest;
mod tracker;

use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};

use handeye_estimate::verify::Predictor;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corners;
use image::GrayImage;

pub use error::TrackError;
pub use goal::{Keep, TipGoal};
pub use rest::Rest;
pub use tracker::Tracker;

/// Input of a tracker.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The board.
    pub target: TargetSpec,
    /// Camera and hand-eye, with their uncertainty where it is known.
    pub calibrated: Predictor,
    /// Motion model of the board.
    pub motion: MotionModel,
}

/// The board's velocity is constant except for white noise in its acceleration, of these densities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionModel {
    /// Density for the acceleration of its centre [m/s²/√Hz].
    pub acceleration: f64,
    /// Density for its angular acceleration [rad/s²/√Hz].
    pub angular_acceleration: f64,
    /// How long \[s\] the board is assumed to keep its velocity while it is not seen; after that it is lost.
    pub coast_s: f64,
}

/// An image with its circumstances.
#[derive(Debug, Clone, Copy)]
pub struct Image<'a> {
    /// Its time \[s\]; must grow from image to image, a step back starts the tracker again.
    pub time_s: f64,
    /// The image in grey levels.
    pub grey: &'a GrayImage,
    /// Depth of the same instant and the same camera, where there is one.
    pub depth: Option<&'a DepthImage>,
    /// Depths there and beyond are not a surface \[m\].
    pub far_plane_m: f32,
    /// The tip at the same instant.
    pub base_from_tip: Pose<Base, Tip>,
}

/// Whether the board is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum State {
    /// It has not been seen yet.
    Searching,
    /// It is seen.
    Tracking {
        /// Corners that are seen.
        corners: usize,
        /// Corners that there are.
        of: usize,
    },
    /// It is not seen in this image, and is assumed to go on as it went.
    Coasting {
        /// Time of the last image in which it was seen \[s\].
        since_s: f64,
    },
    /// It has not been seen for too long; nothing is known of where it is.
    Lost {
        /// Time of the last image in which it was seen \[s\].
        since_s: f64,
    },
}

/// The board in one image alone.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardDetection {
    /// Corners that are seen; not all of them where the board is partly hidden.
    pub corners: Corners,
    /// The board in the camera, by PnP.
    pub camera_from_target: Pose<Camera, Target>,
    /// The board in the base, by way of the calibration and the pose of the tip.
    pub base_from_target: Pose<Base, Target>,
    /// Covariance of `base_from_target` from the noise of the corners: right perturbation `[t; r]`, m and rad.
    pub covariance: Matrix6<f64>,
    /// RMS of the distances between corners and their model \[px\].
    pub rms_px: f64,
}

/// The board in one image by its corners, with the tilt from its depths. Position and distance are from the corners alone.
#[derive(Debug, Clone, PartialEq)]
pub struct WithDepth {
    /// The board in the base.
    pub base_from_target: Pose<Base, Target>,
    /// Its covariance: right perturbation `[t; r]`, m and rad.
    pub covariance: Matrix6<f64>,
}

/// The board from depths at its corners: pixel and depth, then camera, tip and base. No model of the lens enters the
/// distance.
#[derive(Debug, Clone, PartialEq)]
pub struct ByDepth {
    /// The rigid pose that fits the points best.
    pub base_from_target: Pose<Base, Target>,
    /// The first corner of the board by its own depth alone, in base axes; `None` without a depth there.
    pub first_corner_in_base: Option<Point3<f64>>,
    /// Corners with a depth.
    pub corners: usize,
    /// RMS distance of the points from the fitted board \[m\].
    pub rms_m: f64,
}

/// Pose of the board by all images so far.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// For this time \[s\].
    pub time_s: f64,
    /// The board.
    pub base_from_target: Pose<Base, Target>,
    /// Covariance of `base_from_target` from corners and model of motion, the calibration being taken as exact: right
    /// perturbation `[t; r]`, m and rad.
    pub covariance: Matrix6<f64>,
    /// Velocity of the board's origin, in base axes [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity of the board, in base axes [rad/s].
    pub angular_velocity_rad_s: Vector3<f64>,
}

impl Estimate {
    /// The same board at another time, going on as it goes. The covariance is not propagated; [`Tracker::at`] does
    /// that.
    #[must_use]
    pub fn carried_to(&self, time_s: f64) -> Self {
        let after_s = time_s - self.time_s;
        let turn = UnitQuaternion::from_scaled_axis(self.angular_velocity_rad_s * after_s);
        let place = Translation3::from(self.base_from_target.translation() + self.velocity_m_s * after_s);
        let carried = Isometry3::from_parts(place, turn * self.base_from_target.rotation());
        Self { time_s, base_from_target: Pose::from_isometry(carried), ..self.clone() }
    }
}

/// Result of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// Time of the image \[s\].
    pub time_s: f64,
    /// Whether the board is followed.
    pub state: State,
    /// This image alone.
    pub seen: Option<BoardDetection>,
    /// This image alone, with the tilt by its depths: what the filter takes in; `None` where the depths do not
    /// determine it.
    pub with_depth: Option<WithDepth>,
    /// The depths of this image alone.
    pub by_depth: Option<ByDepth>,
    /// All images so far; `None` while searching and when lost.
    pub estimate: Option<Estimate>,
}
