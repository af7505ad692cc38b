//! One file a format. Each turns files into series of poses, or says that they are none of its.

pub(super) mod blocks;
pub(super) mod board_words;
pub(super) mod corners;
pub(super) mod easy_handeye;
pub(super) mod industrial_calibration;
pub(super) mod intrinsics;
pub(super) mod joints;
pub(super) mod moveit;
mod named;
mod names;
pub(super) mod npz;
pub(super) mod parts;
pub(super) mod program;
pub(super) mod rosbag;
pub(super) mod single;
pub(super) mod table;
pub(super) mod text_camera;
pub(super) mod tree;
pub(super) mod visp;
pub(super) mod xml;
