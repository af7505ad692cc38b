//! How well views left out are predicted, against how well they should be.
//!
//! Without view `i`, of information `M_i` and gradient `g_i`, the unknowns are off by `d_i = (A − M_i)⁻¹ g_i` from those of all
//! views. With the normal equations `N_i`, `b_i` of its corners at the reported robot pose, the squares of its residuals become
//! `r_iᵀ r_i + 2 b_iᵀ d_i + d_iᵀ N_i d_i`, and should be
//! `tr(Jdᵀ Jd Σ_robot) + tr(N_i (A − M_i)⁻¹) + 2 corners corner_px² + 6 view_px²`.

use nalgebra::{DMatrix, DVector, Vector6};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::{Check, Evidence};
use crate::handeye::HandEyeError;
use crate::handeye::joint::normal::covariance_of;
use crate::handeye::joint::prediction::reported;
use crate::handeye::joint::view_block::{ViewBlock, prior_weight};
use crate::handeye::joint::{JointProblem, JointSolution, Noise};
use handeye_geometry::progress::Work;

/// Predicts every view from the others.
pub fn check(problem: &JointProblem<'_>, solution: &JointSolution, work: &Work<'_>) -> Result<Check, HandEyeError> {
    let fitted = solution.linearised(problem)?;
    let reported = reported(problem, solution, work.cancel)?;
    let of_view = |(block, correction): (&ViewBlock, &Vector6<f64>)| block.information(&solution.noise, correction);
    let stated: Vec<_> = fitted.blocks.iter().zip(&fitted.corrections).map(of_view).collect();
    let all = stated
        .iter()
        .flatten()
        .fold(fitted.prior_information(&solution.noise), |sum, (information, _)| sum + information);
    let mut pairs = Vec::with_capacity(stated.len());
    for (stated, seen) in stated.iter().zip(&reported.blocks) {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        // A view without which there is no answer cannot be predicted.
        let Some((information, gradient)) = stated else { continue };
        let Some(covariance) = covariance_of(&(&all - information)) else { continue };
        pairs.push(squares(seen, &(&covariance * gradient), &covariance, &solution.noise));
    }
    Ok(compare(&pairs))
}

/// Squares of the residuals of one view at its reported pose after a step: shown and predicted.
fn squares(seen: &ViewBlock, step: &DVector<f64>, covariance: &DMatrix<f64>, noise: &Noise) -> (f64, f64) {
    let shown = seen.residual.norm_squared()
        + seen.rest.squared_px
        + 2.0 * seen.shared_gradient().dot(step)
        + seen.shared_squares(step);
    let promised = seen.own.diagonal().dot(&prior_weight(noise).map(f64::recip))
        + seen.shared_trace(covariance)
        + 2.0 * seen.corners as f64 * noise.corner_px.powi(2)
        + 6.0 * noise.view_px.powi(2);
    (shown, promised)
}

/// The ratio of the sums; its probability by Student's test of the differences of the views. Squares are skewed to the
/// large side, which makes the test slow to refute.
fn compare(pairs: &[(f64, f64)]) -> Check {
    let count = pairs.len() as f64;
    let (shown, promised) = pairs.iter().fold((0.0, 0.0), |(a, b), (shown, promised)| (a + shown, b + promised));
    let mean = (shown - promised) / count;
    let variance = pairs.iter().map(|(a, b)| (a - b - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let t = mean / (variance / count).sqrt();
    let p_value = StudentsT::new(0.0, 1.0, count - 1.0).map_or(f64::NAN, |law| law.sf(t));
    Check { by: Evidence::CrossValidation, ratio: shown / promised, p_value }
}
