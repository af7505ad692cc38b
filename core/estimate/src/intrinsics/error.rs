//! Why a camera cannot be calibrated.

use handeye_geometry::camera::{CameraError, FoldsBack};
use handeye_geometry::planar_pose::PoseError;

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum IntrinsicsError {
    /// Not enough views.
    #[error("intrinsics need at least {need} views of the target, there are {got}; capture more from other angles")]
    TooFewViews {
        /// Views given.
        got: usize,
        /// Views needed.
        need: usize,
    },
    /// The corners of a view do not determine a pose, by the index of the view.
    #[error(transparent)]
    Corners(#[from] PoseError),
    /// A list of whiteners of another length than that of the corners.
    #[error("view {view}: there are {weights} weights for {corners} corners")]
    BadWeights {
        /// Index of the view.
        view: usize,
        /// Whiteners given.
        weights: usize,
        /// Corners given.
        corners: usize,
    },
    /// The image size or the start is not usable.
    #[error("camera model: {source}")]
    BadStart {
        /// The error of the camera model.
        #[from]
        source: CameraError,
    },
    /// The lens that was given folds back where the target was seen.
    #[error("the known camera: {fold}; the target was seen as far as {seen_px:.0} px from the principal point")]
    FoldsBack {
        /// Where the distortion folds back.
        fold: Box<FoldsBack>,
        /// Distance of the farthest corner from the principal point, pixels.
        seen_px: f64,
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
        /// The parameter of the lens that the views leave open.
        parameter: &'static str,
        /// Its standard deviation for 0.1 px of noise, in pixels.
        sigma_px: f64,
    },
    /// The optimisation ended at numbers that are not a valid camera.
    #[error(
        "the calibration did not converge to a camera ({reason}); check the order of corners and the target's size"
    )]
    NotACamera {
        /// What is wrong with them.
        reason: &'static str,
    },
    /// The work was cancelled.
    #[error("the calibration of the camera was cancelled")]
    Cancelled,
}
