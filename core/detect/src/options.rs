//! Options of the search for targets, and whether a search is possible.

use image::GrayImage;

use crate::VisionError;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::{Grid, TargetSpec};

/// Time limit of a detection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effort {
    /// The quick methods, for every frame of a live stream: a miss costs a few times what a hit does.
    Live,
    /// Every method, for images that are kept: a miss of dots or markers may take some seconds per megapixel. Chessboards
    /// have only one.
    #[default]
    Thorough,
}

/// Options of [`detect_with`](super::detect_with).
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct DetectOptions {
    /// Time limit.
    pub effort: Effort,
    /// Ends the search early: of a chessboard within a row of the image, of others between two calls of OpenCV.
    pub cancel: CancelToken,
}

impl DetectOptions {
    /// For every frame of a live stream.
    pub fn live() -> Self {
        Self { effort: Effort::Live, ..Self::default() }
    }

    /// For images that are kept.
    pub fn thorough() -> Self {
        Self { effort: Effort::Thorough, ..Self::default() }
    }

    /// The same with a token that ends the search.
    #[must_use]
    pub fn cancelled_by(self, cancel: &CancelToken) -> Self {
        Self { cancel: cancel.clone(), ..self }
    }
}

/// Whether image and target can be searched.
pub(super) fn check(image: &GrayImage, target: &TargetSpec) -> Result<(), VisionError> {
    match target {
        TargetSpec::Chessboard(grid) | TargetSpec::Circles(grid) | TargetSpec::AsymmetricCircles(grid) => {
            let Grid { columns, rows, .. } = *grid;
            if columns < 3 || rows < 3 {
                return Err(VisionError::TargetTooSmall { columns, rows });
            }
        }
        TargetSpec::Charuco(_) | TargetSpec::AprilGrid(_) | TargetSpec::AprilTag(_) => target.check()?,
    }
    let (width, height) = image.dimensions();
    if width == 0 || height == 0 {
        return Err(VisionError::BadImage { width, height });
    }
    Ok(())
}
