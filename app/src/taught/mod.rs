//! Taught poses, and the sequence that visits them.

mod cell;
pub(crate) mod pane;
pub(crate) mod sequence;
pub(crate) mod update;
