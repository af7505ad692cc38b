//! Taught poses, and the sequence that visits them.

pub(crate) mod pane;
