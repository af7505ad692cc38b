//! The part of `sim.*` that the workbench uses, typed.
//!
//! Reference frames are always passed, and setters take `(object, frame, value)`: an order that every version accepts.

mod control;
mod motion;
mod objects;
mod sensors;
mod shapes;
mod simulation_state;

use ciborium::Value;

pub use motion::{MotionLimits, MotionState, MotionStatus, PoseMotion};
pub use sensors::SensorOptics;

pub use simulation_state::SimulationState;

use super::connection::Connection;
use super::constants;
use super::endpoint::Endpoint;
use super::error::LinkError;
use super::options::{CallOptions, ConnectionOptions};
use super::returned::Returned;

/// An object of the scene, as the simulator numbers it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ObjectHandle(pub i64);

impl ObjectHandle {
    /// The world as a reference frame.
    pub const WORLD: Self = Self(constants::HANDLE_WORLD);
    /// The object's parent as a reference frame.
    pub const PARENT: Self = Self(constants::HANDLE_PARENT);

    /// Handles go over the wire as integers: as a float the simulator ignores or refuses them.
    fn to_value(self) -> Value {
        Value::from(self.0)
    }
}

/// The range of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointInterval {
    /// It turns without end.
    pub cyclic: bool,
    /// Lower end (rad, or m of a prismatic joint).
    pub min: f64,
    /// Upper end (rad, or m of a prismatic joint).
    pub max: f64,
}

/// Typed calls over one [`Connection`].
pub struct Sim {
    connection: Connection,
}

impl Sim {
    /// Over a connection.
    pub fn new(connection: Connection) -> Self {
        Self { connection }
    }

    /// Over a new connection, see [`Connection::connect`].
    ///
    /// # Errors
    /// As [`Connection::connect`].
    pub fn connect(endpoint: &Endpoint, options: ConnectionOptions) -> Result<Self, LinkError> {
        Ok(Self::new(Connection::connect(endpoint, options)?))
    }

    /// The connection, for calls that have no method here.
    pub fn connection(&mut self) -> &mut Connection {
        &mut self.connection
    }

    fn call(&mut self, func: &str, args: Vec<Value>) -> Result<Returned, LinkError> {
        self.connection.call(func, args)
    }

    fn call_with(&mut self, func: &str, args: Vec<Value>, options: &CallOptions) -> Result<Returned, LinkError> {
        self.connection.call_with(func, args, options)
    }
}

#[cfg(test)]
mod tests;
