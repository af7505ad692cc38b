//! The live images: colour, depth, and what is drawn over them.

pub mod depth;
pub(crate) mod state;
pub(crate) mod update;
pub(crate) mod worker;
