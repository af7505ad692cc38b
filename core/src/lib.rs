//! Hand-eye calibration without window or sockets: frames, cameras, targets, solvers, data sets.
//!
//! Conventions (frames, units, pixel origin, order of tangent vectors) are in `docs/conventions.md`.
//! Everything here is deterministic: no clock, no thread, no hidden seed.

pub mod camera;
pub mod depth;
pub mod frames;
pub mod handeye;
pub mod observation;
pub mod progress;
pub mod se3;
pub mod target;
#[cfg(feature = "opencv")]
pub mod vision;

pub use image;
