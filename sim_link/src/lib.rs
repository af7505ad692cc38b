//! CoppeliaSim's ZeroMQ remote API: the wire, a client, and a built-in simulated cell that serves it.

pub mod axes;
pub mod cell;
pub mod client;
pub mod driver;
pub mod drivers;
#[cfg(feature = "testing")]
pub mod testing;
pub mod wire;
