//! What the user chose for all cells and sessions: how things are shown, captured and judged.

use handeye_geometry::depth::ColourMap;
use handeye_plan::guided::GuidedOptions;
use serde::{Deserialize, Serialize};

use crate::capture::state::CaptureOptions;
use crate::live::state::Overlays;
use crate::motion::state::JogSettings;
use crate::text::Language;

/// Which depths the colour map covers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthScale {
    /// The depths in the image.
    #[default]
    Auto,
    /// The depths that the sensor can measure.
    Full,
}

/// Light or dark.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThemeChoice {
    /// Dark surfaces.
    #[default]
    Dark,
    /// Light surfaces.
    Light,
}

/// How the rotation of the tip is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RotationFormat {
    /// Roll, pitch, yaw in degrees, URDF's order.
    #[default]
    #[serde(rename = "rpy")]
    RollPitchYaw,
    /// Quaternion x, y, z, w.
    Quaternion,
}

/// What the window remembers from one start to the next.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ViewSettings {
    pub depth_colours: ColourMap,
    /// What is drawn over the images.
    pub overlays: Overlays,
    /// How the tip is jogged.
    pub jog: JogSettings,
    /// How captures are taken.
    pub capture: CaptureOptions,
    /// The error that is good enough.
    pub goal: Goal,
    /// Whether each move to a chosen pose waits to be confirmed; `None` asks the cell, see [`Model::confirms_moves`](crate::model::Model::confirms_moves).
    pub confirm_moves: Option<bool>,
    /// Light or dark.
    pub theme: ThemeChoice,
    /// Language of all texts.
    pub language: Language,
    /// How rotations are written.
    pub rotation: RotationFormat,
    /// Which depths the colour map covers.
    pub depth_scale: DepthScale,
}

/// An error \[m\] that is good enough, 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Goal(pub f64);

impl Default for Goal {
    /// The same as for guided capture, in the window and on the command line.
    fn default() -> Self {
        Self(GuidedOptions::default().goal_m)
    }
}
