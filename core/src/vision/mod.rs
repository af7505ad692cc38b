//! Seeing: the target in an image, its pose, and the camera's intrinsics.
//!
//! The only place that knows OpenCV (feature `opencv`). Pixels are OpenCV's: (0, 0) is the centre of the top-left one.

mod chessboard;
mod circles;
pub mod intrinsics;
mod order;
pub mod pnp;
mod saddle;

use image::GrayImage;
use opencv::boxed_ref::BoxedRef;
use opencv::core::Mat;

use crate::observation::Corner;
use crate::target::TargetSpec;

/// Why an image or a set of corners gave no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VisionError {
    /// OpenCV refused the input.
    #[error("OpenCV could not {doing}: {message}")]
    OpenCv {
        /// What was being done.
        doing: &'static str,
        /// OpenCV's own words, first line.
        message: String,
    },
    /// Fewer corners than a pose needs.
    #[error("{got} corners in a view, at least {need} are needed for the pose of the target")]
    TooFewCorners {
        /// Corners given.
        got: usize,
        /// Corners needed.
        need: usize,
    },
    /// Fewer views than intrinsics need.
    #[error(
        "{got} views of the target, at least {need} are needed for the intrinsics: capture more, tilted differently"
    )]
    TooFewViews {
        /// Views given.
        got: usize,
        /// Views needed.
        need: usize,
    },
    /// All views look at the target alike, so that focal length and distance cannot be told apart.
    #[error(
        "the target has the same tilt in all {views} views (within {spread_deg:.2}°), so the focal length cannot be \
         found: add views tilted by 20° or more, or give the intrinsics"
    )]
    SameTilt {
        /// Number of views.
        views: usize,
        /// Largest angle between two normals of the target, degrees.
        spread_deg: f64,
    },
    /// No pose puts the target before the camera so that it looks like this.
    #[error("no pose of the target fits these corners: {reason}")]
    NoPose {
        /// What failed.
        reason: &'static str,
    },
}

impl VisionError {
    fn opencv(doing: &'static str) -> impl Fn(opencv::Error) -> Self {
        move |error| Self::OpenCv { doing, message: error.message.lines().next().unwrap_or_default().to_owned() }
    }
}

/// How hard to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effort {
    /// One pass that gives up early: for every frame of a live picture.
    Live,
    /// Everything that helps: other scales, then the slow detector.
    #[default]
    Thorough,
}

/// Finds all points of the target in an image.
///
/// Corners come in the order of [`TargetSpec::points`], the same end of the board first in every view. The printed
/// pattern of a symmetric target ([`TargetSpec::is_symmetric`]) does not tell its ends apart; then the order whose x axis
/// points most to the right in the image is taken. `None` when the target is not (wholly) in view.
///
/// # Errors
/// [`VisionError::OpenCv`] for an image that cannot be processed.
pub fn detect(image: &GrayImage, target: &TargetSpec, effort: Effort) -> Result<Option<Vec<Corner>>, VisionError> {
    let points = match target {
        TargetSpec::Chessboard(grid) => chessboard::detect(image, grid, effort)?,
        TargetSpec::Circles(grid) => circles::detect(image, grid)?,
    };
    Ok(points.map(|points| points.into_iter().enumerate().map(|(index, px)| Corner { index, px }).collect()))
}

/// A view of the image as OpenCV's matrix, without a copy.
fn mat(image: &GrayImage) -> Result<BoxedRef<'_, Mat>, VisionError> {
    Mat::new_rows_cols_with_data(image.height() as i32, image.width() as i32, image.as_raw())
        .map_err(VisionError::opencv("read the image"))
}

/// Whether a matrix has pixels at all.
fn is_empty(image: &GrayImage) -> bool {
    image.width() < 3 || image.height() < 3
}

#[cfg(test)]
mod tests;
