//! What is weak or wrong in a set of views and its calibration, as codes and values.
//!
//! [`hypotheses`] doubts what was recorded: conventions and pairing. [`findings`] say what is weak in a fit. The [`doctor`] looks for
//! faults of the session with the first and with a linear model of its own.

mod calibration;
pub mod coverage;
pub mod doctor;
pub mod findings;
pub mod hypotheses;
mod promise;
pub mod record;

pub use calibration::{Calibration, calibrate, calibrate_with, examine};
pub use promise::{Promise, Promised};
