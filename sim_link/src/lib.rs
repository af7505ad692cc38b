//! CoppeliaSim's ZeroMQ remote API: the wire, a client, and a built-in simulated cell that serves it.

pub mod axes;
pub mod cell;
pub mod client;
pub mod wire;
