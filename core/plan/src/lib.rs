//! Where to take the next views: what they would add to the answer, and whether the arm gets there without touching
//! anything.
//!
//! ```
//! use handeye_geometry::frames::{Base, Pose, Target};
//! use handeye_geometry::targets::{Grid, TargetSpec};
//! use handeye_plan::sheet;
//!
//! let board = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 });
//! let base_from_target: Pose<Base, Target> = Pose::identity();
//! // The board as something that the arm must not touch, with 2 cm about it.
//! let obstacle = sheet(&board, &base_from_target, 0.02);
//! assert!((obstacle.size_m[0] - (0.2 + 0.1 + 0.04)).abs() < 1e-12);
//! ```
//!
//! [`guided`] chooses poses one by one until the stated error is reached, [`views_of_board`] gives a set of them at once, [`Guard`]
//! checks whether a path is free. Nothing here moves an arm. Never depends on images, files or sockets.

#![warn(missing_docs)]

mod capsule;
mod carried;
mod clearance;
mod contact;
mod detour;
pub mod guided;
mod pace;
mod sight;
mod spread;
pub mod surroundings;
#[cfg(feature = "testing")]
pub mod testing;

pub use capsule::Capsule;
pub use carried::Carried;
pub use clearance::{Arm, ArmBody, travel};
pub use contact::{Contact, Guard};
pub use pace::Pace;
pub use sight::Sight;
pub use spread::{
    PlanError, PlannedView, ViewOptions, ViewSetup, order_by_travel, poses_looking_at, poses_unlike, shows_within,
    views_of_board,
};
pub use surroundings::{Obstacle, SpeedLimits, Surroundings, WorkVolume};

use nalgebra::Translation3;

use handeye_geometry::frames::{Base, Camera, Pose, Target};
use handeye_geometry::targets::TargetSpec;

/// The sheet has a margin around the pattern: its width on each side, in squares.
const SHEET_EDGE_SQUARES: f64 = 2.0;
/// Thickness of the sheet \[m\].
const SHEET_M: f64 = 0.002;

/// Edge of the cube that models a camera next to the robot, metres: a usual housing with its cable.
const CAMERA_M: f64 = 0.1;
/// Distance of the middle of that cube behind the lens, metres.
const CAMERA_BEHIND_LENS_M: f64 = 0.03;

/// The board as something that the arm must not touch, with a margin around it, metres.
pub fn sheet(target: &TargetSpec, base_from_target: &Pose<Base, Target>, room_m: f64) -> Obstacle {
    let (centre, extent, square_m) = (target.centre(), target.extent(), target.grid().square_m);
    let edge_m = |points_m: f64| points_m + 2.0 * SHEET_EDGE_SQUARES * square_m;
    let centre = base_from_target.isometry() * Translation3::new(centre.x, centre.y, SHEET_M / 2.0);
    let size_m = [edge_m(extent.x), edge_m(extent.y), SHEET_M].map(|edge_m| edge_m + 2.0 * room_m);
    Obstacle::new("board", centre, size_m)
}

/// A camera next to the robot as something that the arm must not touch, with a margin around it, metres: a cube of 10 cm,
/// of which the lens is 2 cm behind the front.
pub fn housing(base_from_camera: &Pose<Base, Camera>, room_m: f64) -> Obstacle {
    let centre = base_from_camera.isometry() * Translation3::new(0.0, 0.0, -CAMERA_BEHIND_LENS_M);
    Obstacle::new("camera", centre, [CAMERA_M + 2.0 * room_m; 3])
}
