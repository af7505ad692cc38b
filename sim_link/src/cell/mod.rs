//! The built-in simulated cell: a UR5 with an RGB-D camera and a board, served over the ZeroMQ remote API.

pub mod motion;
pub mod planning;
pub mod recorded;
pub mod render;
pub mod scene;
pub mod server;
pub mod world;
