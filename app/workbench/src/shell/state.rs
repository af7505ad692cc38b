//! The steps from a connection to exported files, and the parts of the window.

use serde::{Deserialize, Serialize};

/// Steps of a calibration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Step {
    /// Reach robot and camera.
    #[default]
    Connect,
    /// Choose the target.
    Target,
    /// Take images from many poses.
    Capture,
    /// Calibrate.
    Solve,
    /// See how good it is on captures that took no part.
    Verify,
    /// Write files.
    Export,
    /// Use the calibration: follow the board.
    Track,
}

impl Step {
    /// In their order.
    pub const ALL: [Self; 7] =
        [Self::Connect, Self::Target, Self::Capture, Self::Solve, Self::Verify, Self::Export, Self::Track];
}

/// Parts of the window that can be moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Pane {
    /// The colour image.
    Colour,
    /// The depth image.
    Depth,
    /// The captures.
    Poses,
    /// Residuals, coverage, expected accuracy.
    Charts,
    /// All messages.
    Log,
    /// Which cell.
    Connect,
    /// The target, and what is known about the camera.
    Target,
    /// Moves the arm by hand.
    Jog,
    /// Taught poses.
    Taught,
    /// The calibration.
    Result,
    /// How good it is.
    Verify,
    /// Files.
    Export,
    /// The tracked board, and the arm that follows it.
    Track,
    /// Arm, cameras and board in three dimensions.
    Scene,
}

impl Pane {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::Colour,
        Self::Depth,
        Self::Poses,
        Self::Charts,
        Self::Log,
        Self::Connect,
        Self::Target,
        Self::Jog,
        Self::Taught,
        Self::Result,
        Self::Verify,
        Self::Export,
        Self::Track,
        Self::Scene,
    ];
}

/// Windows over the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Dialog {
    /// All commands, with a text filter.
    Palette,
    /// All keys.
    Help,
    About,
    /// The address of the web viewer, if it is not opened in a browser automatically.
    RerunAddress,
    /// Where a new session goes.
    New,
    /// Which session or data set to open.
    Open,
    /// What a recording means that should be imported.
    Import,
    /// Where a copy of the session goes.
    SaveAs,
    /// Which file of taught poses to read.
    ImportPoses,
    /// Where taught poses are written.
    ExportPoses,
    /// Which file of boxes to keep out of to read.
    ImportKeepOut,
    /// Where boxes to keep out of are written.
    ExportKeepOut,
    /// Where exports go.
    ExportFolder,
}
