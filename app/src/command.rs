//! What the user wants and what the workers report, as plain data that can be logged and replayed.

use std::panic::Location;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::model::{
    DepthScale, FrameImages, FrameInfo, ImagePoint, Link, LinkState, RobotState, RotationFormat, Severity, ThemeChoice,
};

/// What the user wants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Command {
    /// Have the arm stay where it is, now.
    Stop,
    /// Let simulated time advance.
    StartSimulation,
    /// Try to connect now, without waiting for the next try.
    Reconnect,
    /// Light or dark.
    SetTheme(ThemeChoice),
    /// How rotations are written.
    SetRotationFormat(RotationFormat),
    /// Which depths the colour map covers.
    SetDepthScale(DepthScale),
    /// The pointer is over a pixel of the pictures, or over none.
    PointAt(Option<ImagePoint>),
}

/// What happened outside the thread of the window.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// Time has passed.
    Tick {
        /// The present time.
        now_s: f64,
    },
    /// A connection is in another state.
    Link {
        /// Which one.
        link: Link,
        /// How it is now.
        state: LinkState,
    },
    /// The robot was read.
    Robot(RobotState),
    /// New pictures.
    Frame {
        /// Their circumstances.
        info: FrameInfo,
        /// Frames so far that were never shown.
        dropped: u64,
        /// The pixels, which a log does not keep.
        #[serde(skip)]
        images: Option<Arc<FrameImages>>,
    },
    /// The arm was told to stay where it is.
    Stopped,
    /// Something to tell the user.
    Notice {
        /// How much it matters.
        severity: Severity,
        /// The words.
        text: String,
    },
}

/// Collects the commands of one frame of the window. They are applied after it is drawn.
#[derive(Debug, Default)]
pub struct Outbox {
    commands: Vec<(Command, &'static Location<'static>)>,
}

impl Outbox {
    /// Asks for a command, which remembers the place in the code that asked.
    #[track_caller]
    pub fn send(&mut self, command: Command) {
        self.commands.push((command, Location::caller()));
    }

    /// Whether nobody asked for anything.
    pub fn is_empty(&self) -> bool {
        self.commands.is_empty()
    }

    /// The commands in the order in which they were asked for.
    pub fn drain(&mut self) -> impl Iterator<Item = (Command, &'static Location<'static>)> + '_ {
        self.commands.drain(..)
    }
}
