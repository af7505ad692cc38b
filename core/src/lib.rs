//! Hand-eye calibration without window or sockets: frames, cameras, targets, solvers, data sets.
//!
//! Conventions (frames, units, pixel origin, order of tangent vectors) are in `docs/conventions.md`.
//! Everything here is deterministic: no clock, no thread, no hidden seed.

pub mod arm;
pub mod atomic_file;
pub mod board_shape;
pub mod calibrate;
pub mod camera;
pub mod capture;
pub mod coverage;
pub mod dataset;
pub mod depth;
mod digest;
pub mod doctor;
pub mod export;
pub mod findings;
pub mod findings_record;
pub mod frames;
pub mod handeye;
pub mod image_file;
pub mod intrinsics;
mod json_text;
pub mod observation;
pub mod own_folder;
pub mod planar_pose;
pub mod poses_file;
pub mod print;
pub mod progress;
pub mod result;
pub mod se3;
pub mod session;
pub mod statistics;
pub mod target;
#[cfg(feature = "testing")]
pub mod testing;
pub mod track;
pub mod verify;
#[cfg(feature = "opencv")]
pub mod vision;
pub mod wording;

pub use image;
