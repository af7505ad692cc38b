//! The state of each connection to a cell.

use serde::{Deserialize, Serialize};

use crate::text::Text;
use handeye_link::CellSource;

/// The connections to the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Link {
    /// Joints, tip, simulation, stop.
    Control,
    /// Images.
    Camera,
    Motion,
}

/// How a connection is doing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum LinkState {
    /// The built-in cell is being started.
    StartingCell {
        /// Why the last try failed.
        why: Option<Text>,
    },
    /// It has never been connected yet.
    Searching {
        /// Where a server is expected.
        address: String,
        /// How many times it was tried, this one included.
        attempt: u32,
        /// Why the last try failed.
        why: Option<Text>,
    },
    /// It works.
    Connected {
        /// Where the server is.
        address: String,
        /// What it is, for example `CoppeliaSim 4.10.0`.
        server: String,
    },
    /// It worked and broke; the next try comes after a pause.
    Lost {
        /// When it broke.
        since_s: f64,
        why: Text,
        /// How many times it was tried since.
        attempt: u32,
        /// When it is tried next.
        next_s: f64,
    },
    /// It worked and broke, and is being tried right now.
    Retrying {
        /// When it broke.
        since_s: f64,
        /// Why it broke, or why the last try failed.
        why: Text,
        /// How many times it was tried since, this one included.
        attempt: u32,
    },
    /// The user does not want it to be tried.
    Resting {
        /// Why there is no connection.
        why: Text,
    },
    /// Trying again cannot help until the user does something.
    Failed {
        /// What is wrong and what to do.
        why: Text,
    },
}

impl LinkState {
    /// Whether calls get through.
    pub fn is_connected(&self) -> bool {
        matches!(self, Self::Connected { .. })
    }

    /// The state before the first try.
    pub(crate) fn first(source: &CellSource) -> Self {
        match source {
            CellSource::BuiltIn(_) => Self::StartingCell { why: None },
            CellSource::Address(address) => Self::Searching { address: address.clone(), attempt: 1, why: None },
            CellSource::Drivers(drivers) => Self::Searching { address: drivers.to_string(), attempt: 1, why: None },
        }
    }
}
