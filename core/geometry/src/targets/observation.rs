//! Input of a solver: corners in an image and the pose that the robot reported for it.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix2, Vector2, Vector3, Vector6};

use crate::frames::{Base, Pose, Tip};
use crate::targets::TargetSpec;
use crate::targets::corner_covariance::CornerCovariance;
use crate::targets::depth_plane::DepthPlane;

/// One point of the target found in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Which point of the target: index into [`crate::targets::TargetSpec::points`].
    pub index: usize,
    /// Its place: column and row in pixels, (0, 0) at the centre of the top-left pixel.
    pub px: Vector2<f64>,
    /// Covariance of `px` as the detector states it, squared pixels. Only its size relative to those of the other
    /// corners matters for a solver, which estimates the level itself. `None` where nothing is stated.
    pub covariance_px2: Option<Matrix2<f64>>,
}

impl Corner {
    /// A corner whose detector states no precision.
    pub fn new(index: usize, px: Vector2<f64>) -> Self {
        Self { index, px, covariance_px2: None }
    }
}

/// The corners of one image, in any order, which only [`renumber`] may change: it is that of their covariance. Copies share them
/// until one is changed: the corners observed, judged and kept for a fit are the same, and for many views take most of the memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Corners {
    all: Arc<Vec<Corner>>,
    together: Option<Arc<CornerCovariance>>,
}

impl Corners {
    /// Corners with the covariance of all of them, in their order; where it is `None`, or for another number of corners, their
    /// errors are independent.
    pub fn together(corners: Vec<Corner>, covariance: Option<CornerCovariance>) -> Self {
        let together = covariance.filter(|it| it.len() == corners.len()).map(Arc::new);
        Self { all: Arc::new(corners), together }
    }

    /// The covariance of all corners, in their order; `None` where their errors are independent.
    pub fn covariance(&self) -> Option<&Arc<CornerCovariance>> {
        self.together.as_ref()
    }

    /// Keeps those for which a condition is true.
    pub fn retain(&mut self, mut keep: impl FnMut(&Corner) -> bool) {
        let kept: Vec<usize> = (0..self.len()).filter(|&i| keep(&self[i])).collect();
        if kept.len() < self.len() {
            self.take(&kept);
        }
    }

    /// Renumbers them; they are then sorted by number.
    fn renumber(&mut self, number: impl Fn(usize) -> usize) {
        for corner in self.iter_mut() {
            corner.index = number(corner.index);
        }
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|&i| self[i].index);
        self.take(&order);
    }

    /// Keeps those at these places, in this order.
    fn take(&mut self, places: &[usize]) {
        *self = Self {
            all: Arc::new(places.iter().map(|&i| self.all[i]).collect()),
            together: self.together.as_ref().and_then(|it| it.of(places)).map(Arc::new),
        };
    }
}

impl Deref for Corners {
    type Target = [Corner];

    fn deref(&self) -> &[Corner] {
        &self.all
    }
}

impl DerefMut for Corners {
    fn deref_mut(&mut self) -> &mut [Corner] {
        Arc::make_mut(&mut self.all).as_mut_slice()
    }
}

impl From<Vec<Corner>> for Corners {
    fn from(corners: Vec<Corner>) -> Self {
        Self { all: Arc::new(corners), together: None }
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
        self.all.iter()
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
    pub corners: Corners,
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
    /// The joints of the arm at the reported pose: entry `j` is a frame at rest whose z axis joint `j` turns about, in that of
    /// the tip. Empty where the joint angles or the arm are not known.
    pub tip_from_joints: Vec<Isometry3<f64>>,
    /// The plane of the target by the depths of the image; `None` where none were measured.
    pub depth: Option<DepthPlane>,
}

impl View {
    /// A view of a robot whose joints are not known.
    pub fn new(name: String, base_from_tip: Pose<Base, Tip>, corners: impl Into<Corners>) -> Self {
        Self { name, base_from_tip, corners: corners.into(), tip_from_joints: Vec::new(), depth: None }
    }
}

/// Derivative of the tip pose by a joint that turns about its z axis: the twist `[t; r]` per radian with which it
/// perturbs `base_from_tip` on the right, metres and radians.
pub fn tip_by_joint(tip_from_joint: &Isometry3<f64>) -> Vector6<f64> {
    let turn = tip_from_joint.rotation * Vector3::z();
    let shift = tip_from_joint.translation.vector.cross(&turn);
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// Numbers what an image shows of a target from another corner, this many of its [quarter turns](TargetSpec::quarter_turns) away;
/// the corners are then sorted by number.
pub fn renumber(corners: &mut Corners, depth: &mut Option<DepthPlane>, target: &TargetSpec, quarter_turns: usize) {
    corners.renumber(|index| target.renumbered(index, quarter_turns));
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

    /// Whatever is left out and however corners are numbered, each keeps its covariance with the others.
    #[test]
    fn the_covariance_of_all_corners_follows_them() {
        let variance = |i: usize| 0.01 * (1.0 + i as f64);
        let covariance = |places: &[usize]| {
            let of = |i: usize, j: usize| if i % 2 == j % 2 { variance(places[i / 2].min(places[j / 2])) } else { 0.0 };
            CornerCovariance::new(&nalgebra::DMatrix::from_fn(2 * places.len(), 2 * places.len(), of)).expect("one")
        };
        let corners = (0..4).map(|i| Corner::new(i, Vector2::new(i as f64, 0.0))).collect();
        let mut some = Corners::together(corners, Some(covariance(&[0, 1, 2, 3])));
        some.retain(|corner| corner.index != 1);
        some.renumber(|index| 3 - index);
        assert_eq!(
            some.iter().map(|corner| (corner.index, corner.px.x)).collect::<Vec<_>>(),
            [(0, 3.0), (1, 2.0), (3, 0.0)]
        );
        let identity = nalgebra::DMatrix::identity(6, 6);
        let found = some.covariance().expect("kept").whitened(&identity, 1.0);
        assert!((found - covariance(&[3, 2, 0]).whitened(&identity, 1.0)).amax() < 1e-9);
    }
}
