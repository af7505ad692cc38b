//! How the images are looked at.

use std::path::PathBuf;

use handeye_core::verify::MeasuredPoint;
use serde::{Deserialize, Serialize};

use crate::model::ImagePoint;
use crate::text::Text;

/// What is drawn over the images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of its own, and all combinations make sense")]
pub struct Overlays {
    /// Corners that were found, coloured by row.
    pub corners: bool,
    /// The axes of the board.
    pub axes: bool,
    /// The board where robot pose and calibration say that it is.
    pub predicted: bool,
    /// Outlines of the boards of past captures.
    pub coverage: bool,
    /// Residuals as arrows.
    pub residuals: bool,
}

impl Default for Overlays {
    fn default() -> Self {
        Self { corners: true, axes: true, predicted: true, coverage: false, residuals: true }
    }
}

/// The part of the images that is shown, the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Viewport {
    /// Its middle as parts of width and height.
    pub centre: [f32; 2],
    /// How many times larger than to fit.
    pub zoom: f32,
}

impl Default for Viewport {
    fn default() -> Self {
        Self { centre: [0.5, 0.5], zoom: 1.0 }
    }
}

/// From where the 3D pane looks at the cell: an eye that circles about a point, with z of the base upwards.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SceneView {
    /// The point in the middle of the pane, in the base \[m\].
    pub centre_m: [f64; 3],
    /// Direction from there to the eye, about z of the base and counted from its x \[rad\].
    pub azimuth_rad: f64,
    /// The same over the ground: from −π/2, straight from below, to π/2, straight from above \[rad\].
    pub elevation_rad: f64,
    /// Distance of the eye from there \[m\].
    pub distance_m: f64,
}

impl Default for SceneView {
    /// Obliquely from above, with an arm of this size and what it reaches in view.
    fn default() -> Self {
        Self {
            centre_m: [0.0, -0.1, 0.45],
            azimuth_rad: -35.0_f64.to_radians(),
            elevation_rad: 22.0_f64.to_radians(),
            distance_m: 1.9,
        }
    }
}

/// A point that was picked in the live image.
#[derive(Debug, Clone)]
pub struct PickedPoint {
    /// The pixel.
    pub pixel: ImagePoint,
    /// From the depth at the pixel; or why not.
    pub from_depth: Result<MeasuredPoint, Text>,
    /// Where the ray through the pixel meets the board as PnP sees it; or why not.
    pub from_board: Result<MeasuredPoint, Text>,
}

/// The session's default place for exports.
pub fn exports_of(session: &std::path::Path) -> PathBuf {
    session.join("exports")
}
