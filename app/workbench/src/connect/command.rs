//! Commands and events of the connection to the cell.

use handeye_coppeliasim::cell::CellPaths;
use handeye_geometry::frames::Base;
use handeye_geometry::frames::Pose;
use handeye_geometry::frames::Tip;
use serde::{Deserialize, Serialize};

use crate::connect::state::{Link, LinkState};
use crate::messages::state::Severity;
use handeye_link::{CellFacts, CellSource, RobotState};

/// What the user wants of the connection to the cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Let simulated time advance.
    StartSimulation,
    /// Try to connect now, without waiting for the next try.
    Reconnect,
    /// Stop restarting drivers that are gone, until [`Command::Reconnect`].
    StopTrying,
    /// Work with another cell.
    Connect(CellSource),
    /// Let a robot behind a driver be moved from here, or no longer.
    Arm(bool),
    /// The pose that the robot's pendant shows, where nothing reports it.
    TypePose(Pose<Base, Tip>),
    /// Say where the scene has the parts of the cell, and connect again.
    SetObjects(CellPaths),
    /// Start the built-in cell again.
    ResetCell,
}

/// What has happened to the connection to the cell.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// A connection is in another state.
    Link {
        /// Which one.
        link: Link,
        /// How it is now.
        state: LinkState,
    },
    /// The robot was read.
    Robot(RobotState),
    /// The robot's pose is no longer reported.
    NoRobot,
    /// A cell was connected.
    Cell(Box<CellFacts>),
    /// A driver sent a message for the user.
    Heard {
        /// How much it matters.
        severity: Severity,
        /// Its name and its words.
        words: String,
    },
}
