//! Where to take the next views from: what they would add to the answer, and whether the arm gets there without touching
//! anything.

mod clearance;
pub mod guided;
pub mod links;
mod spread;

pub use clearance::{Arm, ArmBody, Obstacle, travel};
pub use spread::{
    PlanError, PlannedView, ViewOptions, ViewSetup, order_by_travel, poses_looking_at, poses_unlike,
    random_poses_looking_at, views_of_board,
};

use nalgebra::Translation3;

use crate::geometry::frames::{Base, Pose, Target};
use crate::targets::TargetSpec;

/// What is printed on has an edge about the pattern; this much of it on each side, in squares.
const SHEET_EDGE_SQUARES: f64 = 2.0;
/// Thickness of what is printed on \[m\].
const SHEET_M: f64 = 0.002;

/// The board as something that the arm must not touch.
pub fn sheet(target: &TargetSpec, base_from_target: &Pose<Base, Target>) -> Obstacle {
    let (centre, extent, square_m) = (target.centre(), target.extent(), target.grid().square_m);
    let edge_m = |points_m: f64| points_m + 2.0 * SHEET_EDGE_SQUARES * square_m;
    Obstacle {
        world_from_centre: base_from_target.isometry() * Translation3::new(centre.x, centre.y, SHEET_M / 2.0),
        size_m: [edge_m(extent.x), edge_m(extent.y), SHEET_M],
    }
}
