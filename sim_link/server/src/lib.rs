//! The cell as a server of CoppeliaSim's ZeroMQ remote API, protocol 2.
//!
//! The official Python client drives it unmodified. One thread owns the socket and the world; a call that takes longer
//! is answered when it is done, so no client waits for another.
//!
//! ```no_run
//! use handeye_cell::scene::Scene;
//! use handeye_server::{CellConfig, CellServer};
//! let server = CellServer::start(CellConfig::new(Scene::reference()?))?;
//! println!("listening on {}", server.endpoint());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod api;
mod args;
mod cameras;
mod cell;
mod clients;
mod engine;
mod message;
mod plans;
mod socket;
mod stage;
mod task;

use std::net::SocketAddr;
use std::thread::JoinHandle;
use std::time::Duration;

use api::Registry;
pub use cell::BuildError;
use cell::Cell;
use engine::Engine;
use handeye_cell::scene::Scene;
use socket::{Loop, Stopper};

/// Scene and address of the server.
#[derive(Debug, Clone)]
pub struct CellConfig {
    /// The cell.
    pub scene: Scene,
    /// Seed of everything random in it; the scene's own if absent.
    pub seed: Option<u64>,
    /// Address of the network interface, or a host name; `*` for all interfaces.
    pub bind: String,
    /// Port; 0 for any that is free.
    pub port: u16,
    /// Whether simulated time runs like real time; as in the scene if absent.
    pub real_time: Option<bool>,
    /// A connection without an answer for this long is gone although neither side closed it: a pulled plug, a computer
    /// that sleeps. Two seconds later its client is forgotten, with its stepping and its motions.
    pub silence: Duration,
    /// Only what CoppeliaSim has: no `handeye.*`, so clients read image and pose, stop the arm and end as they do there.
    pub coppeliasim_only: bool,
}

impl CellConfig {
    /// A scene on any free port of this machine.
    pub fn new(scene: Scene) -> Self {
        let silence = Duration::from_secs(15);
        Self {
            scene,
            seed: None,
            bind: "127.0.0.1".to_owned(),
            port: 0,
            real_time: None,
            silence,
            coppeliasim_only: false,
        }
    }
}

/// Why a cell cannot be served.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum CellError {
    /// The scene is not usable.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// Another program listens there, most likely CoppeliaSim or another cell.
    #[error(
        "port {port} on {bind} is in use: end the program that listens there, or choose another port (0 finds a free one)"
    )]
    PortInUse {
        /// Requested address.
        bind: String,
        /// Requested port.
        port: u16,
    },
    /// The address does not belong to this machine, or the port is not allowed.
    #[error("cannot listen on {bind}:{port}: {reason}; 127.0.0.1 always works")]
    Bind {
        /// Requested address.
        bind: String,
        /// Requested port.
        port: u16,
        /// The error of the operating system.
        reason: String,
    },
    /// The system refuses a socket or a thread.
    #[error("the cell's server could not be started: {operation}: {reason}")]
    System {
        /// The operation that failed.
        operation: &'static str,
        /// The error of the operating system.
        reason: String,
    },
}

/// A cell that is being served. Dropping it ends the service.
#[derive(Debug)]
pub struct CellServer {
    address: SocketAddr,
    stopper: Stopper,
    thread: Option<JoinHandle<()>>,
}

impl CellServer {
    /// Builds the cell, binds the socket and starts the thread that serves it.
    ///
    /// # Errors
    /// [`CellError`]: a scene out of range, a port in use, an address that is not this machine's.
    pub fn start(config: CellConfig) -> Result<Self, CellError> {
        let CellConfig { scene, seed, bind, port, real_time, silence, coppeliasim_only } = config;
        let cell = Cell::new(&scene, seed, real_time)?;
        let engine = Engine::new(cell, if coppeliasim_only { Registry::coppeliasim_only() } else { Registry::new() });
        let (serving, stopper) = Loop::bind(engine, &bind, port, silence)?;
        let address = serving.address();
        let thread = std::thread::Builder::new()
            .name("cell".to_owned())
            .spawn(move || serving.run())
            .map_err(|error| CellError::System { operation: "starting its thread", reason: error.to_string() })?;
        tracing::info!(%address, "the built-in cell is being served");
        Ok(Self { address, stopper, thread: Some(thread) })
    }

    /// Where it listens: `tcp://127.0.0.1:23000`.
    pub fn endpoint(&self) -> String {
        format!("tcp://{}", self.address)
    }

    /// Whether only programs of this machine can connect. There is no password: any program that can connect can move
    /// the arm.
    pub fn is_local(&self) -> bool {
        self.address.ip().to_canonical().is_loopback()
    }

    /// Ends the service and waits until the socket is closed.
    pub fn stop(self) {
        drop(self);
    }
}

impl Drop for CellServer {
    fn drop(&mut self) {
        self.stopper.stop();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the cell's thread had failed");
        }
    }
}

#[cfg(test)]
#[path = "server_tests.rs"]
mod tests;
