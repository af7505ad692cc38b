//! Whether the views agree about an estimated lens.
//!
//! The information of corners on lens and board beyond the pose of their view rests on hundreds of numbers that are taken for
//! independent. Errors that neighbours share (blur, light from one side, a print or a lens that does not follow its model
//! everywhere) make it look several times more certain than it is, most where views are little tilted or cover a part of the
//! image, because the lens then rests on small differences. The views themselves are independent, so the squares of their pulls
//! on fx, fy, cx and cy are variance shown, as for a camera without a robot.
//!
//! Print errors and residual distortion are unknowns in addition to the lens here: the part of a few views' own errors that
//! they absorb no longer pulls, and is not expected to.

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

/// Number of pinhole parameters: fx, fy, cx and cy.
const PINHOLE: usize = 4;

/// How single views agree on an estimated lens.
pub struct LensCheck {
    pub check: Check,
    /// Part of the lens's covariance that is not due to its prior, which does not scatter.
    by_views: f64,
}

impl LensCheck {
    /// Factor by which the covariance of the lens is to be multiplied, 1 or more.
    pub fn factor(&self) -> f64 {
        1.0 + (self.check.ratio - 1.0).max(0.0) * self.by_views
    }
}

/// Sum of the squared pulls of single views on the pinhole against their expectation by the covariance; `None` for a given lens,
/// and where the views do not determine it.
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
    // With the effects the score of a view is large, and not kept.
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
    // At the optimum there is no step left.
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

/// Part of the covariance `C` of the pinhole that is not due to the prior information `known` of the lens, which accounts for
/// `C P C`, in the mean of its directions.
fn by_views(covariance: &DMatrix<f64>, known: &DMatrix<f64>, lens: Range<usize>) -> Option<f64> {
    let rows = covariance.view((Layout::FORM_AT, lens.start), (PINHOLE, lens.len())).into_owned();
    let own = covariance.view((Layout::FORM_AT, Layout::FORM_AT), (PINHOLE, PINHOLE)).into_owned();
    let by_known = &rows * known.view((lens.start, lens.start), (lens.len(), lens.len())) * rows.transpose();
    Some(1.0 - own.cholesky()?.solve(&by_known).trace() / PINHOLE as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

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
