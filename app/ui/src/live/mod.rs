//! The live images: colour, depth, and what is drawn over them.

pub(crate) mod colour_bar;
pub(crate) mod pane;
pub(crate) mod place;
pub(crate) mod project;
pub(crate) mod textures;
