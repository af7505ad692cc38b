//! The size of the target as the robot's motion shows it.
//!
//! The answer takes the stated size for true. With the size free in addition to all else that it includes (a bend, the robot's
//! field, a lens) the same fit determines how large the target is, and with what uncertainty: with a field, which another size
//! resembles, it may not be determined at all.

use nalgebra::{SVector, Vector6};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::TargetSize;
use super::handeye::joint::{self, Free, JointProblem, JointSolution, SIZE_SIGMA};
use super::handeye::{HandEyeError, determined};
use super::stated_uncertainty::Alternative;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;

/// Probability of a false alarm per hypothesis about the data, after allowance for the alternatives among which the best was
/// picked. One in ten thousand, because noise of real robots has longer tails than a Gaussian.
pub(crate) const FALSE_ALARM: f64 = 1e-4;

/// Relative size below which another size, however certain, is left alone: a print is true to a few parts in a thousand, and the
/// common error of the lengths of an arm is as large.
pub(crate) const LEAST_SCALE: f64 = 3e-3;

impl TargetSize {
    /// The same with all variances this many times as large, because the data show that they are.
    #[must_use]
    pub(super) fn widened(mut self, factor: f64) -> Self {
        self.sigma *= factor.sqrt();
        self.with.covariance *= factor;
        self
    }

    /// Whether the stated size is ruled out.
    pub(crate) fn is_another(&self) -> bool {
        (self.scale - 1.0).abs() > self.found_from()
    }

    /// Whether a size that is off by as much as prints and rulers are would be found.
    pub fn is_determined(&self) -> bool {
        self.found_from() < SIZE_SIGMA
    }

    /// Relative difference from which another size is detected.
    fn found_from(&self) -> f64 {
        let law = FisherSnedecor::new(1.0, self.degrees_of_freedom.clamp(1.0, 1e6));
        law.map_or(f64::INFINITY, |f| f.inverse_cdf(1.0 - FALSE_ALARM).sqrt()) * self.sigma
    }
}

/// The size of the target by an estimate of `problem`; `None` where it does not determine it.
pub(super) fn size(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    cancel: &CancelToken,
) -> Result<Option<TargetSize>, HandEyeError> {
    let free = Free { scale: true, ..problem.free };
    let sized = JointProblem { free, view_noise: Some(solution.noise.view_px > 0.0), ..*problem };
    let found = if problem.free.scale {
        Some(solution.clone())
    } else {
        determined(joint::fit(&sized, &solution.as_start(), cancel))?
    };
    let Some(found) = found else { return Ok(None) };
    let Some(sigma) = found.scale_sigma().filter(|sigma| sigma.is_finite() && *sigma > 0.0) else { return Ok(None) };
    let scale = found.shape.scale;
    // The prior of sizes pulls the size towards the stated one, and the transform with it.
    let (variance, known) = (sigma * sigma, SIZE_SIGMA * SIZE_SIGMA);
    let at = 12 + found.free.form().scale_at(&found.intrinsics);
    let with_size: SVector<f64, 6> = found.covariance.fixed_view::<6, 1>(0, at).into_owned();
    let drawn: Vector6<f64> = with_size * ((1.0 - scale) / (variance + known));
    let covariance = found.hand_eye_covariance() - with_size * with_size.transpose() / (variance + known);
    let there = found.hand_eye.mount_from_camera().perturbed(&drawn);
    let shift = se3::log((solution.hand_eye.mount_from_camera().inverse() * there).isometry());
    let degrees_of_freedom = solution.small_sample.degrees_of_freedom;
    Ok(Some(TargetSize { scale, sigma, degrees_of_freedom, with: Alternative { shift, covariance } }))
}
