//! Robots and cameras through programs that exchange JSON lines, on standard input and output or over TCP.
//!
//! The protocol is on one page, `docs/drivers.md`.
//!
//! | module | what it knows |
//! | --- | --- |
//! | [`message`] | what is reported, and what is wrong with a message |
//! | [`wire`] | lines and the bytes that follow them, with limits |
//! | [`Driver`] | one program: state, images, motions, log, how it ended |
//! | [`DriverHost`] | the same cell for several threads, started again when it is gone |
//! | [`limits`] | numeric requirements for one |
//! | [`conformance`] | whether a program keeps to the protocol |
//! | [`fake`] | a driver with the built-in cell behind it |
//! | [`DriverCell`] | a robot and a camera, in one program or two: images with the pose at their instant |
//!
//! ```no_run
//! use std::time::Duration;
//! use handeye_coppeliasim::CancelToken;
//! use handeye_driver::{DriverCell, DriverCellSpec, DriverOptions};
//!
//! let spec = DriverCellSpec { robot: "python3 my_driver.py".parse()?, camera: None };
//! let cancel = CancelToken::default();
//! let cell = DriverCell::start(&spec, &DriverOptions::default(), &cancel)?;
//! if let Some(frame) = cell.frame(None, Duration::from_secs(1), &cancel)? {
//!     println!("{:?}", frame.robot);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

mod cell;
mod chain;
mod client;
pub mod clock;
pub mod conformance;
mod error;
pub mod fake;
mod family;
mod host;
mod images;
mod inner;
pub mod limits;
mod link;
mod log;
pub mod message;
mod motion;
mod options;
mod pending;
mod placement;
mod rest;
mod shared;
mod spec;
mod starts;
mod states;
#[cfg(feature = "testing")]
pub mod testing;
mod threads;
pub mod wire;

pub use cell::{ClockDifference, DriverCell, DriverCellSpec, DriverFrame};
pub use client::{Driver, DriverImage, RobotNow};
pub use error::{DriverError, Ending};
pub use host::{DriverHost, NoCell};
pub use log::LogLine;
pub use message::LogLevel;
pub use motion::{Goal, MoveEnd};
pub use options::{DriverOptions, Preparing};
pub use placement::{ChainPlacement, NEED as PLACES_NEEDED};
pub use rest::{Moved, Place, RestWatch};
pub use spec::{BadSpec, DriverSpec};
pub use states::{NoPose, Reading, RobotAt};
