//! The built-in simulated cell: an arm with an RGB-D camera and a board, served over the ZeroMQ remote API.

pub mod motion;
pub mod recorded;
pub mod render;
pub mod scene;
pub mod server;
pub mod world;
