//! Drivers that come with the workbench: programs that read a robot or a camera and speak the [protocol](crate) on
//! their standard input and output.
//!
//! Each is a [`Device`], which connects, says what it can do, and then publishes states and images through its [`Outlet`];
//! [`serve`] answers the workbench meanwhile. All of them only read: a request to move is refused.

mod clock;
pub mod folder;
mod interpolate;
mod outlet;
pub mod rosbridge;
mod serve;
pub mod ur_rtde;
#[cfg(target_os = "linux")]
pub mod v4l;

pub use outlet::{DepthFrame, Frame, Outlet};
pub use serve::serve;

use crate::message::Hello;

/// Why a driver cannot go on, in words for the user. The workbench starts it again.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Fault(pub String);

impl Fault {
    /// Of an error, with what caused it.
    pub fn of(error: impl std::fmt::Display) -> Self {
        Self(error.to_string())
    }
}

/// A robot, a camera, or both, as a driver reads it.
pub trait Device: Send + 'static {
    /// Connects and finds out what there is, within ten seconds: the workbench waits no longer.
    ///
    /// # Errors
    /// [`Fault`] says what is wrong and what to do.
    fn open(&mut self, outlet: &Outlet) -> Result<Hello, Fault>;

    /// Publishes states and images until [`Outlet::has_ended`], which it asks at least twice a second.
    ///
    /// # Errors
    /// [`Fault`] says why it cannot go on.
    fn run(&mut self, outlet: &Outlet) -> Result<(), Fault>;
}
