//! Where to take the next views from: what they would add to the answer, and whether the arm gets there without touching
//! anything.

mod clearance;
pub mod links;
mod spread;

pub use clearance::{Arm, ArmBody, Obstacle};
pub use spread::{
    PlanError, PlannedView, ViewOptions, ViewSetup, order_by_travel, poses_looking_at, poses_unlike,
    random_poses_looking_at, travel, views_of_board,
};
