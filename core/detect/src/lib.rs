//! From images to corners: chessboards, ChArUco, AprilTag and grids of dots. The only crate that calls OpenCV.
//!
//! ```
//! use handeye_detect::detect;
//! use handeye_geometry::camera::Intrinsics;
//! use handeye_geometry::targets::{Grid, TargetSpec};
//! use handeye_simulate::Scene;
//! use nalgebra::Isometry3;
//!
//! let grid = Grid { columns: 9, rows: 6, square_m: 0.025 };
//! let scene = Scene::new(Intrinsics::pinhole(640, 480, 600.0), grid, Isometry3::translation(-0.1, -0.0625, 0.5));
//! let corners = detect(&scene.render(1), &TargetSpec::Chessboard(grid))?.ok_or("not found")?;
//! for (corner, truth) in corners.iter().zip(scene.truth()) {
//!     assert!((corner.px - truth).norm() < 0.2);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Pixels are in the convention of [`handeye_geometry::camera`]: (0, 0) is the centre of the top-left pixel.
//!
//! OpenCV's own errors never leave this crate as types: [`VisionError::OpenCv`] carries the operation and the text. Never depends
//! on an estimator.

#![warn(missing_docs)]

mod bridge;
pub mod checkerboard;
mod circles;
mod dispatch;
mod edge_blur;
mod error;
pub mod markers;
mod observe;
mod options;
mod order;

pub use checkerboard::chessboard_in_sight;
pub use dispatch::{detect, detect_with};
pub use edge_blur::{EdgeBlur, MAX_BLUR_SHARE};
pub use error::VisionError;
pub use markers::april::tags_in_sight;
pub use markers::charuco::charuco_layout;
pub use observe::{Sighting, observe_gray, observe_image};
pub use options::{DetectOptions, Effort};

#[cfg(test)]
mod bridge_for_tests;
#[cfg(test)]
mod camera_tests;
#[cfg(test)]
mod detect_tests;
#[cfg(test)]
mod edge_blur_tests;
#[cfg(test)]
mod gray_tests;
#[cfg(test)]
mod intrinsics_opencv_tests;
#[cfg(test)]
mod planar_pose_opencv_tests;
#[cfg(test)]
mod targets_tests;
