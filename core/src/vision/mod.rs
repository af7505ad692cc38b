//! From images to corners, poses and intrinsics. The only module that knows OpenCV.
//!
//! Pixels are in the convention of [`crate::camera`]: (0, 0) is the centre of the top-left pixel.
//!
//! OpenCV's own errors never leave this module as types: [`VisionError::OpenCv`] carries the operation and the text.

mod april;
mod asymmetric;
mod bridge;
mod charuco;
pub(crate) mod checker;
mod chessboard;
mod circles;
mod crossing;
mod detect;
mod dots;
mod edge_profile;
mod edges;
mod homography;
pub(crate) mod markers;
mod order;
pub(crate) mod saddle;
mod spread;
pub(crate) mod subpixel;

pub mod intrinsics;
pub mod pnp;

pub use charuco::charuco_layout;
pub use detect::{DetectOptions, Effort, detect, detect_with};

use crate::camera::CameraError;

/// Why there is no detection, pose or calibration.
///
/// A board that is simply not in the picture is not an error: [`detect`] returns `None`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VisionError {
    /// The target cannot be looked for.
    #[error("a target of {columns}×{rows} points cannot be detected: it needs at least 3 points along either side")]
    TargetTooSmall {
        /// Points along x.
        columns: usize,
        /// Points along y.
        rows: usize,
    },
    /// A number of the target is out of range.
    #[error("the target cannot be detected: {source}")]
    BadTarget {
        /// Which, and what it may be.
        #[from]
        source: crate::target::BadTarget,
    },
    /// The board in the picture has its markers in the other squares.
    #[error(
        "the target is said to have the {stated} layout, the ChArUco board in the picture has the {seen} one: write \
         layout = \"{seen}\", or leave it out"
    )]
    OtherLayout {
        /// What is said.
        stated: &'static str,
        /// What is seen.
        seen: &'static str,
    },
    /// The distance between points is not a length.
    #[error("the target's point distance of {square_m} m is not usable: it must be finite and positive")]
    BadSquare {
        /// Its value in metres.
        square_m: f64,
    },
    /// The image has no pixels, or more than OpenCV can address.
    #[error("an image of {width}×{height} pixels cannot be searched")]
    BadImage {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// Not enough corners for a pose or for a view.
    #[error("view {view} has {got} corners, {need} are needed; leave it out or detect it again")]
    TooFewCorners {
        /// Index of the view, 0 where there is only one.
        view: usize,
        /// Corners given.
        got: usize,
        /// Corners needed.
        need: usize,
    },
    /// A corner that is not a point of the target, is listed twice, or is not a number.
    #[error("view {view}: corner {index} at ({u_px}, {v_px}) px {reason}")]
    BadCorner {
        /// Index of the view, 0 where there is only one.
        view: usize,
        /// The corner's index.
        index: usize,
        /// Its column in pixels.
        u_px: f64,
        /// Its row in pixels.
        v_px: f64,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// All corners of the view lie on one line, in the image or on the target, so that they fix no pose.
    #[error("view {view}: the corners lie on one line and fix no pose")]
    CollinearCorners {
        /// Index of the view, 0 where there is only one.
        view: usize,
    },
    /// Neither planar solution puts the whole target in front of the camera.
    #[error("no pose puts all {corners} corners in front of the camera; check the order of corners and the intrinsics")]
    NoPose {
        /// Corners given.
        corners: usize,
    },
    /// The camera model cannot be used or has no ray for a corner.
    #[error("camera model: {source}")]
    Camera {
        /// What the model says.
        #[from]
        source: CameraError,
    },
    /// Not enough views to estimate intrinsics.
    #[error("intrinsics need at least {need} views of the target, there are {got}; capture more from other angles")]
    TooFewViews {
        /// Views given.
        got: usize,
        /// Views needed.
        need: usize,
    },
    /// The target has the same orientation to the camera in all views, which leaves the focal length undetermined.
    #[error(
        "the target is tilted the same way in all {views} views (within {spread_deg:.1}°), which leaves the focal length \
         undetermined; capture views tilted by 20° or more about different axes"
    )]
    ParallelViews {
        /// Views given.
        views: usize,
        /// Largest angle between the target's normals in two views, degrees.
        spread_deg: f64,
    },
    /// The views determine the camera so weakly that its numbers would be noise.
    #[error(
        "the views leave {parameter} undetermined: 0.1 px of corner noise moves it by {sigma_px:.0} px; \
         capture views tilted by 20° or more about different axes"
    )]
    Undetermined {
        /// Which parameter.
        parameter: &'static str,
        /// Its standard deviation for 0.1 px of noise, in pixels.
        sigma_px: f64,
    },
    /// The optimisation ended at numbers that are no camera.
    #[error(
        "the calibration did not converge to a camera ({reason}); check the order of corners and the target's size"
    )]
    NotACamera {
        /// What is wrong with them.
        reason: String,
    },
    /// The work was cancelled.
    #[error("the calibration of the camera was cancelled")]
    Cancelled,
    /// OpenCV refused or failed.
    #[error("OpenCV could not {operation}: {message}")]
    OpenCv {
        /// What it was asked to do.
        operation: &'static str,
        /// What it said.
        message: String,
    },
}

#[cfg(test)]
mod camera_tests;
#[cfg(test)]
mod detect_tests;
#[cfg(test)]
mod gray_tests;
#[cfg(test)]
mod intrinsics_opencv_tests;
#[cfg(test)]
mod intrinsics_tests;
#[cfg(test)]
mod pnp_tests;
#[cfg(test)]
pub(crate) mod rendered;
#[cfg(test)]
mod targets_tests;
