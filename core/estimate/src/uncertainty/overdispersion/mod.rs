//! Whether the stated uncertainty is true to the data, and by how much it has to be widened where it is not.
//!
//! The covariance of the joint estimate holds if the errors of all views are independent and as large as the noise levels
//! say. Robot errors that are affine in the place are part of the estimate ([`PoseDependentError`]); what else neighbouring poses
//! have in common, and what lens and board do not follow of their models, comes back in every image, so it may be too small. Nothing but the data can tell. Each of the checks here
//! compares what they show with what the covariance promises and gives a ratio of variances with the probability of
//! one so large if the covariance were true:
//!
//! | evidence | what is compared |
//! | --- | --- |
//! | [`Evidence::Neighbours`] | robot corrections of neighbouring poses, which must not resemble each other |
//! | [`Evidence::Jackknife`] | how far the answer moves without one view |
//! | [`Evidence::CrossValidation`] | how well a view left out is predicted |
//! | [`Evidence::Lens`] | how far single views pull an estimated lens |
//!
//! The covariance is multiplied by the largest ratio among those that chance explains in fewer than one case in a
//! hundred, and by nothing if there is none. What views say of the lens widens the lens alone, and the rest as far as it
//! rests on the lens ([`with_less_known`]), whenever it is more than one: few views refute nothing, and corners that err
//! alike are the rule. All of it is done on the equations linearised at the solution: leaving a view out takes a product
//! of small matrices, not another fit.
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

pub use lens::with_less_known;
use serde::{Deserialize, Serialize};

use crate::handeye::HandEyeError;
use crate::handeye::joint::{JointProblem, JointSolution, ShownEffects};
use handeye_geometry::progress::Work;
use handeye_wording::Text;
use handeye_wording::text;

/// What a ratio was found by; see the table of [this module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Evidence {
    /// Robot corrections of neighbouring poses resemble each other.
    Neighbours,
    /// One view at a time.
    Jackknife,
    /// Prediction of views left out.
    CrossValidation,
    /// What single views say of an estimated lens.
    Lens,
}

impl Evidence {
    /// Its name in documents, `snake_case`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Neighbours => "neighbours",
            Self::Jackknife => "jackknife",
            Self::CrossValidation => "cross_validation",
            Self::Lens => "lens",
        }
    }

    /// What was seen, to complete "the stated uncertainty is widened because …".
    pub fn reason(self) -> Text {
        match self {
            Self::Neighbours => text!("the robot is off in the same direction in neighbouring poses"),
            Self::Jackknife => text!("the answer moves too far without single views"),
            Self::CrossValidation => text!("views left out are predicted worse than stated"),
            Self::Lens => text!("the views disagree about the lens"),
        }
    }
}

/// One comparison of what the data show with what the covariance promises.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// What was compared.
    pub by: Evidence,
    /// Variance shown over variance promised.
    pub ratio: f64,
    /// Probability of a ratio so large if the covariance were true.
    pub p_value: f64,
}

impl Check {
    /// Whether the covariance is refuted rather than chance at work.
    pub fn is_significant(&self) -> bool {
        self.p_value < SIGNIFICANT && self.ratio > 1.0
    }
}

/// By how much a covariance has to be widened, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Overdispersion {
    /// What the covariance is to be multiplied by, 1 or more.
    pub factor: f64,
    /// Which evidence asks for it; `None` where none refutes the covariance as it is.
    pub by: Option<Evidence>,
    /// What the covariance of an estimated lens is to be multiplied by, 1 or more; see [`with_less_known`].
    pub lens: f64,
    /// Every check that could be made, none with fewer than [`NEED`] views.
    pub checks: Vec<Check>,
}

impl Overdispersion {
    /// Whether the views disagree about an estimated lens by more than chance.
    pub fn lens_is_refuted(&self) -> bool {
        self.checks.iter().any(|check| check.by == Evidence::Lens && check.is_significant())
    }
}

/// Views from which on checks are made: with fewer no order of them is rarer than one in a hundred.
pub const NEED: usize = 6;

/// Probability below which the covariance counts as refuted. There are three checks, so three healthy sessions in a hundred are
/// widened without need at the most, which costs the others nothing.
const SIGNIFICANT: f64 = 0.01;

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
