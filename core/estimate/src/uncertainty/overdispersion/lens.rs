//! Whether the views agree about an estimated lens.
//!
//! What corners say of lens and board beyond the pose of their view rests on hundreds of numbers that are taken for
//! independent. Errors that neighbours share (blur, light from one side, a print or a lens that does not follow its model
//! everywhere) make it look several times surer than it is, most where views are little tilted or cover a part of the image,
//! because the lens then rests on small differences. The views themselves are independent, so the squares of their pulls on fx,
//! fy, cx and cy are variance shown, as for a camera without a robot.
//!
//! Print errors and residual distortion are unknowns beside the lens here: what they take up of a few views' own errors pulls
//! no more, and is not expected to.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::{Check, Evidence};
use crate::handeye::HandEyeError;
use crate::handeye::joint::effects::score;
use crate::handeye::joint::normal::covariance_of;
use crate::handeye::joint::state::State;
use crate::handeye::joint::view_block::Layout;
use crate::handeye::joint::{JointProblem, JointSolution, ShownEffects};
use crate::intrinsics::evidence::scatter;
use handeye_geometry::progress::Work;

/// fx, fy, cx and cy.
const PINHOLE: usize = 4;

/// What single views say of an estimated lens.
pub struct LensCheck {
    pub check: Check,
    /// Part of the lens's covariance that is not by what is known of it beforehand, which does not scatter.
    by_views: f64,
}

impl LensCheck {
    /// What the covariance of the lens is to be multiplied by, 1 or more.
    pub fn factor(&self) -> f64 {
        1.0 + (self.check.ratio - 1.0).max(0.0) * self.by_views
    }
}

/// Sum of the squared pulls of single views on the pinhole against what the covariance makes of them; `None` for a given lens, and
/// where the views do not say.
pub fn check(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    shown: ShownEffects<'_>,
    work: &Work<'_>,
) -> Result<Option<LensCheck>, HandEyeError> {
    if !solution.free.intrinsics {
        return Ok(None);
    }
    let (system, state) = (solution.linearised(problem)?, State::of(solution));
    let Some((effects, prior)) = shown.beforehand(problem.board) else { return Ok(None) };
    let n = system.layout.count();
    let count = n + prior.nrows();
    let known = system.prior_information(&solution.noise);
    let mut information = DMatrix::zeros(count, count);
    information.view_mut((0, 0), (n, n)).copy_from(&known);
    information.view_mut((n, n), prior.shape()).copy_from(&prior);
    // With the effects that of a view is large, and not kept.
    let of_view = |view: usize| score(problem, &state, system, &solution.noise, &effects, view);
    let views = 0..system.blocks.len();
    for view in views.clone() {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let Some(score) = of_view(view) else { return Ok(None) };
        information += score.information;
    }
    let Some(covariance) = covariance_of(&information) else { return Ok(None) };
    // At the optimum nothing is left to go.
    let step = DVector::zeros(count);
    let scores = views.clone().map_while(|view| of_view(view).filter(|_| !work.is_cancelled()));
    let found = scatter(scores, &covariance, &step, (Layout::FORM_AT, PINHOLE));
    if work.is_cancelled() {
        return Err(HandEyeError::Cancelled);
    }
    let by_views = by_views(&covariance, &known, solution.lens_places());
    Ok(found.zip(by_views).filter(|(found, _)| found.ratio.is_finite()).map(|(found, by_views)| {
        // As for the answer itself: the noise levels come from six numbers per view less the twelve of the two poses.
        let of_noise = 6.0 * views.len() as f64 - 12.0;
        let law = FisherSnedecor::new(found.degrees_of_freedom, of_noise);
        let p_value = law.map_or(1.0, |law| law.sf(found.ratio));
        LensCheck { check: Check { by: Evidence::Lens, ratio: found.ratio, p_value }, by_views }
    }))
}

/// Part of the covariance `C` of the pinhole that is not by what is `known` of the lens beforehand, in the mean of its directions: that
/// is of `C P C`.
fn by_views(covariance: &DMatrix<f64>, known: &DMatrix<f64>, lens: Range<usize>) -> Option<f64> {
    let rows = covariance.view((Layout::FORM_AT, lens.start), (PINHOLE, lens.len())).into_owned();
    let own = covariance.view((Layout::FORM_AT, Layout::FORM_AT), (PINHOLE, PINHOLE)).into_owned();
    let by_known = &rows * known.view((lens.start, lens.start), (lens.len(), lens.len())) * rows.transpose();
    Some(1.0 - own.cholesky()?.solve(&by_known).trace() / PINHOLE as f64)
}

/// A covariance with that of some unknowns, as those of the lens, multiplied by a factor: what the others owe to them grows with it, and
/// what the others would be unsure of with these known stays.
///
/// With `C` the covariance and `K = C_·l C_ll⁻¹` how all unknowns follow those, it is `C + (factor − 1) K C_ll Kᵀ`.
#[must_use]
pub fn with_less_known(covariance: &DMatrix<f64>, these: Range<usize>, factor: f64) -> DMatrix<f64> {
    let of_all = covariance.columns(these.start, these.len()).into_owned();
    let own = covariance.view((these.start, these.start), (these.len(), these.len()));
    // Focal lengths and coefficients differ by many orders.
    let scale: Vec<f64> = own.diagonal().iter().map(|v| v.max(f64::MIN_POSITIVE).sqrt().recip()).collect();
    let scaled = DMatrix::from_fn(these.len(), these.len(), |i, j| own[(i, j)] * scale[i] * scale[j]);
    let Some(root) = scaled.cholesky().map(|factor| factor.l()) else { return covariance * factor };
    let to_these = DMatrix::from_fn(these.len(), of_all.nrows(), |i, j| of_all[(j, i)] * scale[i]);
    let Some(owed) = root.solve_lower_triangular(&to_these) else { return covariance * factor };
    covariance + owed.tr_mul(&owed) * (factor - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_less_known_lens_costs_what_rests_on_it_and_nothing_else() {
        // The first unknown is a quarter of the lens and some noise of its own, the second has nothing to do with it.
        let (own, lens) = (0.3f64, DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 9.0]));
        let to = [0.25, 0.0];
        let with = |times: f64| {
            let lens = &lens * times;
            let mut c = DMatrix::zeros(4, 4);
            c.view_mut((2, 2), (2, 2)).copy_from(&lens);
            let by = DVector::from_column_slice(&to);
            let cross = &lens * &by;
            for k in 0..2 {
                c[(0, 2 + k)] = cross[k];
                c[(2 + k, 0)] = cross[k];
            }
            c[(0, 0)] = by.dot(&cross) + own;
            c[(1, 1)] = 2.0;
            c
        };
        let widened = with_less_known(&with(1.0), 2..4, 5.0);
        assert!((&widened - with(5.0)).amax() < 1e-12, "{widened}");
        assert!((with_less_known(&widened, 2..4, 0.2) - with(1.0)).amax() < 1e-12);
    }

    #[test]
    fn what_is_known_of_a_lens_beforehand_is_not_by_the_views() {
        let count = Layout::FORM_AT + 9;
        let lens = Layout::FORM_AT..count;
        let part = |of_views: f64, beforehand: f64| {
            let covariance = DMatrix::from_diagonal_element(count, count, (of_views + beforehand).recip());
            by_views(&covariance, &DMatrix::from_diagonal_element(count, count, beforehand), lens.clone())
        };
        for (of_views, beforehand, expected) in [(4.0, 0.0, 1.0), (1.0, 3.0, 0.25), (1e-9, 1.0, 0.0)] {
            assert!((part(of_views, beforehand).expect("regular") - expected).abs() < 1e-6);
        }
    }
}
