//! Why a detection is not possible.

use handeye_geometry::progress::CancelToken;

/// Why a detection is not possible.
///
/// A board that is simply not in the image is not an error: [`detect`](super::detect) returns `None`.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum VisionError {
    /// The target cannot be searched.
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
        /// The dimension, and its valid range.
        #[from]
        source: handeye_geometry::targets::BadTarget,
    },
    /// The board in the image has its markers in the other squares.
    #[error(
        "the target is said to have the {stated} layout, the ChArUco board in the image has the {seen} one: write \
         layout = \"{seen}\", or leave it out"
    )]
    OtherLayout {
        /// What is reported.
        stated: &'static str,
        /// The layout of the board in the image.
        seen: &'static str,
    },
    /// The image has no pixels, or more than OpenCV can address.
    #[error("an image of {width}×{height} pixels cannot be searched")]
    BadImage {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The search was asked to end before it had an answer.
    #[error("the search was cancelled")]
    Cancelled,
    /// OpenCV refused or failed.
    #[error("OpenCV could not {operation}: {message}")]
    OpenCv {
        /// The operation.
        operation: &'static str,
        /// Its error message.
        message: String,
    },
}

/// Nothing, or [`VisionError::Cancelled`].
pub(super) fn go_on(cancel: &CancelToken) -> Result<(), VisionError> {
    if cancel.is_cancelled() { Err(VisionError::Cancelled) } else { Ok(()) }
}
