//! What an answer owes to a lens that is taken as exact.

use nalgebra::Matrix6;

use crate::handeye::HandEyeError;
use crate::handeye::joint::normal::System;
use crate::handeye::joint::state::State;
use crate::handeye::joint::{Free, JointProblem, JointSolution, LensPrior};
use handeye_geometry::observations::KnownLens;
use handeye_geometry::point_error;
use handeye_geometry::progress::CancelToken;

/// How good a lens is of which nothing is said, pixels: programs that count pixels from the corner of the first one and from its middle
/// differ by as much, and so do good calibrations of one camera.
const USUAL_PX: f64 = 0.5;

/// What the expected error (95 %) of a point would be where [`JointSolution::reference_point`] is, if the lens were only known to half a
/// pixel, see [`KnownLens`], metres: to first order, at the noise levels of the answer. What the views themselves say of the lens counts.
/// `None` where the lens is estimated.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] where the views do not determine the rest.
pub(crate) fn error_at_half_a_pixel_95_m(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    cancel: &CancelToken,
) -> Result<Option<f64>, HandEyeError> {
    if solution.free.intrinsics {
        return Ok(None);
    }
    let usual = KnownLens { intrinsics: solution.intrinsics, accuracy_px: USUAL_PX }.information();
    let problem = JointProblem {
        free: Free { intrinsics: true, ..solution.free },
        lens_prior: Some(LensPrior { expected: solution.intrinsics, information: &usual }),
        ..*problem
    };
    let covariance = System::new(&problem, &State::of(solution), cancel)?.reduce(&solution.noise)?.inverse();
    let hand_eye: Matrix6<f64> = covariance.fixed_view::<6, 6>(0, 0).into_owned();
    let of_point = point_error::covariance(&hand_eye, &solution.reference_point);
    Ok(Some(solution.small_sample.radius_95(&of_point)))
}

#[cfg(test)]
#[path = "given_lens_tests.rs"]
mod tests;
