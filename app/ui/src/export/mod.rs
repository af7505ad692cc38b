//! The calibration in other formats.

pub(crate) mod pane;
