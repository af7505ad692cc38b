//! The calibration in other formats.

pub(crate) mod pane;
pub(crate) mod state;
pub(crate) mod update;
