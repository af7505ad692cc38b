//! The target, the camera and where it is mounted.

pub(crate) mod board;
mod drawing;
pub(crate) mod pane;
