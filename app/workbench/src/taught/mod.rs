//! Taught poses, and the sequence that visits them.

mod cell;
pub(crate) mod sequence;
pub mod update;
