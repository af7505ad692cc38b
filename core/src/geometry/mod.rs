//! Rigid motions, frames, cameras and arms: mathematics that knows nothing of calibration.

pub mod arm;
pub mod camera;
pub mod frames;
pub mod planar_pose;
pub mod se3;
pub mod statistics;
