//! The pose of the board from some of its corners, of which a few may be wrong, starting from a pose that is near.

use nalgebra::{Isometry3, Matrix2, Matrix6, Point3, Vector2, Vector6};

use handeye_estimate::handeye::joint::CornerWeights;
use handeye_geometry::planar_pose::mirror::mirrored;
use handeye_geometry::planar_pose::refine::{Minimum, refine};
use handeye_geometry::se3;
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::view_equations::{FreeParameters, PoseEquations, ViewInput, Whitener};

/// Residuals beyond this many standard deviations have no weight (Tukey's, 95 % efficient at 4.7).
const TUKEY: f64 = 4.7;
/// Corners further than this many standard deviations from the model are not the board's.
const INLIER: f64 = 4.5;
/// The median of a two-dimensional normal error's length is this many standard deviations.
const MEDIAN_LENGTH: f64 = 1.1774;
const ROBUST_STEPS: usize = 10;
const PLAIN_STEPS: usize = 10;
/// A step whose rotation \[rad\] and translation [part of the distance] are below this ends the robust fit: the
/// remaining error moves no corner across the limit.
const CONVERGED: f64 = 1e-4;
/// Minima closer than this angle \[rad\] are one.
const SAME_POSE_RAD: f64 = 0.01;

/// A pose that fits.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub pose: Isometry3<f64>,
    /// The given corners that belong to the board.
    pub corners: Corners,
    /// JᵀJ of these, weighed by what their detector states, by the right perturbation `[t; r]` [px²/m² and px²/rad²].
    pub information: Matrix6<f64>,
    /// Sum of their squared residuals, with the same weights \[px²\].
    pub cost: f64,
}

impl Fit {
    pub fn rms_px(&self) -> f64 {
        (self.cost / self.corners.len().max(1) as f64).sqrt()
    }
}

/// Reprojection error of each corner \[px\]; `None` when one has no image there.
fn lengths(seen: &ViewInput<'_>, pose: &Isometry3<f64>) -> Option<Vec<f64>> {
    let length = |corner: &Corner| {
        let point = pose * seen.board.point(corner.index, seen.shape);
        Some((seen.intrinsics.project(&point).ok()? - corner.px).norm())
    };
    seen.corners.iter().map(length).collect()
}

fn sigma_of(lengths: &[f64]) -> f64 {
    median_high(lengths.iter().copied()).map_or(0.0, |median| median / MEDIAN_LENGTH)
}

/// Least squares in which points that do not fit lose their weight, then plain least squares over those that fit. `floor_px` is a
/// standard deviation that is expected of good points in any case. `None` when it does not converge. `seen` is the camera and the
/// target of the corners.
pub(super) fn robust(seen: &ViewInput<'_>, corners: &Corners, start: &Isometry3<f64>, floor_px: f64) -> Option<Fit> {
    let seen = &ViewInput { corners, ..*seen };
    let mut pose = *start;
    for _ in 0..ROBUST_STEPS {
        let lengths = lengths(seen, &pose)?;
        let reach = TUKEY * sigma_of(&lengths).max(floor_px);
        // The roots of the weights.
        let tukey = |length: &f64| Matrix2::identity() * (1.0 - (length / reach).powi(2)).max(0.0);
        let whitener = Whitener::Each(lengths.iter().map(tukey).collect());
        let weighted = ViewInput { whitener: &whitener, ..*seen };
        let sums = PoseEquations::new(&weighted, &pose, FreeParameters::default()).ok()?;
        let step: Vector6<f64> = -sums.pose.cholesky()?.solve(&sums.pose_gradient);
        pose *= se3::exp(&step);
        let (shift, turn) = (step.fixed_rows::<3>(0).norm(), step.fixed_rows::<3>(3).norm());
        if shift < CONVERGED * pose.translation.vector.norm() && turn < CONVERGED {
            break;
        }
    }
    let lengths = lengths(seen, &pose)?;
    let reach = INLIER * sigma_of(&lengths).max(floor_px);
    let mut kept = corners.clone();
    let mut lengths = lengths.iter();
    kept.retain(|_| lengths.next().is_some_and(|length| *length <= reach));
    plain(seen, &pose, kept)
}

/// Least squares over some of the corners.
fn plain(seen: &ViewInput<'_>, start: &Isometry3<f64>, corners: Corners) -> Option<Fit> {
    let whitener = CornerWeights::stated(&corners).map_or(Whitener::Alike, |weights| weights.whitener(&corners));
    let Minimum { pose, squared_px, information } =
        refine(&ViewInput { corners: &corners, whitener: &whitener, ..*seen }, start, PLAIN_STEPS)?;
    Some(Fit { pose, corners, information, cost: squared_px })
}

/// The other minimum that a flat board has: its normal reflected in the line of sight to `centre`, refined. `None` when
/// there is none.
pub(super) fn other_minimum(seen: &ViewInput<'_>, fit: &Fit, centre: &Point3<f64>) -> Option<Fit> {
    let other = plain(seen, &mirrored(&fit.pose, &centre.coords)?, fit.corners.clone())?;
    (other.pose.rotation.angle_to(&fit.pose.rotation) > SAME_POSE_RAD).then_some(other)
}

/// Whether points of the board span enough of it to determine a pose: a deviation of `least_m` along its narrow side.
pub(super) fn spans(points: impl Iterator<Item = Point3<f64>> + Clone, least_m: f64) -> bool {
    let count = points.clone().count() as f64;
    if count < 4.0 {
        return false;
    }
    let mean = points.clone().map(|p| p.coords.xy()).sum::<Vector2<f64>>() / count;
    let scatter: Matrix2<f64> =
        points.map(|p| (p.coords.xy() - mean) * (p.coords.xy() - mean).transpose()).sum::<Matrix2<f64>>() / count;
    scatter.symmetric_eigenvalues().min() >= least_m * least_m
}
