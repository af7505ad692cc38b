//! Taking a capture: one way for the vision thread of the window, for `handeye auto` and for whatever else takes one.

pub(crate) mod pane;
pub(crate) mod rows;
