//! What is weak or wrong in a set of views and its calibration, as codes and values.
//!
//! [`hypotheses`] questions what was recorded: conventions and pairing. [`findings`] state what is weak in a fit. The [`doctor`]
//! looks for faults of the session with the first and with a linear model of its own.

mod calibration;
pub mod coverage;
pub mod diagnosis;
pub mod doctor;
mod examine;
pub mod findings;
pub mod hypotheses;
mod promise;
pub mod record;
mod report;

pub use calibration::Calibration;
pub use examine::{calibrate, calibrate_with, examine};
pub use promise::{Promise, Promised};
