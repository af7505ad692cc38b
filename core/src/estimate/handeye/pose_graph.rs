//! The estimate from pose pairs alone, for sessions that kept target poses but no corners.
//!
//! Minimises `Σ |log(camera_from_target_i⁻¹ * predicted_i)|²` over `mount_from_camera` and `anchor_from_target`, with
//! translation and rotation weighted by their own scatter. Camera and robot noise cannot be told apart from pose pairs;
//! the two levels stated are those of the disagreement between them.
//!
//! Reference: Strobl & Hirzinger 2006, "Optimal hand-eye calibration", with the weights re-estimated from residuals.

use nalgebra::{Cholesky, Matrix6, SMatrix, SVector, Unit, Vector3, Vector6};

use super::closed_form::ClosedFormSolution;
use super::motion::MIN_VIEWS;
use super::{HandEyeError, PosePair};
use crate::geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use crate::geometry::se3;

/// The estimate from pose pairs.
#[derive(Debug, Clone)]
pub struct PoseGraphSolution {
    /// Hand-eye transform.
    pub mount_from_camera: Pose<Mount, Camera>,
    /// Place of the target.
    pub anchor_from_target: Pose<Anchor, Target>,
    /// Covariance of both, right perturbations, metres and radians.
    pub covariance: SMatrix<f64, 12, 12>,
    /// Disagreement per axis in translation, metres.
    pub sigma_m: f64,
    /// Disagreement per axis in rotation, radians.
    pub sigma_rad: f64,
    /// Disagreement of each pair: metres and radians.
    pub residuals: Vec<(f64, f64)>,
}

/// Steps; Gauss–Newton from a closed form needs about five, the weights a few more.
const MAX_STEPS: usize = 50;
/// A step below a tenth of a nanometre and nanoradian ends the iteration.
const STEP_TOLERANCE: f64 = 1e-10;
/// Floor of the levels, so that exact data do not divide by zero.
const LEVEL_FLOOR: f64 = 1e-12;

/// Refines a closed-form answer.
///
/// # Needs
/// Three pairs with rotations about two axes.
///
/// # Errors
/// [`HandEyeError::TooFewViews`], [`HandEyeError::NoSolution`] for a singular system.
pub fn refine(pairs: &[PosePair], start: &ClosedFormSolution) -> Result<PoseGraphSolution, HandEyeError> {
    refine_with(pairs, start, None)
}

/// Standard deviation of the open component of a camera's place beforehand, metres: farther than any camera is from the
/// origin of what carries it.
const OPEN_M: f64 = 10.0;
/// Least information on it as a part of the largest: what rounding leaves of exact data.
const LEAST_INFORMATION: f64 = 1e-9;

/// As [`refine`] where all turns are about `axis` of the mount, so that the camera's place along it is open. It has a prior
/// of 10 m about the origin of the mount, and the covariance says so; everything else comes with what its lack costs.
pub(super) fn refine_one_axis(
    pairs: &[PosePair],
    start: &ClosedFormSolution,
    axis: &Unit<Vector3<f64>>,
) -> Result<PoseGraphSolution, HandEyeError> {
    refine_with(pairs, start, Some(axis))
}

fn refine_with(
    pairs: &[PosePair],
    start: &ClosedFormSolution,
    open: Option<&Unit<Vector3<f64>>>,
) -> Result<PoseGraphSolution, HandEyeError> {
    if pairs.len() < MIN_VIEWS {
        return Err(HandEyeError::TooFewViews { got: pairs.len(), need: MIN_VIEWS });
    }
    let mut x = start.mount_from_camera;
    let mut y = start.anchor_from_target;
    let mut levels = (1e-3, 1e-3);
    let mut normal = SMatrix::<f64, 12, 12>::identity();
    for _ in 0..MAX_STEPS {
        let weight = weights(levels);
        normal = SMatrix::zeros();
        let mut gradient = SVector::<f64, 12>::zeros();
        for pair in pairs {
            let predicted = predict(pair, &x, &y);
            let residual = residual(pair, &predicted);
            let mut jacobian = SMatrix::<f64, 6, 12>::zeros();
            jacobian.fixed_view_mut::<6, 6>(0, 0).copy_from(&-se3::adjoint(&predicted.isometry().inverse()));
            jacobian.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
            let weighted = Matrix6::from_diagonal(&weight) * jacobian;
            normal += jacobian.transpose() * weighted;
            gradient += weighted.transpose() * residual;
        }
        if let Some(axis) = open {
            let mut along = SVector::<f64, 12>::zeros();
            along.fixed_rows_mut::<3>(0).copy_from(&(x.rotation().inverse() * axis.into_inner()));
            let precision = OPEN_M.powi(-2).max(LEAST_INFORMATION * normal.diagonal().max());
            normal += along * along.transpose() * precision;
            gradient += along * (precision * axis.dot(&x.translation()));
        }
        let factor = Cholesky::new(normal).ok_or(HandEyeError::NoSolution {
            method: "the pose graph",
            views: pairs.len(),
            reason: "the normal equations are singular: add views turned about other axes",
        })?;
        let step = -factor.solve(&gradient);
        x = x.perturbed(&step.fixed_rows::<6>(0).into_owned());
        y = y.perturbed(&step.fixed_rows::<6>(6).into_owned());
        let next = scatter(pairs, &x, &y);
        let settled = (next.0 / levels.0).ln().abs() < 1e-6 && (next.1 / levels.1).ln().abs() < 1e-6;
        levels = next;
        if step.norm() < STEP_TOLERANCE && settled {
            break;
        }
    }
    let covariance = normal.try_inverse().unwrap_or_else(|| SMatrix::from_element(f64::INFINITY));
    let residuals = pairs
        .iter()
        .map(|pair| {
            let r = residual(pair, &predict(pair, &x, &y));
            (r.fixed_rows::<3>(0).norm(), r.fixed_rows::<3>(3).norm())
        })
        .collect();
    Ok(PoseGraphSolution {
        mount_from_camera: x,
        anchor_from_target: y,
        covariance,
        sigma_m: levels.0,
        sigma_rad: levels.1,
        residuals,
    })
}

fn predict(pair: &PosePair, x: &Pose<Mount, Camera>, y: &Pose<Anchor, Target>) -> Pose<Camera, Target> {
    x.inverse() * pair.anchor_from_mount.inverse() * *y
}

fn residual(pair: &PosePair, predicted: &Pose<Camera, Target>) -> Vector6<f64> {
    se3::log((pair.camera_from_target.inverse() * *predicted).isometry())
}

fn weights((metres, radians): (f64, f64)) -> Vector6<f64> {
    let (t, r) = (metres.powi(-2), radians.powi(-2));
    Vector6::new(t, t, t, r, r, r)
}

/// Levels from the residuals, with the twelve unknowns' share of the degrees of freedom taken off evenly.
fn scatter(pairs: &[PosePair], x: &Pose<Mount, Camera>, y: &Pose<Anchor, Target>) -> (f64, f64) {
    let mut squares = (0.0, 0.0);
    for pair in pairs {
        let r = residual(pair, &predict(pair, x, y));
        squares.0 += r.fixed_rows::<3>(0).norm_squared();
        squares.1 += r.fixed_rows::<3>(3).norm_squared();
    }
    let freedom = 3.0 * pairs.len() as f64 - 6.0;
    ((squares.0 / freedom).sqrt().max(LEVEL_FLOOR), (squares.1 / freedom).sqrt().max(LEVEL_FLOOR))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_pairs_give_the_exact_answer_from_a_poor_start() {
        let pose =
            |k: f64| se3::exp(&Vector6::new(0.3 * k.sin(), 0.2 * k.cos(), 0.1 * k, 0.5 * k.cos(), 0.4 * k.sin(), 0.3));
        let x: Pose<Mount, Camera> = Pose::from_isometry(pose(0.3));
        let y: Pose<Anchor, Target> = Pose::from_isometry(pose(5.0));
        let pairs: Vec<PosePair> = (0..6)
            .map(|k| {
                let anchor_from_mount = Pose::from_isometry(pose(f64::from(k)));
                let camera_from_target = x.inverse() * anchor_from_mount.inverse() * y;
                PosePair { anchor_from_mount, camera_from_target }
            })
            .collect();
        let off = Vector6::new(0.02, -0.01, 0.03, 0.05, 0.04, -0.06);
        let start = ClosedFormSolution { mount_from_camera: x.perturbed(&off), anchor_from_target: y.perturbed(&off) };
        let solution = refine(&pairs, &start).expect("solves");
        let (metres, radians) = solution.mount_from_camera.distance_to(&x);
        assert!(metres < 1e-9 && radians < 1e-7, "{metres} {radians}");
    }
}
