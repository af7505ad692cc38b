//! The target, the camera and where it is mounted.

pub(crate) mod print;
