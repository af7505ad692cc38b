//! What a solver is given: corners in an image and the pose that the robot reported for it.

use nalgebra::{Matrix2, Vector2, Vector6};

use crate::geometry::frames::{Base, Pose, Tip};
use crate::targets::TargetSpec;

/// One point of the target found in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Which point of the target: index into [`crate::targets::TargetSpec::points`].
    pub index: usize,
    /// Where: column and row in pixels, (0, 0) at the centre of the top-left pixel.
    pub px: Vector2<f64>,
    /// Covariance of `px` as the detector states it, squared pixels. Only its size against those of the other corners
    /// counts for a solver, which finds the level itself. `None` where nothing is stated.
    pub covariance_px2: Option<Matrix2<f64>>,
}

impl Corner {
    /// A corner whose detector says nothing about its precision.
    pub fn new(index: usize, px: Vector2<f64>) -> Self {
        Self { index, px, covariance_px2: None }
    }
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
    /// How the tip turns with each joint: entry `j` is the twist `[t; r]` per radian with which joint `j` perturbs
    /// `base_from_tip` on the right, metres and radians. Empty where the joint angles or the arm are not known.
    pub tip_by_joint: Vec<Vector6<f64>>,
}

impl View {
    /// A view of a robot whose joints are not known.
    pub fn new(name: String, base_from_tip: Pose<Base, Tip>, corners: Vec<Corner>) -> Self {
        Self { name, base_from_tip, corners, tip_by_joint: Vec::new() }
    }
}

/// Numbers the corners of a [symmetric](TargetSpec::is_symmetric) target from its other end, and sorts them by number.
pub fn renumber(corners: &mut [Corner], target: &TargetSpec) {
    let count = target.points().len();
    for corner in corners.iter_mut() {
        corner.index = count - 1 - corner.index;
    }
    corners.sort_by_key(|corner| corner.index);
}
