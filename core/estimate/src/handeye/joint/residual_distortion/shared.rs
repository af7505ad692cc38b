//! One residual distortion for several sessions of one camera.
//!
//! At the optimum of all sessions with one lens `ℓ`, session `j` with all but `ℓ` and the coefficients `c` eliminated has
//! the information `I_j` on both. The sum of these over the sessions, with `ℓ` eliminated, are the equations of `c`. The
//! unknowns of session `i` follow `c` directly, and through the lens that the others move.

use nalgebra::{DMatrix, DVector};

use super::{ShownDistortion, enlarged, with_variances};
use crate::handeye::HandEyeError;
use crate::handeye::joint::effects::{Effect, Equations};
use crate::handeye::joint::normal::covariance_of;
use crate::handeye::joint::shared_lens::LensEstimate;
use crate::handeye::joint::view_block::Layout;
use crate::handeye::joint::{JointProblem, JointSolution};
use handeye_geometry::progress::CancelToken;

/// The information of one session on the coefficients.
pub struct Share {
    /// Equations with the lens eliminated, given the information of the others on it.
    own: Equations,
    /// Block between lens and coefficients.
    cross: DMatrix<f64>,
    /// Information on the coefficients with the lens held.
    information: DMatrix<f64>,
    /// How the unknowns of the session respond to a gradient at the lens.
    by_lens: DMatrix<f64>,
    /// Factor by which its variances have to be multiplied.
    factor: f64,
}

impl Share {
    /// Share of a session's solution with the lens of all; `None` where it has no information.
    ///
    /// # Errors
    /// [`HandEyeError::Cancelled`], and [`HandEyeError::NoSolution`] when the solution is not one of the problem.
    pub fn new(
        problem: &JointProblem<'_>,
        solution: &JointSolution,
        degree: usize,
        factor: f64,
        cancel: &CancelToken,
    ) -> Result<Option<Self>, HandEyeError> {
        let Some(own) = Equations::new(problem, solution, Effect::Distortion(degree), cancel)? else { return Ok(None) };
        let covariance = solution.linearised(problem)?.reduce(&solution.noise)?.inverse();
        let (at, count) = (Layout::FORM_AT, solution.intrinsics.parameter_count());
        let by_lens = covariance.columns(at, count).into_owned();
        let Some(of_lens) = covariance_of(&by_lens.rows(at, count).into_owned()) else { return Ok(None) };
        let follows = own.follow.rows(at, count);
        let cross = of_lens * follows;
        let information = &own.information + follows.tr_mul(&cross);
        Ok(Some(Self { own, cross, information, by_lens, factor }))
    }
}

/// The equations of the coefficients by all sessions, whose lens is known as well as `lens`; `None` where that leaves a
/// direction open.
pub fn together(shares: &[Share], lens: &LensEstimate) -> Option<Equations> {
    let first = shares.first()?;
    let k = first.information.nrows();
    let mut information = DMatrix::zeros(k, k);
    let mut pull = DVector::zeros(k);
    for share in shares {
        information += &share.information / share.factor;
        pull += &share.own.pull / share.factor;
    }
    let cross = crossed(shares, |_| true)?;
    information -= cross.tr_mul(&(lens.covariance()? * &cross));
    let residuals = shares.iter().map(|share| share.own.residuals).sum();
    Some(Equations { information, pull, follow: DMatrix::zeros(0, k), residuals })
}

fn crossed(shares: &[Share], of: impl Fn(usize) -> bool) -> Option<DMatrix<f64>> {
    let some = shares.iter().enumerate().filter(|(j, _)| of(*j)).map(|(_, share)| &share.cross / share.factor);
    some.reduce(|sum, next| sum + next)
}

/// The covariance of the lens of all sessions with the uncertainty of the coefficients; `None` where a direction is open.
pub fn lens_covariance(
    lens: &LensEstimate,
    shares: &[Share],
    together: &Equations,
    shown: &ShownDistortion,
) -> Option<DMatrix<f64>> {
    let covariance = lens.covariance()?;
    let follow = &covariance * crossed(shares, |_| true)?;
    Some(enlarged(&covariance, &follow, together.clone(), shown))
}

/// The solution of session `i` with the uncertainty of the coefficients in its covariance.
pub fn with_shared_error(
    solution: JointSolution,
    shares: &[Share],
    i: usize,
    together: &Equations,
    shown: &ShownDistortion,
) -> JointSolution {
    let Share { own, by_lens, factor, .. } = &shares[i];
    let mut follow = own.follow.clone();
    if let Some(others) = crossed(shares, |j| j != i) {
        follow += by_lens * others * *factor;
    }
    with_variances(solution, &follow, together.clone(), shown)
}
