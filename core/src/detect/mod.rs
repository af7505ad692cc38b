//! From images to corners. The only module that knows OpenCV.
//!
//! Pixels are in the convention of [`crate::geometry::camera`]: (0, 0) is the centre of the top-left pixel.
//!
//! OpenCV's own errors never leave this module as types: [`VisionError::OpenCv`] carries the operation and the text.

mod bridge;
pub(crate) mod checkerboard;
mod circles;
pub(crate) mod dispatch;
mod error;
pub(crate) mod markers;
mod options;
mod order;

pub use checkerboard::chessboard_in_sight;
pub use dispatch::{detect, detect_with};
pub use error::VisionError;
pub use markers::april::tags_in_sight;
pub use markers::charuco::charuco_layout;
pub use options::{DetectOptions, Effort};

#[cfg(test)]
mod bridge_for_tests;
#[cfg(test)]
mod camera_tests;
#[cfg(test)]
mod detect_tests;
#[cfg(test)]
mod gray_tests;
#[cfg(test)]
mod intrinsics_opencv_tests;
#[cfg(test)]
mod planar_pose_opencv_tests;
#[cfg(test)]
mod targets_tests;
