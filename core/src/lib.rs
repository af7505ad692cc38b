//! Hand-eye calibration without window or sockets: frames, cameras, targets, solvers, data sets.
//!
//! Conventions (frames, units, pixel origin, order of tangent vectors) are in `docs/conventions.md`.
//! Everything here is deterministic: no clock, no thread, no hidden seed.

pub mod capture;
pub mod depth;
#[cfg(feature = "opencv")]
pub mod detect;
pub mod diagnose;
pub mod estimate;
pub mod geometry;
pub mod progress;
pub mod project;
pub mod targets;
#[cfg(feature = "testing")]
pub mod testing;
pub mod track;
pub mod verify;
pub mod wording;

pub use image;
