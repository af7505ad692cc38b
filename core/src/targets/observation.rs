//! What a solver is given: corners in an image and the pose that the robot reported for it.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use nalgebra::{Matrix2, Vector2, Vector6};

use crate::geometry::frames::{Base, Pose, Tip};
use crate::targets::TargetSpec;
use crate::targets::depth_plane::DepthPlane;

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

/// The corners of one image, in any order. Copies share them until one is changed: what is observed, judged and kept for a
/// fit are the same corners, which for many views are the most of all memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Corners(Arc<Vec<Corner>>);

impl Corners {
    /// Keeps those that a condition is true of.
    pub fn retain(&mut self, keep: impl FnMut(&Corner) -> bool) {
        Arc::make_mut(&mut self.0).retain(keep);
    }
}

impl Deref for Corners {
    type Target = [Corner];

    fn deref(&self) -> &[Corner] {
        &self.0
    }
}

impl DerefMut for Corners {
    fn deref_mut(&mut self) -> &mut [Corner] {
        Arc::make_mut(&mut self.0).as_mut_slice()
    }
}

impl From<Vec<Corner>> for Corners {
    fn from(corners: Vec<Corner>) -> Self {
        Self(Arc::new(corners))
    }
}

impl FromIterator<Corner> for Corners {
    fn from_iter<T: IntoIterator<Item = Corner>>(corners: T) -> Self {
        Vec::from_iter(corners).into()
    }
}

impl<'a> IntoIterator for &'a Corners {
    type Item = &'a Corner;
    type IntoIter = std::slice::Iter<'a, Corner>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl<'a> IntoIterator for &'a mut Corners {
    type Item = &'a mut Corner;
    type IntoIter = std::slice::IterMut<'a, Corner>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

/// What one image shows of the target.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    /// Its points.
    pub corners: Vec<Corner>,
    /// Its plane by the depths of the image; `None` where none were measured.
    pub depth: Option<DepthPlane>,
}

/// One image of the target and the robot pose it was taken at.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Name of the image, for reports.
    pub name: String,
    /// Tip pose as the controller reported it.
    pub base_from_tip: Pose<Base, Tip>,
    /// The target points found; empty when the target was not found.
    pub corners: Corners,
    /// How the tip turns with each joint: entry `j` is the twist `[t; r]` per radian with which joint `j` perturbs
    /// `base_from_tip` on the right, metres and radians. Empty where the joint angles or the arm are not known.
    pub tip_by_joint: Vec<Vector6<f64>>,
    /// The plane of the target by the depths of the image; `None` where none were measured.
    pub depth: Option<DepthPlane>,
}

impl View {
    /// A view of a robot whose joints are not known.
    pub fn new(name: String, base_from_tip: Pose<Base, Tip>, corners: Vec<Corner>) -> Self {
        Self { name, base_from_tip, corners: corners.into(), tip_by_joint: Vec::new(), depth: None }
    }
}

/// Numbers what an image shows of a target from another corner, so many of its [quarter turns](TargetSpec::quarter_turns) away; the
/// corners are then sorted by number.
pub fn renumber(corners: &mut [Corner], depth: &mut Option<DepthPlane>, target: &TargetSpec, quarter_turns: usize) {
    for corner in corners.iter_mut() {
        corner.index = target.renumbered(corner.index, quarter_turns);
    }
    corners.sort_by_key(|corner| corner.index);
    *depth = depth.map(|plane| plane.renumbered(target, quarter_turns));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_share_their_corners_until_one_is_changed() {
        let first: Corners = (0..4).map(|i| Corner::new(i, Vector2::new(i as f64, 0.0))).collect();
        let mut second = first.clone();
        assert_eq!(first.as_ptr(), second.as_ptr(), "ten thousand views would be copied");
        second[0].px.x = 7.0;
        second.retain(|corner| corner.index < 2);
        assert_eq!(first.len(), 4, "whoever holds the others sees no change");
        assert_eq!(first[0].px.x, 0.0);
        assert_eq!(second.iter().map(|corner| corner.px.x).collect::<Vec<_>>(), [7.0, 1.0]);
    }
}
