//! The calibration in other formats.

pub(crate) mod state;
pub(crate) mod update;
