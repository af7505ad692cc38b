//! The calibration against captures that never entered its fit.

pub(crate) mod pane;
