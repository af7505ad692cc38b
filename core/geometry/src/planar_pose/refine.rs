//! The minimum of the reprojection error of one view, from a pose near it.

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::se3;
use crate::view_equations::{FreeParameters, PoseEquations, ViewInput};

/// A step whose rotation \[rad\] and translation [part of the distance] are below this ends the descent: rounding.
const CONVERGED: f64 = 1e-12;
/// First damping relative to the diagonal, and the least value to which a failed step raises it.
const DAMPING: f64 = 1e-6;
/// Past this damping a step is too small to matter.
const LARGEST_DAMPING: f64 = 1e8;

/// End of a descent.
#[derive(Debug, Clone)]
pub struct Minimum {
    /// `camera_from_target`.
    pub pose: Isometry3<f64>,
    /// `Σ ‖W r‖²` there: squared pixels where there are no whiteners.
    pub squared_px: f64,
    /// `JᵀJ` there by the right perturbation `[t; r]` of the pose, px²/m² and px²/rad².
    pub information: Matrix6<f64>,
}

/// Levenberg–Marquardt over `start * exp(delta)` on `Σ ‖W (project(camera_from_target * point) − px)‖²`, with lens and
/// shape of the target as given, in at most `steps` steps.
///
/// `None` when the start has a corner without image, which no later step would correct. Where the corners do not
/// determine a pose the descent ends where they no longer determine a direction.
pub fn refine(seen: &ViewInput<'_>, start: &Isometry3<f64>, steps: usize) -> Option<Minimum> {
    let at = |pose: &Isometry3<f64>| {
        PoseEquations::new(seen, pose, FreeParameters::default()).ok().filter(|there| there.squared_px.is_finite())
    };
    let (mut pose, mut equations) = (*start, at(start)?);
    let mut damping = DAMPING;
    for _ in 0..steps {
        let mut damped = equations.pose;
        for i in 0..6 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let Some(factor) = damped.cholesky() else { break };
        let step: Vector6<f64> = -factor.solve(&equations.pose_gradient);
        let next = pose * se3::exp(&step);
        match at(&next) {
            Some(there) if there.squared_px <= equations.squared_px => {
                (pose, equations) = (next, there);
                damping *= 0.1;
            }
            _ => damping = f64::max(damping * 10.0, DAMPING),
        }
        let distance = pose.translation.vector.norm();
        let (shift, turn) = (step.fixed_rows::<3>(0).norm(), step.fixed_rows::<3>(3).norm());
        if (shift < CONVERGED * distance && turn < CONVERGED) || damping > LARGEST_DAMPING {
            break;
        }
    }
    Some(Minimum { pose, squared_px: equations.squared_px, information: equations.pose })
}
