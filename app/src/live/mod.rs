//! The live images: colour, depth, and what is drawn over them.

pub(crate) mod colour_bar;
pub mod depth;
pub(crate) mod pane;
pub(crate) mod state;
pub(crate) mod textures;
pub(crate) mod update;
pub(crate) mod worker;
