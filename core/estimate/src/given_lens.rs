//! How an answer depends on a lens that is taken as exact.

use nalgebra::{DVector, Matrix6};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::RefutedLens;
use crate::handeye::HandEyeError;
use crate::handeye::joint::normal::{System, covariance_of};
use crate::handeye::joint::state::State;
use crate::handeye::joint::{Free, JointProblem, JointSolution, LensPrior};
use handeye_geometry::observations::KnownLens;
use handeye_geometry::point_error;
use handeye_geometry::progress::CancelToken;

/// Accuracy of a lens of which none is stated, pixels: programs that count pixels from the corner of the first one and from its
/// middle differ by as much, and so do good calibrations of one camera.
const USUAL_PX: f64 = 0.5;

/// Expected error (95 %) at [`JointSolution::reference_point`] if the lens were only known to half a pixel, see [`KnownLens`],
/// metres: what that adds to the covariance at the noise levels of the answer, to first order, times the factor `widened`. What the
/// views themselves determine of the lens counts. `None` where the lens is estimated.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] where the views do not determine the rest.
pub(crate) fn error_at_half_a_pixel_95_m(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    widened: f64,
    cancel: &CancelToken,
) -> Result<Option<f64>, HandEyeError> {
    if solution.free.intrinsics {
        return Ok(None);
    }
    let usual = KnownLens { intrinsics: solution.intrinsics, accuracy_px: USUAL_PX }.information();
    let usual_lens = JointProblem {
        free: Free { intrinsics: true, ..solution.free },
        lens_prior: Some(LensPrior { expected: solution.intrinsics, information: &usual }),
        ..*problem
    };
    let of_hand_eye = |system: &System| -> Result<Matrix6<f64>, HandEyeError> {
        Ok(system.reduce(&solution.noise)?.inverse().fixed_view::<6, 6>(0, 0).into_owned())
    };
    let with_lens = System::new(&usual_lens, &State::of(solution), cancel)?;
    let added = of_hand_eye(&with_lens)? - of_hand_eye(solution.linearised(problem)?)?;
    let hand_eye = solution.hand_eye_covariance() + added * widened;
    let of_point = point_error::covariance(&hand_eye, &solution.reference_point);
    Ok(Some(solution.small_sample.radius_95(&of_point)))
}

/// Part of the lenses that are as accurate as stated and are reported as another one.
const FALSE_ALARM: f64 = 1e-3;

/// Whether the views contradict what is stated about a lens, by the lens that they show without it: the two are independent, and
/// their difference has both covariances.
pub(crate) fn refuted(known: &KnownLens, by_views: &JointSolution) -> Option<RefutedLens> {
    let lens = by_views.lens_places();
    let parameters = by_views.intrinsics.parameters().into_iter().zip(known.intrinsics.parameters());
    let off = DVector::from_vec(parameters.map(|(shown, given)| shown - given).collect());
    if off.len() != lens.len() {
        return None;
    }
    let information = known.information();
    let of_views = by_views.covariance.view((lens.start, lens.start), (lens.len(), lens.len()));
    let both = covariance_of(&(covariance_of(&information)? + of_views))?;
    let most = ChiSquared::new(off.len() as f64).ok()?.inverse_cdf(1.0 - FALSE_ALARM);
    let off_px = off.dot(&(&information * &off)).max(0.0).sqrt() * known.accuracy_px;
    (off.dot(&(both * &off)) > most).then_some(RefutedLens { accuracy_px: known.accuracy_px, off_px })
}

#[cfg(test)]
#[path = "given_lens_tests.rs"]
mod tests;
