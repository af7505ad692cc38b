//! The board from image to image, and the arm that follows it.

pub(crate) mod pane;
