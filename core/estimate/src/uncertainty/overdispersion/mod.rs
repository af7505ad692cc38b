//! Whether the stated uncertainty is true to the data, and by how much it has to be widened where it is not.
//!
//! The covariance of the joint estimate holds if the errors of all views are independent and as large as the noise levels
//! state. Robot errors that are affine in the place are part of the estimate ([`PoseDependentError`]); other errors that
//! neighbouring poses share, and deviations of lens and board from their models, recur in every image, so it may be too small. Only
//! the data can show that. Each of the checks here compares what they show with what the covariance predicts and gives a ratio of
//! variances with the probability of one so large if the covariance were true:
//!
//! | evidence | what is compared |
//! | --- | --- |
//! | [`Evidence::Neighbours`] | robot corrections of neighbouring poses, which must not resemble each other |
//! | [`Evidence::Jackknife`] | how far the answer moves without one view |
//! | [`Evidence::CrossValidation`] | how well a view left out is predicted |
//! | [`Evidence::Lens`] | how far single views pull an estimated lens |
//!
//! The covariance is multiplied by the largest ratio among those that chance explains in fewer than one case in a
//! hundred, and left as it is if there is none. The ratio for the lens widens the lens alone, and the rest as far as it
//! rests on the lens ([`with_less_known`]), whenever it is more than one: few views refute nothing, and common corner
//! errors are the rule. All of it is done on the equations linearised at the solution: leaving a view out takes a
//! product of small matrices, not another fit.
//!
//! [`PoseDependentError`]: crate::handeye::joint::PoseDependentError
//!
//! # Reference
//! Künsch 1989, "The jackknife and the bootstrap for general stationary observations"; Moran 1950, "Notes on
//! continuous stochastic phenomena" (neighbours); Cribari-Neto 2004 (leverage in such estimates); Good 2005, "Permutation,
//! parametric, and bootstrap tests of hypotheses".

mod cross_validation;
mod jackknife;
mod lens;
mod linear;
mod neighbours;
mod permutation;
pub(crate) mod widening;

pub use widening::{Check, Evidence, Overdispersion, with_less_known};

use crate::handeye::HandEyeError;
use crate::handeye::joint::{JointProblem, JointSolution, ShownEffects};
use handeye_geometry::progress::Work;

/// Views from which on checks are made: with fewer no order of them is rarer than one in a hundred.
pub const NEED: usize = 6;

/// Checks the covariance of a solution against its own data. The cost is linear in the number of views.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub fn check<'a>(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    shown: ShownEffects<'_>,
    work: impl Into<Work<'a>>,
) -> Result<Overdispersion, HandEyeError> {
    let work = work.into();
    if problem.views.len() < NEED {
        return Ok(Overdispersion { factor: 1.0, by: None, lens: 1.0, checks: Vec::new() });
    }
    let views = linear::views(problem, solution, &work)?;
    let mut checks =
        vec![jackknife::check(&views), neighbours::check(&views), cross_validation::check(problem, solution, &work)?];
    checks.retain(|check| check.ratio.is_finite() && check.p_value.is_finite());
    let refuting = checks.iter().filter(|c| c.is_significant());
    let largest = refuting.max_by(|a, b| a.ratio.total_cmp(&b.ratio));
    let (factor, by) = (largest.map_or(1.0, |c| c.ratio), largest.map(|c| c.by));
    let of_lens = lens::check(problem, solution, shown, &work)?;
    let lens = of_lens.as_ref().map_or(1.0, lens::LensCheck::factor);
    checks.extend(of_lens.map(|found| found.check));
    Ok(Overdispersion { factor, by, lens, checks })
}

#[cfg(test)]
mod tests;
