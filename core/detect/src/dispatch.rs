//! The entry: an image and a target in, corners out.

use image::GrayImage;

use super::circles::asymmetric;
use super::error::go_on;
use super::markers::{april, charuco};
use super::options::{DetectOptions, check};
use super::order::Ordered;
use super::{VisionError, checkerboard, circles};
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{Grid, TargetSpec};

/// An image with fewer pixels than this per point cannot show the target: squares of less than 3 px are not separated.
const MIN_SQUARE_PX: u32 = 3;

/// [`detect_with`] with all effort.
///
/// # Errors
/// As [`detect_with`].
pub fn detect(image: &GrayImage, target: &TargetSpec) -> Result<Option<Corners>, VisionError> {
    detect_with(image, target, &DetectOptions::default())
}

/// Finds the points of the target, to a few hundredths of a pixel; `None` when it is not in the image.
///
/// `Corner::index` is the number of the point in [`TargetSpec::points`], ascending; pixel (0, 0) is the centre of the
/// top-left pixel. All points of chessboards and grids of dots are found, or none. For `ChArUco` boards and boards of
/// tags those in sight are found, when they are at least four and not on a line, and at least two of the markers that
/// identify them are placed as on the target. The order is right-handed in the image, that is, the target's x × y points
/// into the board, away from the camera, and is the same in every view:
///
/// - a chessboard begins at the end where the square between its first four corners is dark;
/// - a grid of dots begins at the larger dot, where one of its corners has one;
/// - markers and shifted rows of dots define where a target begins.
///
/// # Symmetric targets
/// Where that leaves a choice ([`TargetSpec::is_symmetric`]: boards of even sum, plain grids of dots), the end is taken
/// from which the x axis points most to the right in the image. The same board turned by more than a quarter turn
/// between two views is then numbered from the other end, and no detector can detect that; views of such a target must
/// be kept within a quarter turn around the optical axis. A symmetric board that is printed with light first squares at
/// all ends is accepted and follows the same rule.
///
/// # Errors
/// [`VisionError::TargetTooSmall`] for a chessboard or a grid of dots below 3 points a side, [`VisionError::BadTarget`]
/// for markers that cannot be, [`VisionError::OtherLayout`] for a `ChArUco` board of the other layout than stated,
/// [`VisionError::BadImage`], [`VisionError::Cancelled`], [`VisionError::OpenCv`].
pub fn detect_with(
    image: &GrayImage,
    target: &TargetSpec,
    options: &DetectOptions,
) -> Result<Option<Corners>, VisionError> {
    check(image, target)?;
    let DetectOptions { effort, cancel } = options;
    go_on(cancel)?;
    let effort = *effort;
    let found = |corners: Option<Vec<Corner>>| Ok(corners.map(Corners::from));
    match target {
        TargetSpec::Chessboard(grid) if fits(image, grid) => {
            Ok(checkerboard::find(image, grid, cancel)?.as_ref().map(Ordered::corners))
        }
        TargetSpec::Circles(grid) if fits(image, grid) => {
            Ok(circles::find(image, grid, effort, cancel)?.as_ref().map(Ordered::corners))
        }
        TargetSpec::AsymmetricCircles(grid) if fits(image, grid) => {
            found(asymmetric::find(image, grid, effort, cancel)?)
        }
        TargetSpec::Chessboard(_) | TargetSpec::Circles(_) | TargetSpec::AsymmetricCircles(_) => Ok(None),
        TargetSpec::Charuco(board) => found(charuco::find(image, board, effort)?),
        TargetSpec::AprilGrid(board) => found(april::find(image, board, effort)?),
        TargetSpec::AprilTag(tag) => found(april::find(image, &tag.alone(), effort)?),
    }
}

/// Whether the image has room for all points.
fn fits(image: &GrayImage, grid: &Grid) -> bool {
    let (width, height) = image.dimensions();
    let (columns, rows) = (grid.columns, grid.rows);
    columns.min(rows) < (width.min(height) / MIN_SQUARE_PX) as usize
        && columns.max(rows) < (width.max(height) / MIN_SQUARE_PX * 2) as usize
}
