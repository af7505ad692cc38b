//! Whether the data show pose-dependent errors of the robot.

use super::normal::System;
use super::pose_dependent_error::Places;
use super::state::State;
use super::variance::{self, Levels};
use super::{Free, JointProblem, JointSolution, Noise, fit};
use crate::handeye::{HandEyeError, determined};
use handeye_geometry::progress::{CancelToken, Work};
use handeye_geometry::targets::observation::View;

/// Gain of minus twice the log-likelihood from which the robot's field is taken into the model: by chance one session in a
/// hundred. Both its levels are at the edge of their range, so a quarter of all healthy sessions gains nothing, one half
/// follows chi-square with one degree of freedom and the last quarter with two (Self & Liang 1987).
const GAIN: f64 = 7.29;
/// Part of the gain that the linearised equations have to show for a fit with the field: these differ from it in second order.
/// Of 1,026 simulated sessions whose fit showed a field (10 to 30 views, both set-ups, fields of half to five times the
/// robot's noise) none was missed.
const NEARLY: f64 = 0.8;
/// Standard deviation of the size of a target over the stated one, before any data: printers scale to fit, and rulers are
/// read to half a millimetre on a square of some twenty.
pub(crate) const SIZE_SIGMA: f64 = 0.03;

/// The estimate from `views` with a [`PoseDependentError`](super::PoseDependentError), when they show one; `without` is their
/// estimate without it, with the errors of the arm where these are free: then the field is what they do not explain. `None` also
/// when the noise levels are given, and with fewer than ten views.
///
/// A target of another size than stated looks like a field that grows with the distance. So the field has to be likelier
/// than another size of the target, too.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn with_shown_field<'a>(
    problem: &JointProblem<'_>,
    views: &[View],
    without: &JointSolution,
    work: impl Into<Work<'a>>,
) -> Result<Option<JointSolution>, HandEyeError> {
    if Places::for_field(views.iter().map(|view| &view.base_from_tip)).is_none() {
        return Ok(None);
    }
    let cancel = work.into().cancel;
    let problem = JointProblem { free: without.free, views, ..*problem };
    let with = JointProblem { free: Free { field: true, ..problem.free }, ..problem };
    if !gains(&with, without, cancel)? {
        return Ok(None);
    }
    let Some(with) = determined(fit(&with, &without.as_start(), cancel))? else { return Ok(None) };
    let Some((plain, field)) = without.deviance.zip(with.deviance) else { return Ok(None) };
    if plain - field < GAIN {
        return Ok(None);
    }
    if !problem.free.scale {
        let sized = JointProblem { free: Free { scale: true, ..problem.free }, ..problem };
        let sized = determined(fit(&sized, &without.as_start(), cancel))?;
        if sized.and_then(|sized| by_size(&sized)).is_some_and(|sized| sized < field) {
            return Ok(None);
        }
    }
    Ok(Some(with))
}

/// Whether the likelihood gains enough by the equations linearised without the field, which spares most sessions the fit with
/// it.
fn gains(with: &JointProblem<'_>, without: &JointSolution, cancel: &CancelToken) -> Result<bool, HandEyeError> {
    let Some(plain) = without.deviance else { return Ok(false) };
    let mut state = State { field: with.field(), ..State::of(without) };
    state.arm = state.arm.map(|arm| arm.with_field(with.arm().and_then(|none| none.field().cloned())));
    let system = System::new(with, &state, cancel)?;
    let Noise { robot_m: field_m, robot_rad: field_rad, .. } = without.noise;
    let start = Noise { field_m, field_rad, ..without.noise };
    let levels = Levels { view: start.view_px > 0.0, field: true, arm: state.arm.is_some() };
    let start = variance::lifted(&system, &start, levels);
    let found = start.and_then(|start| variance::restricted_likelihood(&system, &start, levels, variance::ROUGHLY));
    Ok(determined(found)?.is_some_and(|(_, field)| plain - field >= NEARLY * GAIN))
}

/// Minus twice the log-likelihood of an estimate whose target may be of another size, to compare with one whose size is
/// as stated: the size is integrated over its prior, as the slopes of the field are.
fn by_size(sized: &JointSolution) -> Option<f64> {
    // Together with an arm its quadratic part is among the equations already.
    let prior = if sized.free.arm { 0.0 } else { ((sized.shape.scale - 1.0) / SIZE_SIGMA).powi(2) };
    Some(sized.deviance? + 2.0 * SIZE_SIGMA.ln() + prior)
}

#[cfg(test)]
#[path = "shown_field_tests.rs"]
mod tests;
