//! The poses of a flat target in one image, from its corners.
//!
//! # What it estimates
//! `camera_from_target`, metres and radians, by least squares on the reprojection error in pixels, through any lens model of
//! [`crate::camera`]. A plane seen from afar looks the same when its normal is mirrored at the line of sight, so that the
//! error has two minima; both are found, to rounding accuracy, and the one with the smaller error counts as the better.
//!
//! # How
//! 1. [`homography`]: the map from the target's plane to the rays of the corners;
//! 2. [`start`]: the two poses that have value and slope of that map in the middle of the corners;
//! 3. [`refine`]: Levenberg–Marquardt from either, with the lens's own Jacobians, and with the target's own shape where it
//!    is known to be bent.
//!
//! Everything in the crate that needs the pose of a view goes through these; [`mirror`] has the second minimum from a
//! known pose.
//!
//! # Reference
//! Collins & Bartoli 2014, "Infinitesimal plane-based pose estimation", IJCV 109, for the two starts; Schweighofer & Pinz
//! 2006, "Robust pose estimation from a planar target", PAMI 28, for the two minima.

pub mod homography;
pub mod mirror;
pub mod refine;
pub mod start;

use nalgebra::{Isometry3, Matrix2, SymmetricEigen, Vector2};

use crate::camera::{CameraError, Intrinsics};
use crate::frames::{Camera, Pose, Target};
use crate::targets::TargetSpec;
use crate::targets::bent::{BoardPoints, BoardShape};
use crate::targets::observation::Corner;
use crate::view_equations::{ViewInput, Whitener};

/// Number of corners that determine a planar pose.
pub const MIN_CORNERS: usize = 4;
/// Ratio of extents below which corners count as collinear.
const MIN_FLATNESS: f64 = 1e-4;
/// Steps of one descent: a few usually, and hundreds along the valley between two minima that are about to merge.
const MAX_STEPS: usize = 500;
/// Minima whose errors per corner differ by less than this, pixels, differ by rounding.
const SAME_ERROR_PX: f64 = 1e-9;
/// Two solutions closer than this angle \[rad\] are one: a tenth of the effect of 0.1 px of corner noise on a pose.
const SAME_ROTATION: f64 = 1e-4;

/// Excess of the squared error of one minimum over the other, in units of the noise of a corner, up to which both are
/// possible. Let the true minimum be `D` better without noise; with it the difference has mean `D` and deviation `2 √D`, so
/// that the true one is worse by more than `x` with the probability `Φ(−(x + D) / (2 √D))`, at most `Φ(−√x)` whatever `D`.
/// This `x` makes it one view in a million with independent corner errors, and one in a thousand where shared errors make
/// the noise of a pose one and a half times as large.
const POSSIBLE_EXCESS: f64 = 4.75 * 4.75;

/// Why corners have no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum PoseError {
    /// The distance between points is not a valid length.
    #[error("the target's point distance of {square_m} m is not usable: it must be finite and positive")]
    BadSquare {
        /// Its value in metres.
        square_m: f64,
    },
    /// Not enough corners.
    #[error("corners in view {view}: {got}, {need} are needed; leave it out or detect it again")]
    TooFewCorners {
        /// Index of the view, 0 where there is only one.
        view: usize,
        /// Corners given.
        got: usize,
        /// Corners needed.
        need: usize,
    },
    /// A corner that is not a point of the target, is listed twice, or is NaN.
    #[error("view {view}: corner {index} at ({u_px}, {v_px}) px {reason}")]
    BadCorner {
        /// Index of the view, 0 where there is only one.
        view: usize,
        /// The corner's index.
        index: usize,
        /// Its column in pixels.
        u_px: f64,
        /// Its row in pixels.
        v_px: f64,
        /// What is wrong with the corner.
        reason: &'static str,
    },
    /// All corners of the view lie on one line, in the image or on the target, so that they do not determine a pose.
    #[error("view {view}: the corners lie on one line and fix no pose")]
    CollinearCorners {
        /// Index of the view, 0 where there is only one.
        view: usize,
    },
    /// Neither planar solution puts the whole target in front of the camera, or all corners but one lie on a line.
    #[error("no pose puts all {corners} corners in front of the camera; check the order of corners and the intrinsics")]
    NoPose {
        /// Corners given.
        corners: usize,
    },
    /// The camera model cannot be used or has no ray for a corner.
    #[error("camera model: {source}")]
    Camera {
        /// The error of the model.
        #[from]
        source: CameraError,
    },
}

/// A pose and how well it explains the corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// The target's pose in the camera.
    pub camera_from_target: Pose<Camera, Target>,
    /// Root mean square of the 2-D distances between seen and projected corners, pixels.
    pub rms_px: f64,
}

impl Solution {
    fn new(minimum: &refine::Minimum, corners: usize) -> Self {
        Self {
            camera_from_target: Pose::from_isometry(minimum.pose),
            rms_px: (minimum.squared_px / corners as f64).sqrt(),
        }
    }
}

/// The poses that a flat target may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose {
    /// The one with the smaller error.
    pub best: Solution,
    /// The other minimum of the reprojection error, roughly `best` mirrored at the line of sight; `None` where there
    /// is only one.
    pub alternative: Option<Solution>,
}

impl PlanarPose {
    /// The alternative, where with this many corners and noise of `sigma_px` per axis it may be the true pose instead of
    /// `best`: the choice needs more information than the corners of the view. At most one true pose in a million is
    /// missed.
    pub fn possible_alternative(&self, corners: usize, sigma_px: f64) -> Option<Solution> {
        let excess = |a: &Solution| corners as f64 * (a.rms_px.powi(2) - self.best.rms_px.powi(2));
        // Corners without noise have minima apart by rounding.
        let least = (SAME_ERROR_PX * SAME_ERROR_PX) * corners as f64;
        self.alternative.filter(|a| excess(a) <= (POSSIBLE_EXCESS * sigma_px * sigma_px).max(least))
    }

    /// Noise of a corner per axis by the residuals of `best`, pixels.
    pub fn sigma_px(&self, corners: usize) -> f64 {
        sigma_px(self.best.rms_px, corners)
    }

    /// The pose nearer in rotation to `expected`, of those that are possible by the noise of the corners.
    pub fn nearer_to(&self, expected: &Pose<Camera, Target>, corners: usize) -> Solution {
        match self.possible_alternative(corners, self.sigma_px(corners)) {
            Some(other) if is_nearer(&other.camera_from_target, &self.best.camera_from_target, expected) => other,
            _ => self.best,
        }
    }
}

/// Noise of a corner per axis by the residuals of a view whose pose was fitted to its corners, pixels.
pub fn sigma_px(rms_px: f64, corners: usize) -> f64 {
    let numbers = 2.0 * corners as f64;
    rms_px * (corners as f64 / (numbers - 6.0).max(1.0)).sqrt()
}

/// Whether a pose is nearer in rotation to the expected one than another: the two of a flat target differ in their
/// rotation.
pub fn is_nearer(pose: &Pose<Camera, Target>, than: &Pose<Camera, Target>, expected: &Pose<Camera, Target>) -> bool {
    let turned = |pose: &Pose<Camera, Target>| pose.rotation().angle_to(&expected.rotation());
    turned(pose) < turned(than)
}

/// The best of [`solve`] by the corners alone, where nothing else is known about the view.
///
/// # Errors
/// As [`solve`].
pub fn camera_from_target(
    corners: &[Corner],
    target: &TargetSpec,
    intrinsics: &Intrinsics,
) -> Result<Pose<Camera, Target>, PoseError> {
    solve(corners, target, intrinsics).map(|pose| pose.best.camera_from_target)
}

/// Estimates `camera_from_target` from the corners of a flat target by least squares on the reprojection error
/// `Σ ‖project(camera_from_target * corner_in_target) − corner_px‖²`, whose two minima it finds. A minimum with part of the
/// target behind the camera is dropped.
///
/// # Needs
/// Four corners, no three of them on one line where there are no more; more than half of them may not be beyond 87° from
/// the optical axis. Solutions that coincide, as those of a target seen head-on, count as one.
///
/// # Errors
/// [`PoseError::TooFewCorners`], [`PoseError::BadCorner`], [`PoseError::BadSquare`], [`PoseError::CollinearCorners`],
/// [`PoseError::Camera`] for unusable intrinsics or a corner outside the lens model, [`PoseError::NoPose`].
pub fn solve(corners: &[Corner], target: &TargetSpec, intrinsics: &Intrinsics) -> Result<PlanarPose, PoseError> {
    intrinsics.validate()?;
    check_corners(corners, target, 0)?;
    let board = BoardPoints::new(&target.points());
    let seen = ViewInput {
        intrinsics,
        board: &board,
        shape: &BoardShape::FLAT,
        corners,
        whitener: &Whitener::Alike,
        depths: None,
    };
    let pairs = corners.iter().filter_map(|corner| start::pair(&seen, corner).transpose());
    let mut solutions: Vec<Solution> = start::starts(&pairs.collect::<Result<Vec<_>, _>>()?)
        .iter()
        .flatten()
        .filter_map(|start| refine::refine(&seen, start, MAX_STEPS))
        .map(|minimum| Solution::new(&minimum, corners.len()))
        .collect();
    solutions.sort_by(|a, b| a.rms_px.total_cmp(&b.rms_px));
    let mut solutions = solutions.into_iter();
    let best = solutions.next().ok_or(PoseError::NoPose { corners: corners.len() })?;
    let alternative = solutions.find(|other| {
        other.camera_from_target.rotation().angle_to(&best.camera_from_target.rotation()) > SAME_ROTATION
    });
    Ok(PlanarPose { best, alternative })
}

/// The other minimum of the reprojection error of a view, from a pose near it; `None` where there is only one.
pub fn other(seen: &ViewInput<'_>, best: &Solution, near: &Isometry3<f64>) -> Option<Solution> {
    let minimum = refine::refine(seen, near, MAX_STEPS)?;
    let is_other = minimum.pose.rotation.angle_to(&best.camera_from_target.rotation()) > SAME_ROTATION;
    is_other.then(|| Solution::new(&minimum, seen.corners.len()))
}

/// Checks that the corners of view `view` are points of the target, are finite and span a plane.
pub fn check_corners(corners: &[Corner], target: &TargetSpec, view: usize) -> Result<(), PoseError> {
    let grid = target.grid();
    if !(grid.square_m.is_finite() && grid.square_m > 0.0) {
        return Err(PoseError::BadSquare { square_m: grid.square_m });
    }
    if corners.len() < MIN_CORNERS {
        return Err(PoseError::TooFewCorners { view, got: corners.len(), need: MIN_CORNERS });
    }
    let mut taken = vec![false; grid.len()];
    for corner in corners {
        let bad = |reason| {
            let (u_px, v_px) = (corner.px.x, corner.px.y);
            Err(PoseError::BadCorner { view, index: corner.index, u_px, v_px, reason })
        };
        if !(corner.px.x.is_finite() && corner.px.y.is_finite()) {
            return bad("is not a number");
        }
        match taken.get_mut(corner.index) {
            None => return bad("is no point of the target; check its columns and rows"),
            Some(true) => return bad("is listed twice"),
            Some(slot) => *slot = true,
        }
    }
    let on_target: Vec<Vector2<f64>> = corners.iter().map(|c| target.point(c.index).coords.xy()).collect();
    let in_image: Vec<Vector2<f64>> = corners.iter().map(|c| c.px).collect();
    if is_collinear(&on_target) || is_collinear(&in_image) {
        return Err(PoseError::CollinearCorners { view });
    }
    Ok(())
}

fn is_collinear(points: &[Vector2<f64>]) -> bool {
    let mean = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let scatter: Matrix2<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let extents = SymmetricEigen::new(scatter).eigenvalues;
    extents.min() <= MIN_FLATNESS * MIN_FLATNESS * extents.max()
}

#[cfg(test)]
mod tests;
