//! Whether the data may show that the target is bent, before any fit of a bent one.

use nalgebra::{Matrix2, Vector2};

use super::normal::System;
use super::state::State;
use super::variance::{self, Levels, to_logs};
use super::view_block::Layout;
use super::{JointProblem, JointSolution};
use crate::handeye::{HandEyeError, determined};
use handeye_geometry::progress::CancelToken;

/// `wᵀ C⁻¹ w / 2` of the two warps of the target, one step from a solution, with noise levels estimated again in the equations
/// linearised there. From the fit of a flat target that equals the ratio of a fit of the warps except for terms of second order.
/// `None` where these equations do not determine the warps, as for a target that is seen square on. `with` is the problem of the
/// fit, the warps free.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub(crate) fn warp_ratio(
    with: &JointProblem<'_>,
    near: &JointSolution,
    cancel: &CancelToken,
) -> Result<Option<f64>, HandEyeError> {
    Ok(determined(ratio(with, near, cancel))?.flatten())
}

fn ratio(with: &JointProblem<'_>, near: &JointSolution, cancel: &CancelToken) -> Result<Option<f64>, HandEyeError> {
    let state = State::of(near);
    let system = System::new(with, &state, cancel)?;
    let levels = Levels { view: near.noise.view_px > 0.0, field: state.has_field(), arm: state.arm.is_some() };
    let (noise, _) = variance::restricted_likelihood(&system, &to_logs(&near.noise), levels, variance::ROUGHLY)?;
    let reduced = system.reduce(&noise)?;
    let (step, covariance) = (reduced.shared_step(), reduced.inverse());
    let at = Layout::FORM_AT + with.free.form().warp_at(&state.intrinsics);
    let warp = Vector2::from(state.shape.warp_m) + step.fixed_rows::<2>(at);
    let covariance: Matrix2<f64> = covariance.fixed_view::<2, 2>(at, at).into_owned();
    Ok(covariance.try_inverse().map(|inverse| warp.dot(&(inverse * warp)) / 2.0))
}

#[cfg(test)]
#[path = "shown_warp_tests.rs"]
mod tests;
