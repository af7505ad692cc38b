//! The pose of the board from some of its corners, of which a few may be wrong, starting from a pose that is near.

use nalgebra::{Isometry3, Matrix6, Point3, Unit, UnitQuaternion, Vector2, Vector3, Vector6};

use crate::camera::Intrinsics;
use crate::se3;
use crate::statistics::median_high;
use crate::vision::pnp::px_by_pose;

/// A point of the board and where it is seen.
pub(super) type Seen = (Point3<f64>, Vector2<f64>);

/// Residuals beyond this many standard deviations have no weight (Tukey's, 95 % efficient at 4.7).
const TUKEY: f64 = 4.7;
/// Corners further than this many standard deviations from the model are not the board's.
const INLIER: f64 = 4.5;
/// The median of a two-dimensional normal error's length is this many standard deviations.
const MEDIAN_LENGTH: f64 = 1.1774;
const ROBUST_STEPS: usize = 10;
const PLAIN_STEPS: usize = 10;
/// A step whose rotation \[rad\] and translation [part of the distance] are below this ends the fit: a hundredth of what
/// the noise of good corners does.
const CONVERGED: f64 = 1e-7;
/// Below this angle \[rad\] between normal and line of sight the two planar solutions are one.
const SAME_POSE_RAD: f64 = 0.01;

/// A pose that fits.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub pose: Isometry3<f64>,
    /// Which of the points given are the board's.
    pub inliers: Vec<bool>,
    /// JᵀJ of the inliers by the right perturbation `[t; r]` [px²/m² and px²/rad²].
    pub information: Matrix6<f64>,
    /// Sum of squared residuals of the inliers \[px²\].
    pub cost: f64,
}

impl Fit {
    pub fn count(&self) -> usize {
        self.inliers.iter().filter(|inlier| **inlier).count()
    }

    pub fn rms_px(&self) -> f64 {
        (self.cost / self.count().max(1) as f64).sqrt()
    }
}

struct Normal {
    cost: f64,
    hessian: Matrix6<f64>,
    gradient: Vector6<f64>,
}

/// Sums over the points with weights; `None` when a point that counts has no image.
fn normal(
    seen: &[Seen],
    camera: &Intrinsics,
    pose: &Isometry3<f64>,
    weight: impl Fn(usize, f64) -> f64,
) -> Option<Normal> {
    let mut out = Normal { cost: 0.0, hessian: Matrix6::zeros(), gradient: Vector6::zeros() };
    let rotation = pose.rotation.to_rotation_matrix();
    let mut lower = [0.0; 21];
    for (i, (point, px)) in seen.iter().enumerate() {
        let projection = camera.project_with_jacobians(&(pose * point)).ok()?;
        let residual = projection.px - px;
        let w = weight(i, residual.norm());
        if w <= 0.0 {
            continue;
        }
        let j = px_by_pose(&projection.px_by_point, rotation.matrix(), point);
        out.cost += w * residual.norm_squared();
        // By hand: this loop is half of the time of a fit.
        let mut slot = 0;
        for row in 0..6 {
            let (a, b) = (w * j[(0, row)], w * j[(1, row)]);
            out.gradient[row] += a * residual.x + b * residual.y;
            for column in 0..=row {
                lower[slot] += a * j[(0, column)] + b * j[(1, column)];
                slot += 1;
            }
        }
    }
    let mut slot = 0;
    for row in 0..6 {
        for column in 0..=row {
            out.hessian[(row, column)] = lower[slot];
            out.hessian[(column, row)] = lower[slot];
            slot += 1;
        }
    }
    out.cost.is_finite().then_some(out)
}

fn lengths(seen: &[Seen], camera: &Intrinsics, pose: &Isometry3<f64>) -> Option<Vec<f64>> {
    seen.iter().map(|(point, px)| Some((camera.project(&(pose * point)).ok()? - px).norm())).collect()
}

fn sigma_of(lengths: &[f64]) -> f64 {
    median_high(lengths.iter().copied()).map_or(0.0, |median| median / MEDIAN_LENGTH)
}

/// Least squares in which points that do not fit lose their weight, then plain least squares over those that fit.
/// `floor_px` is a standard deviation that is expected of good points in any case. `None` when it does not converge.
pub(super) fn robust(seen: &[Seen], camera: &Intrinsics, start: &Isometry3<f64>, floor_px: f64) -> Option<Fit> {
    let mut pose = *start;
    for _ in 0..ROBUST_STEPS {
        let reach = TUKEY * sigma_of(&lengths(seen, camera, &pose)?).max(floor_px);
        let tukey = |_: usize, length: f64| (1.0 - (length / reach).powi(2)).max(0.0).powi(2);
        let sums = normal(seen, camera, &pose, tukey)?;
        let step: Vector6<f64> = -sums.hessian.cholesky()?.solve(&sums.gradient);
        pose *= se3::exp(&step);
        if is_small(&step, &pose, 1e3 * CONVERGED) {
            break;
        }
    }
    let lengths = lengths(seen, camera, &pose)?;
    let reach = INLIER * sigma_of(&lengths).max(floor_px);
    plain(seen, camera, &pose, lengths.iter().map(|length| *length <= reach).collect())
}

/// Damped least squares over the points that count.
pub(super) fn plain(seen: &[Seen], camera: &Intrinsics, start: &Isometry3<f64>, inliers: Vec<bool>) -> Option<Fit> {
    let weight = |i: usize, _: f64| if inliers[i] { 1.0 } else { 0.0 };
    let mut pose = *start;
    let mut sums = normal(seen, camera, &pose, weight)?;
    let mut damping = 1e-9;
    for _ in 0..PLAIN_STEPS {
        let mut damped = sums.hessian;
        for i in 0..6 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step: Vector6<f64> = -damped.cholesky()?.solve(&sums.gradient);
        let candidate = pose * se3::exp(&step);
        match normal(seen, camera, &candidate, weight) {
            Some(better) if better.cost <= sums.cost => {
                (pose, sums) = (candidate, better);
                damping *= 0.1;
            }
            _ => damping = f64::max(damping * 100.0, 1e-6),
        }
        if is_small(&step, &pose, CONVERGED) || damping > 1e6 {
            break;
        }
    }
    Some(Fit { pose, inliers, information: sums.hessian, cost: sums.cost })
}

fn is_small(step: &Vector6<f64>, pose: &Isometry3<f64>, limit: f64) -> bool {
    let distance = pose.translation.vector.norm();
    step.fixed_rows::<3>(0).norm() < limit * distance && step.fixed_rows::<3>(3).norm() < limit
}

/// The other minimum that a flat board has: its normal mirrored at the line of sight to `centre`, refined. `None` when
/// there is none.
pub(super) fn mirrored(seen: &[Seen], camera: &Intrinsics, fit: &Fit, centre: &Point3<f64>) -> Option<Fit> {
    let middle = fit.pose * centre;
    let sight = Unit::try_new(middle.coords, 1e-12)?;
    let normal = fit.pose.rotation * Vector3::z();
    let angle = sight.angle(&normal);
    let axis = Unit::try_new(sight.cross(&normal), 1e-12)?;
    if angle < SAME_POSE_RAD {
        return None;
    }
    let rotation = UnitQuaternion::from_axis_angle(&axis, -2.0 * angle) * fit.pose.rotation;
    let start = Isometry3::from_parts((middle.coords - rotation * centre.coords).into(), rotation);
    let other = plain(seen, camera, &start, fit.inliers.clone())?;
    (other.pose.rotation.angle_to(&fit.pose.rotation) > SAME_POSE_RAD).then_some(other)
}

/// Whether points of the board span enough of it to fix a pose: a deviation of `least_m` along its narrow side.
pub(super) fn spans(points: impl Iterator<Item = Point3<f64>> + Clone, least_m: f64) -> bool {
    let count = points.clone().count() as f64;
    if count < 4.0 {
        return false;
    }
    let mean = points.clone().map(|p| p.coords.xy()).sum::<Vector2<f64>>() / count;
    let scatter: nalgebra::Matrix2<f64> =
        points.map(|p| (p.coords.xy() - mean) * (p.coords.xy() - mean).transpose()).sum::<nalgebra::Matrix2<f64>>()
            / count;
    scatter.symmetric_eigenvalues().min() >= least_m * least_m
}
