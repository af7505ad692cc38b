//! What a solver is given: corners in an image and the pose that the robot reported for it.

use nalgebra::Vector2;

use crate::frames::{Base, Pose, Tip};

/// One point of the target found in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Which point of the target: index into [`crate::target::TargetSpec::points`].
    pub index: usize,
    /// Where: column and row in pixels, (0, 0) at the centre of the top-left pixel.
    pub px: Vector2<f64>,
}

/// One image of the target and the robot pose it was taken at.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Name of the image, for reports.
    pub name: String,
    /// Tip pose as the controller reported it.
    pub base_from_tip: Pose<Base, Tip>,
    /// The target points found; empty when the target was not found.
    pub corners: Vec<Corner>,
}
