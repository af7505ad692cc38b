//! Universal Robots' Real-Time Data Exchange: where the arm is, from the controller's port 30004. Reading only.
//!
//! # Reference
//! Universal Robots, *Real-Time Data Exchange (RTDE) Guide*: packages, version 2 of the protocol, names and types of the
//! controller's outputs.

mod client;
mod device;
mod modes;
mod sample;
pub mod wire;

pub use client::{RtdeClient, RtdeOptions};
pub use device::{UrRtde, UrRtdeOptions};
pub use sample::{Flange, Sample};

use std::time::Duration;

/// Where controllers listen.
pub const PORT: u16 = 30_004;

/// Why there is nothing to read from the controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RtdeError {
    /// No connection.
    #[error(
        "no controller answers at {address}: {why}. Check the address that the pendant shows, and that RTDE is enabled there \
         (Settings, Security, Services)"
    )]
    Unreachable {
        /// Host and port.
        address: String,
        /// What the system says.
        why: String,
    },
    /// Something else listens there, or an old controller.
    #[error(
        "the controller does not accept version 2 of RTDE, which is needed: it came with software 3.10 (CB3) and 5.4 (e-Series)"
    )]
    ProtocolRefused,
    /// Variables that every controller has are missing.
    #[error(
        "the controller has no output {names}: is it a robot of Universal Robots with software 3.10, 5.4 or newer?"
    )]
    NotFound {
        /// Their names.
        names: String,
    },
    /// A variable is of another type than the guide says.
    #[error("the controller's outputs are of the types {got}, {expected} were expected")]
    Types {
        /// What it says.
        got: String,
        /// What the guide says.
        expected: String,
    },
    /// The stream of values is not begun.
    #[error("the controller does not start the stream: {why}")]
    NotStarted {
        /// What it said, if anything.
        why: String,
    },
    /// Bytes that are no RTDE.
    #[error("this is not RTDE: {why}. Port 30004 is for RTDE; 30001 to 30003 are other interfaces")]
    Malformed {
        /// What is wrong.
        why: String,
    },
    /// Too long for a package.
    #[error("a package of {bytes} bytes is too long")]
    TooLong {
        /// Of its body.
        bytes: usize,
    },
    /// It ended.
    #[error("the controller closed the connection: was it switched off, or is another program using the same outputs?")]
    Closed,
    /// Nothing comes.
    #[error("the controller has sent nothing for {:.1} s: {during}", .waited.as_secs_f64())]
    Silent {
        /// How long.
        waited: Duration,
        /// What was awaited.
        during: &'static str,
    },
    /// The system's error of a connection.
    #[error("the connection to the controller broke: {why}")]
    Broken {
        /// What the system says.
        why: String,
    },
}

impl RtdeError {
    fn malformed(why: String) -> Self {
        Self::Malformed { why }
    }
}
