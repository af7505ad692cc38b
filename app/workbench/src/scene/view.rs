//! The viewpoint of the 3D pane.

use serde::{Deserialize, Serialize};

/// Angle that the shorter side of a picture takes in: narrow enough that nothing is distorted at its edges \[rad\].
pub const OPENING_RAD: f64 = 38.0 * std::f64::consts::PI / 180.0;
/// Direction from the middle to the eye about z of the base, counted from its x: obliquely from the front \[rad\].
pub const AZIMUTH_RAD: f64 = -35.0 * std::f64::consts::PI / 180.0;
/// The same over the ground \[rad\].
pub const ELEVATION_RAD: f64 = 22.0 * std::f64::consts::PI / 180.0;

/// The viewpoint of the 3D pane: an eye that orbits a point, with z of the base upwards.
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
    /// Obliquely from above, with an arm of this size and its reach in view.
    fn default() -> Self {
        Self { centre_m: [0.0, -0.1, 0.45], azimuth_rad: AZIMUTH_RAD, elevation_rad: ELEVATION_RAD, distance_m: 1.9 }
    }
}
