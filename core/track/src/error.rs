//! Why an image cannot be tracked.

use handeye_detect::VisionError;
use handeye_geometry::camera::CameraError;

/// Why there is no tracker, or no update. A board that is not in the image is not an error.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum TrackError {
    /// The intrinsics cannot be computed with.
    #[error("the intrinsics of the calibration are not usable: {source}; calibrate the camera again")]
    Intrinsics {
        /// What is wrong with the intrinsics.
        source: CameraError,
    },
    /// The hand-eye transform cannot be computed with.
    #[error("the calibration has no usable hand-eye transform (it is not finite): calibrate with robot poses first")]
    NoHandEye,
    /// The board has too few points.
    #[error("a target of {columns}×{rows} points cannot be tracked: it needs at least 3 points along either side")]
    TargetTooSmall {
        /// Points along x.
        columns: usize,
        /// Points along y.
        rows: usize,
    },
    /// The distance between points is not a length.
    #[error("the target's point distance of {square_m} m is not usable: it must be finite and positive")]
    BadSquare {
        /// Its value \[m\].
        square_m: f64,
    },
    /// A number of the motion model is invalid.
    #[error("the motion model's {name} is {value}: it must be finite and positive")]
    BadMotion {
        /// The number.
        name: &'static str,
        /// The number that was given.
        value: f64,
    },
    /// The time of an image is not a number.
    #[error("the time of the image is {time_s} s, which is not a valid time")]
    BadTime {
        /// Its value \[s\].
        time_s: f64,
    },
    /// The pose of the tip is not finite.
    #[error("the robot pose of the image at {time_s} s is not finite: read it again with the next image")]
    NotFinite {
        /// Time of the image \[s\].
        time_s: f64,
    },
    /// Image and intrinsics are of different sizes.
    #[error(
        "the {what} is {width}×{height} and the calibration is for {camera_width}×{camera_height}: choose the camera's \
         resolution of the calibration, or calibrate with this one"
    )]
    OtherSize {
        /// The image or its depth image.
        what: &'static str,
        /// Width \[px\].
        width: u32,
        /// Height \[px\].
        height: u32,
        /// Width by the intrinsics \[px\].
        camera_width: u32,
        /// Height by the intrinsics \[px\].
        camera_height: u32,
    },
    /// The search for the board failed.
    #[error(transparent)]
    Vision(#[from] VisionError),
}
