//! What the workbench drives: CoppeliaSim's ZeroMQ remote API (wire, client, and a built-in simulated cell that serves it), and
//! drivers, programs that speak JSON lines.

pub mod axes;
pub mod cell;
pub mod client;
pub mod driver;
pub mod drivers;
#[cfg(feature = "testing")]
pub mod testing;
pub mod wire;
