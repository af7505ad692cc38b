//! The entry: an image and a target in, corners out.

use image::GrayImage;

use super::order::Ordered;
use super::{VisionError, chessboard, circles};
use crate::observation::Corner;
use crate::target::TargetSpec;

/// An image with fewer pixels than this per point cannot show the target: squares of less than 3 px are not separated.
const MIN_SQUARE_PX: u32 = 3;

/// How long a detection may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effort {
    /// The quick methods, for every frame of a live stream: a miss costs a few times what a hit does.
    Live,
    /// Every method, for images that are kept: a miss may take some seconds per megapixel.
    #[default]
    Thorough,
}

/// Options of [`detect_with`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct DetectOptions {
    /// How long it may take.
    pub effort: Effort,
}

impl DetectOptions {
    /// For every frame of a live stream.
    pub fn live() -> Self {
        Self { effort: Effort::Live }
    }

    /// For images that are kept.
    pub fn thorough() -> Self {
        Self { effort: Effort::Thorough }
    }
}

/// [`detect_with`] with all effort.
///
/// # Errors
/// As [`detect_with`].
pub fn detect(image: &GrayImage, target: &TargetSpec) -> Result<Option<Vec<Corner>>, VisionError> {
    detect_with(image, target, DetectOptions::default())
}

/// Finds all points of the target, to a few hundredths of a pixel; `None` when it is not (wholly) in the image.
///
/// Corner `i` of the result is point `i` of [`TargetSpec::points`]: index `row * columns + column`, pixel (0, 0) at
/// the centre of the top-left pixel. The order is right-handed in the image, that is, the target's x × y points into
/// the board, away from the camera, and is the same in every view:
///
/// - a chessboard begins at the end where the square between its first four corners is dark;
/// - a grid of dots begins at the larger dot, where one of its corners has one.
///
/// # Symmetric targets
/// Where that leaves a choice ([`TargetSpec::is_symmetric`]: boards of even sum, plain grids of dots), the end is
/// taken from which the x axis points most to the right in the image. The same board turned by more than a quarter
/// turn between two views is then numbered from the other end, and no detector can know; views of such a target must
/// be kept within a quarter turn around the optical axis. A symmetric board that is printed with light first squares
/// at all ends is accepted and follows the same rule.
///
/// # Errors
/// [`VisionError::TargetTooSmall`] below 3 points a side, [`VisionError::BadImage`], [`VisionError::OpenCv`].
pub fn detect_with(
    image: &GrayImage,
    target: &TargetSpec,
    options: DetectOptions,
) -> Result<Option<Vec<Corner>>, VisionError> {
    let grid = target.grid();
    let (columns, rows) = (grid.columns, grid.rows);
    if columns < 3 || rows < 3 {
        return Err(VisionError::TargetTooSmall { columns, rows });
    }
    let (width, height) = image.dimensions();
    if width == 0 || height == 0 {
        return Err(VisionError::BadImage { width, height });
    }
    if columns.min(rows) >= (width.min(height) / MIN_SQUARE_PX) as usize
        || columns.max(rows) >= (width.max(height) / MIN_SQUARE_PX * 2) as usize
    {
        return Ok(None);
    }
    let found = match target {
        TargetSpec::Chessboard(_) => chessboard::find(image, grid, options.effort)?,
        TargetSpec::Circles(_) => circles::find(image, grid, options.effort)?,
    };
    Ok(found.map(|order| corners(&order)))
}

fn corners(order: &Ordered) -> Vec<Corner> {
    order.points.iter().enumerate().map(|(index, &px)| Corner { index, px }).collect()
}
