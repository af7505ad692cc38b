//! What is weak or wrong in a set of views and its calibration, as codes and values.

mod calibration;
pub mod coverage;
pub mod doctor;
pub mod findings;
pub mod record;

pub use calibration::{Calibration, calibrate, calibrate_with, examine};
