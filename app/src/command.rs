//! What the user wants and what the workers report, as plain data that can be logged and replayed.

use std::panic::Location;
use std::sync::Arc;

use handeye_core::dataset::CameraInput;
use handeye_core::handeye::Mode;
use handeye_core::target::TargetSpec;
use serde::{Deserialize, Serialize};

use crate::model::{
    CaptureOptions, CapturePurpose, CaptureRefused, CaptureWait, CellFacts, CellSource, DepthScale, Dialog,
    FrameImages, FrameInfo, ImagePoint, Jog, JogSettings, Link, LinkState, LiveDetection, MotionGoal, MotionId,
    MotionOutcome, Pane, RobotState, RotationFormat, Severity, Step, ThemeChoice,
};
use crate::text::{Language, Text};

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
    /// Of all words.
    SetLanguage(Language),
    /// The pointer is over a pixel of the pictures, or over none.
    PointAt(Option<ImagePoint>),
    /// Move the arm to a place, which the words name.
    Move {
        /// Where to.
        goal: MotionGoal,
        /// In words.
        what: Text,
    },
    /// A jog button is pressed: one step, or the beginning of holding it.
    Jog(Jog),
    /// It is still held. The arm stops by itself when this does not come.
    JogHeld(Jog),
    /// It was released.
    JogReleased,
    /// How the tip is jogged.
    SetJog(JogSettings),
    /// Take a capture as soon as robot and picture have settled.
    Capture(CapturePurpose),
    /// Not any more.
    CancelCapture,
    /// How captures are taken.
    SetCaptureOptions(CaptureOptions),
    /// Work with this cell, and no longer with the one before.
    Connect(CellSource),
    /// What is looked at.
    SetTarget(TargetSpec),
    /// Where the camera sits.
    SetMode(Mode),
    /// What is known of the camera beforehand.
    SetCamera(Option<CameraInput>),
    /// Take the last change of the session back.
    Undo,
    /// Make it again.
    Redo,
    /// Take the selected captures out of the session.
    DeleteSelected,
    /// Calibrate from the captures at hand.
    Solve,
    /// Put a message aside.
    DismissMessage(u64),
    /// Bring the panes of a step to the front.
    GoToStep(Step),
    /// Bring a pane to the front.
    ShowPane(Pane),
    /// Put every pane where it was at first.
    ResetLayout,
    /// Open a window over the window.
    OpenDialog(Dialog),
    /// Close it.
    CloseDialog,
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
    /// A cell was connected.
    Cell(Box<CellFacts>),
    /// A motion has ended.
    Moved {
        /// Which one.
        id: MotionId,
        /// How.
        outcome: MotionOutcome,
    },
    /// A held jog button can do no more, or may not: the arm stands.
    JogEnded {
        /// Why, when it was not released.
        why: Option<Text>,
    },
    /// The newest picture was searched for the board.
    #[serde(skip)]
    Detection(Box<LiveDetection>),
    /// The capture that is under way waits for something else.
    CaptureWaits {
        /// Its number.
        number: u64,
        /// For what.
        wait: CaptureWait,
    },
    /// There is no capture.
    CaptureRefused {
        /// Its number.
        number: u64,
        /// Why.
        refused: CaptureRefused,
    },
    /// Something to tell the user.
    Notice {
        /// How much it matters.
        severity: Severity,
        /// The words.
        text: Text,
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
