//! The built-in simulated cell: an arm with an RGB-D camera and a board. No protocol, no socket, no clock: `handeye_server` serves it.

pub mod recorded;
pub mod render;
pub mod scene;
pub mod world;
