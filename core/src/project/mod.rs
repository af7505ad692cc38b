//! What is kept: data sets, sessions, taught poses, results, exports. Files in, files out.

pub mod dataset;
pub mod export;
pub mod files;
pub mod import;
pub mod result;
pub mod session;
pub mod taught_poses;
pub mod typed_pose;
