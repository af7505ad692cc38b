//! Rigid motions, frames, cameras, arms and views of a target: mathematics that knows nothing of calibration.

pub mod arm;
pub mod camera;
pub mod frames;
pub mod planar_pose;
pub mod point_error;
pub mod se3;
pub mod statistics;
pub(crate) mod view_equations;
