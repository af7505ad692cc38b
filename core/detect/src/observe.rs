//! Evaluation of a kept image: the board's corners and the blur of its edges.

use image::{GrayImage, RgbImage};

use crate::{DetectOptions, EdgeBlur, VisionError, detect_with};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corners;
use handeye_images::gray_from_rgb;

/// The board in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// Its points in sight.
    pub corners: Corners,
    /// Blur of the edges; `None` for a board without straight edges, or too small to measure it.
    pub blur: Option<EdgeBlur>,
}

/// Finds the board with all effort and measures its blur. A capture and an image read from a file go through here, so
/// that a session that is opened again gives the numbers that it had. `None` when the board is not in the image; a
/// miss of dots or markers may take some seconds per megapixel.
///
/// # Errors
/// As [`detect_with`].
pub fn observe_image(
    rgb: &RgbImage,
    target: &TargetSpec,
    cancel: &CancelToken,
) -> Result<Option<Sighting>, VisionError> {
    observe_gray(&gray_from_rgb(rgb), target, cancel)
}

/// [`observe_image`] of an image in grey.
///
/// # Errors
/// As [`detect_with`].
pub fn observe_gray(
    grey: &GrayImage,
    target: &TargetSpec,
    cancel: &CancelToken,
) -> Result<Option<Sighting>, VisionError> {
    let found = detect_with(grey, target, &DetectOptions::thorough().cancelled_by(cancel))?;
    Ok(found.map(|corners| {
        let blur = match target {
            TargetSpec::Chessboard(grid) => EdgeBlur::measure(grey, &corners, grid),
            // No lattice of bare squares whose edges could be followed from corner to corner.
            _ => None,
        };
        Sighting { corners, blur }
    }))
}
