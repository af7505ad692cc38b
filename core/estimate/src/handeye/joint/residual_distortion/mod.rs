//! Whether the data show a residual distortion of the lens beyond its model, and the effect of that on the answer.
//!
//! The [field](ResidualDistortion) is an effect as in [`super::effects`]. The degree of the polynomials and the standard
//! deviation of its coefficients are those that gain most. Corners with the field `(S + s⁻²)⁻¹ h` subtracted are
//! estimated again until it converges; the covariance of the answer has that of the coefficients added.
//!
//! Source: Henderson 1975, "Best linear unbiased estimation and prediction under a selection model"; Patterson & Thompson
//! 1971 (restricted likelihood). `docs/maths/residual_distortion.md`.

pub mod shared;

use nalgebra::DMatrix;

use super::effects::{Effect, Equations, MostLikely};
use super::{JointProblem, JointSolution, fit};
use crate::handeye::{HandEyeError, determined};
use handeye_geometry::camera::{Intrinsics, ResidualDistortion};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::{Corner, View};

/// Degrees that are tried: what a lens model leaves has more bends than the model's own terms, and beyond the highest the
/// corners of a usual board are too far apart to see one.
pub const DEGREES: [usize; 3] = [3, 5, 8];
/// Gain of twice the log-likelihood from which the field is taken into the model: by chance at most one session in a
/// hundred. Its level is at the edge of its range, so half of all healthy sessions gain nothing and the rest follows
/// chi-square with one degree of freedom (Self & Liang 1987); three degrees are tried.
const GAIN: f64 = 7.36;
/// Standard deviations of a coefficient that are tried, pixels.
const LEVELS_PX: std::ops::Range<f64> = 1e-4..1.0;
/// Most rounds of field and fit.
const MAX_ROUNDS: usize = 8;
/// Squared change of the field in a round, in its standard deviations, below which it has converged.
const STILL: f64 = 1e-2;
/// The same in the last round: an oscillation within the uncertainty is covered by it.
const AT_LAST: f64 = 1.0;

/// A field that the data show, with the basis of its estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct ShownDistortion {
    /// The field itself.
    pub field: ResidualDistortion,
    /// Standard deviation of a coefficient, pixels.
    pub level_px: f64,
    /// RMS of the field over the corners of the fit, both axes together, pixels.
    pub rms_px: f64,
    /// Gain of twice the log-likelihood over the lens model alone.
    pub gain: f64,
    /// Part of the residuals that is left after subtracting the degrees of freedom of the field.
    pub used_up: f64,
}

/// The views with a field subtracted from their corners.
pub fn corrected(views: &[View], field: &ResidualDistortion) -> Vec<View> {
    let corrected = |corner: &Corner| Corner { px: corner.px - field.at(&corner.px), ..*corner };
    views.iter().map(|view| View { corners: view.corners.iter().map(corrected).collect(), ..view.clone() }).collect()
}

/// The estimate with the residual distortion that the views of a problem show; `without` is the estimate without it. `None`
/// also when the lens is given.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn with_shown_distortion(
    problem: &JointProblem<'_>,
    without: &JointSolution,
    cancel: &CancelToken,
) -> Result<Option<(ShownDistortion, JointSolution)>, HandEyeError> {
    if !without.free.intrinsics || problem.noise.is_some() {
        return Ok(None);
    }
    let views = problem.views;
    let [.., most] = DEGREES;
    let Some(all) = Equations::new(problem, without, Effect::Distortion(most), cancel)? else { return Ok(None) };
    let mut last = None;
    let shown = settled(&without.intrinsics, &all, views, |field, degree| {
        // The estimate of the round before is not needed any more, and is large where views are many.
        last = None;
        let corrected = corrected(views, field);
        let problem = JointProblem { views: &corrected, ..*problem };
        let Some(solution) = determined(fit(&problem, &without.as_start(), cancel))? else { return Ok(None) };
        let equations = Equations::new(&problem, &solution, Effect::Distortion(degree), cancel)?;
        last = Some(solution);
        Ok(equations)
    })?;
    Ok(shown.zip(last))
}

/// Gain of twice the log-likelihood by a field over an estimate without one, before convergence; zero where none is shown.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn gain(problem: &JointProblem<'_>, without: &JointSolution, cancel: &CancelToken) -> Result<f64, HandEyeError> {
    let [.., most] = DEGREES;
    let all = Equations::new(problem, without, Effect::Distortion(most), cancel)?;
    Ok(all.and_then(|all| most_likely(&all)).map_or(0.0, |(_, level)| level.gain))
}

/// The degree and the level with the largest gain; `None` where none is shown.
fn most_likely(all: &Equations) -> Option<(usize, MostLikely)> {
    let of_degree = |degree: &usize| {
        let equations = all.up_to(*degree);
        equations.may_gain(GAIN).then(|| (*degree, equations.spectrum().most_likely(&LEVELS_PX)))
    };
    let tried = DEGREES.iter().filter_map(of_degree);
    tried.max_by(|a, b| a.1.gain.total_cmp(&b.1.gain)).filter(|(_, level)| level.gain >= GAIN)
}

/// Rounds of field and fit, from the equations `all` of an optimum without a field. `fit` makes a new optimum of the corners
/// with a field of some degree subtracted. `None` where the data show none, or none that converges; otherwise the last fit
/// is that with the returned field.
pub fn settled<'v, E>(
    intrinsics: &Intrinsics,
    all: &Equations,
    views: impl IntoIterator<Item = &'v View>,
    mut fit: impl FnMut(&ResidualDistortion, usize) -> Result<Option<Equations>, E>,
) -> Result<Option<ShownDistortion>, E> {
    let Some((degree, mut level)) = most_likely(all) else { return Ok(None) };
    let (gain, size) = (level.gain, (intrinsics.width, intrinsics.height));
    for round in 1..=MAX_ROUNDS {
        let coefficients = level.coefficients;
        let field = ResidualDistortion::new(size, degree, coefficients.as_slice().to_vec());
        let Some(equations) = fit(&field, degree)? else { return Ok(None) };
        let used_up = 1.0 - level.freedom / equations.residuals;
        if used_up <= 0.0 {
            return Ok(None);
        }
        let spectrum = equations.beyond(&coefficients).times(used_up).spectrum();
        level = spectrum.most_likely(&LEVELS_PX);
        let way = spectrum.length(&(&level.coefficients - &coefficients), level.level);
        if way < if round < MAX_ROUNDS { STILL } else { AT_LAST } {
            let rms_px = rms(views, &field);
            return Ok(Some(ShownDistortion { field, level_px: level.level, rms_px, gain, used_up }));
        }
    }
    Ok(None)
}

fn rms<'v>(views: impl IntoIterator<Item = &'v View>, field: &ResidualDistortion) -> f64 {
    let squares = views.into_iter().flat_map(|view| &view.corners).map(|corner| field.at(&corner.px).norm_squared());
    let (sum, count) = squares.fold((0.0, 0usize), |(sum, count), square| (sum + square, count + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// A solution of corners with a field subtracted, with the field's uncertainty in its covariance.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub fn with_its_error(
    problem: &JointProblem<'_>,
    solution: JointSolution,
    shown: &ShownDistortion,
    cancel: &CancelToken,
) -> Result<JointSolution, HandEyeError> {
    let Some(equations) = Equations::new(problem, &solution, Effect::Distortion(shown.field.degree()), cancel)? else {
        return Ok(solution);
    };
    let follow = equations.follow.clone();
    Ok(with_variances(solution, &follow, equations, shown))
}

/// A solution whose unknowns follow the coefficients of these equations, with their uncertainty.
fn with_variances(
    mut solution: JointSolution,
    follow: &DMatrix<f64>,
    equations: Equations,
    shown: &ShownDistortion,
) -> JointSolution {
    solution.noise.corner_px /= shown.used_up.sqrt();
    solution.covariance = enlarged(&solution.covariance, follow, equations, shown);
    solution
}

/// A covariance of unknowns that follow the coefficients of these equations, with that of the coefficients.
fn enlarged(
    covariance: &DMatrix<f64>,
    follow: &DMatrix<f64>,
    equations: Equations,
    shown: &ShownDistortion,
) -> DMatrix<f64> {
    let spectrum = equations.times(shown.used_up).spectrum();
    let follow = follow * &spectrum.axes;
    covariance / shown.used_up
        + &follow * DMatrix::from_diagonal(&spectrum.variances(shown.level_px)) * follow.transpose()
}

#[cfg(test)]
mod tests;
