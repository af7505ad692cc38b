//! The calibration: solving in the background, the answer with its error, charts.

pub(crate) mod charts;
pub(crate) mod pane;
