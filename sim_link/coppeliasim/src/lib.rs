//! A client of the remote API: connection, calls, and the typed part of `sim.*` that the workbench uses.
//!
//! | layer | what it knows |
//! | --- | --- |
//! | [`Transport`] | one request, one reply, and when the server is gone |
//! | [`Connection`] | calls, time limits, recovery |
//! | [`Sim`] | functions of `sim.*` with their types; CoppeliaSim's conventions end in [`convert`] |
//! | [`cell`] | an arm with a camera: move, stop, look, and the truth of a simulated cell |
//!
//! ```no_run
//! use handeye_coppeliasim::cell::{Arm, CellPaths};
//! use handeye_coppeliasim::{ConnectionOptions, Endpoint};
//!
//! let endpoint: Endpoint = "127.0.0.1:23000".parse()?;
//! let arm = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default())?;
//! println!("{:?}", arm.info());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Never depends on the simulated cell or its server.

#![warn(missing_docs)]

pub mod cell;
mod connection;
pub mod constants;
pub mod convert;
mod endpoint;
mod error;
mod options;
mod protocol;
mod returned;
mod sim;
mod standstill;
#[cfg(test)]
mod testing;
mod transport;

pub use connection::Connection;
pub use endpoint::{BadEndpoint, DEFAULT_PORT, Endpoint};
pub use error::LinkError;
pub use handeye_geometry::progress::CancelToken;
pub use options::{CallOptions, ConnectionOptions};
pub use returned::Returned;
pub use sim::{
    JointInterval, MotionLimits, MotionState, MotionStatus, ObjectHandle, PoseMotion, SensorOptics, Sim,
    SimulationState,
};
pub use transport::{Transport, TransportFault, ZmqTransport};
