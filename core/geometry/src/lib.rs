//! Rigid motions, frames, cameras, targets and views of a target: mathematics independent of calibration.
//!
//! ```
//! use handeye_geometry::camera::Intrinsics;
//! use handeye_geometry::frames::{Camera, Pose, Target};
//! use handeye_geometry::targets::{Grid, TargetSpec};
//! use nalgebra::Isometry3;
//!
//! let board = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 });
//! let camera = Intrinsics::pinhole(640, 480, 600.0);
//! let camera_from_target: Pose<Camera, Target> = Pose::from_isometry(Isometry3::translation(-0.1, -0.0625, 0.5));
//! let px = camera.project(&(camera_from_target.isometry() * board.point(0)))?;
//! assert!((px.x - (camera.cx - 120.0)).abs() < 1e-9 && (px.y - (camera.cy - 75.0)).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | holds |
//! | --- | --- |
//! | [`frames`], [`se3`] | poses that name their frames; exponential and logarithm |
//! | [`camera`] | pinhole and fisheye lenses, projection, derivatives |
//! | [`targets`] | chessboards, grids of dots, ChArUco, AprilGrid as data; observed corners |
//! | [`observations`] | what a session observed: modes, views, what is known of the lens, levels of noise |
//! | [`planar_pose`] | pose of a flat target from its corners, and its mirror solution |
//! | [`view_equations`] | normal equations of a view, which estimators share |
//! | [`depth`] | depth images; the plane of a target in them is in [`targets::depth_plane`] |
//! | [`progress`] | cancelling long work, and its progress |
//!
//! Frames, units, the origin of pixels and the order of tangent vectors: `docs/reference/conventions.md`. Never depends on images,
//! files, OpenCV, threads or clocks.

#![warn(missing_docs)]

pub mod camera;
pub mod depth;
pub mod frames;
pub mod natural_order;
pub mod observations;
pub mod planar_pose;
pub mod point_error;
pub mod progress;
pub mod se3;
pub mod statistics;
pub mod targets;
#[cfg(feature = "testing")]
pub mod testing;
pub mod view_equations;

pub use nalgebra;
