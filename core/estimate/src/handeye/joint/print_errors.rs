//! Whether the data show that the points of the target are displaced from the drawing, and the effect of that on the answer.
//!
//! A printer, a bitmap and a plotter displace every point of a target a little, equally in all views. The errors within the
//! plane are an effect as in [`super::effects`], with the covariance `s² K`. The usual errors of prints are in `K`, in shares
//! that the data determine:
//!
//! - independent errors of each point,
//! - errors that a column of points has along x and a row along y, as where lines are drawn on the pixels of a bitmap,
//! - errors that are smooth over the target, as of paper that stretches or a feed that is uneven.
//!
//! A shift and a turn of all points together are the place of the target, not errors. `K` is scaled so that `s` is the RMS
//! per axis. All shares and levels that are likely are integrated over: the errors are the mean of their posterior, and its
//! covariance is added to that of the answer. The size of the target is taken as stated except for the effect of errors of
//! that level on it.
//!
//! The errors are put into the target and the fit is repeated until they converge.
//!
//! Source: `docs/maths/print_errors.md`.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Point3, Vector2};

use super::effects::{Effect, Equations, Spectrum, levels};
use super::normal::covariance_of;
use super::view_block::Layout;
use super::{JointProblem, JointSolution, fit};
use crate::handeye::{HandEyeError, determined};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::BoardPoints;

/// Gain of twice the log-likelihood from which print errors are taken into the model: by chance at most one session in a
/// thousand. Half of all healthy sessions gain nothing, the rest follows chi-square with one degree of freedom (Self & Liang
/// 1987), and shares of three kinds are tried.
const GAIN: f64 = 11.6;
/// RMS per axis that is tried, metres: a ten-thousandth of a millimetre is negligible, and ten millimetres are another
/// target.
const LEVELS_M: Range<f64> = 1e-7..1e-2;
/// Shares of columns and rows, and of smooth errors, that are tried; the rest are independent errors of each point.
const SHARES: [f64; 3] = [0.0, 0.45, 0.9];
/// Points of a target above which no errors are searched for: the equations of twice as many unknowns take a second then,
/// and the errors of this many points average out.
const MOST_POINTS: usize = 150;
/// Distance over which smooth errors change, in terms of the longer side of the target.
const SMOOTH: f64 = 0.5;
/// Weight in terms of the largest below which a level does not count.
const NO_WEIGHT: f64 = 1e-4;
/// Part of all weights below which shares do not count in further rounds.
const UNLIKELY: f64 = 1e-2;
/// Most rounds of errors and fit.
const MAX_ROUNDS: usize = 8;
/// Squared change of the errors in a round, in standard deviations of their estimate by the views, below which they have
/// converged.
const STILL: f64 = 1e-2;
/// The same in the last round: an oscillation within the uncertainty is covered by it.
const AT_LAST: f64 = 1.0;

/// Errors of a print that the data show.
#[derive(Debug, Clone, PartialEq)]
pub struct PrintErrors {
    /// Error of every point of the target along its x and y, metres: its true place less the drawn one.
    pub errors_m: Vec<Vector2<f64>>,
    /// Standard deviation of each of them per axis, metres.
    pub sigma_m: Vec<f64>,
    /// Gain of twice the log-likelihood over a target as drawn.
    pub gain: f64,
    /// Part of the residuals that is left after subtracting the degrees of freedom of the errors.
    used_up: f64,
    /// The shares that are likely.
    shares: Vec<Shares>,
}

/// Parts of the variance: errors of columns and rows, and smooth errors over the target.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shares {
    lines: f64,
    smooth: f64,
}

impl Shares {
    fn all() -> Vec<Self> {
        let pairs = SHARES.iter().flat_map(|lines| SHARES.iter().map(move |smooth| (*lines, *smooth)));
        let possible = pairs.filter(|(lines, smooth)| lines + smooth < 1.0);
        possible.map(|(lines, smooth)| Self { lines, smooth }).collect()
    }
}

impl PrintErrors {
    /// RMS of the errors per axis, metres.
    pub fn rms_m(&self) -> f64 {
        let squares: f64 = self.errors_m.iter().map(Vector2::norm_squared).sum();
        (squares / (2 * self.errors_m.len()).max(1) as f64).sqrt()
    }

    /// The largest of them, metres.
    pub fn largest_m(&self) -> f64 {
        self.errors_m.iter().map(Vector2::norm).fold(0.0, f64::max)
    }

    /// A target with these errors.
    pub(crate) fn on(&self, drawn: &BoardPoints) -> BoardPoints {
        drawn.displaced(&self.errors_m)
    }

    /// What is known of the errors before any view, as an information matrix in the order of the points along x and then along y:
    /// their most likely kinds, of the size that they were found to have. `board` has the errors.
    pub(crate) fn prior_information(&self, board: &BoardPoints) -> Option<DMatrix<f64>> {
        let kinds = self.kinds(board);
        let covariances = kinds.roots.iter().map(|(_, root)| root * root.transpose());
        let mean = covariances.reduce(|a, b| a + b)? / kinds.roots.len() as f64;
        let unknown: f64 =
            self.sigma_m.iter().map(|sigma| sigma * sigma).sum::<f64>() / self.sigma_m.len().max(1) as f64;
        covariance_of(&(mean * (self.rms_m().powi(2) + unknown)))
    }

    /// The likely kinds, on a target that has the errors.
    fn kinds(&self, board: &BoardPoints) -> Kinds {
        let back: Vec<Vector2<f64>> = self.errors_m.iter().map(|error| -error).collect();
        Kinds::of(board.displaced(&back).drawn(), &self.shares)
    }

    fn coefficients(&self) -> DVector<f64> {
        let axis = |k: usize| self.errors_m.iter().map(move |error| error[k]);
        DVector::from_iterator(2 * self.errors_m.len(), axis(0).chain(axis(1)))
    }
}

/// The estimate from the views of a problem with the print errors that they show; `without` is the estimate without them. The
/// target of the problem is as drawn. `None` also when the noise levels are given, and when the lens is: errors of a wrong lens
/// would be taken for print errors.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn with_shown_print(
    problem: &JointProblem<'_>,
    without: &JointSolution,
    cancel: &CancelToken,
) -> Result<Option<(PrintErrors, JointSolution)>, HandEyeError> {
    if problem.noise.is_some() || !without.free.intrinsics || problem.board.len() > MOST_POINTS {
        return Ok(None);
    }
    let Some(equations) = Equations::new(problem, without, Effect::Print, cancel)? else { return Ok(None) };
    if !equations.may_gain(GAIN) {
        return Ok(None);
    }
    let posterior = Posterior::of(&equations, &Kinds::of(problem.board.drawn(), &Shares::all()), cancel)?;
    if posterior.gain < GAIN {
        return Ok(None);
    }
    let Some(shown) = posterior.shown(posterior.gain, equations.residuals) else { return Ok(None) };
    let board = shown.on(problem.board);
    let with = JointProblem { board: &board, ..*problem };
    let Some(solution) = determined(fit(&with, &without.as_start(), cancel))? else { return Ok(None) };
    settled(problem, shown, solution, cancel)
}

/// Errors and an estimate with them, in rounds until the errors converge; `None` where they do not.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub fn settled(
    problem: &JointProblem<'_>,
    mut shown: PrintErrors,
    mut solution: JointSolution,
    cancel: &CancelToken,
) -> Result<Option<(PrintErrors, JointSolution)>, HandEyeError> {
    let kinds = Kinds::of(problem.board.drawn(), &shown.shares);
    for round in 1..=MAX_ROUNDS {
        let board = shown.on(problem.board);
        let with = JointProblem { board: &board, ..*problem };
        let Some(equations) = Equations::new(&with, &solution, Effect::Print, cancel)? else { return Ok(None) };
        let before = shown.coefficients();
        let equations = equations.beyond(&before).times(shown.used_up);
        let posterior = Posterior::of(&equations, &kinds, cancel)?;
        let way = &posterior.mean - before;
        let length = way.dot(&(&equations.information * &way));
        if length < if round < MAX_ROUNDS { STILL } else { AT_LAST } {
            return Ok(Some((shown, solution)));
        }
        let Some(next) = posterior.shown(shown.gain, equations.residuals) else { return Ok(None) };
        shown = next;
        let board = shown.on(problem.board);
        let with = JointProblem { board: &board, ..*problem };
        let Some(next) = determined(fit(&with, &solution.as_start(), cancel))? else { return Ok(None) };
        solution = next;
    }
    Ok(None)
}

/// What the errors add to the covariance of the lens, in units of its information: where that is `I`, they add `I⁻¹ G I⁻¹`.
/// `problem` has the target with the errors.
///
/// # Errors
/// As [`with_its_error`].
pub fn lens_unknown(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    shown: &PrintErrors,
    cancel: &CancelToken,
) -> Result<Option<DMatrix<f64>>, HandEyeError> {
    let Some((equations, posterior)) = at_end(problem, solution, shown, cancel)? else { return Ok(None) };
    let (at, count) = (Layout::FORM_AT, solution.intrinsics.parameter_count());
    let covariance = solution.linearised(problem)?.reduce(&solution.noise)?.inverse();
    let lens = covariance.view((at, at), (count, count)).into_owned();
    let Some(information) = covariance_of(&lens) else { return Ok(None) };
    let pulled = information * equations.follow.rows(at, count);
    Ok(Some(&pulled * &posterior.covariance * pulled.transpose()))
}

fn at_end(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    shown: &PrintErrors,
    cancel: &CancelToken,
) -> Result<Option<(Equations, Posterior)>, HandEyeError> {
    let Some(equations) = Equations::new(problem, solution, Effect::Print, cancel)? else { return Ok(None) };
    let equations = equations.beyond(&shown.coefficients()).times(shown.used_up);
    let posterior = Posterior::of(&equations, &shown.kinds(problem.board), cancel)?;
    Ok(Some((equations, posterior)))
}

/// A solution with print errors in its target, with their uncertainty in its covariance, and the standard
/// deviations of the errors; `problem` has that target.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub fn with_its_error(
    problem: &JointProblem<'_>,
    mut solution: JointSolution,
    shown: &PrintErrors,
    cancel: &CancelToken,
) -> Result<(JointSolution, Vec<f64>), HandEyeError> {
    let Some((equations, posterior)) = at_end(problem, &solution, shown, cancel)? else {
        return Ok((solution, shown.sigma_m.clone()));
    };
    let follow = &equations.follow;
    solution.noise.corner_px /= shown.used_up.sqrt();
    solution.covariance = &solution.covariance / shown.used_up + follow * &posterior.covariance * follow.transpose();
    Ok((solution, posterior.sigma_m()))
}

/// Roots of the covariances `K`: `K = B Bᵀ`.
struct Kinds {
    roots: Vec<(Shares, DMatrix<f64>)>,
}

impl Kinds {
    fn of(points: &[Point3<f64>], shares: &[Shares]) -> Self {
        let n = points.len();
        let rigid = rigid(points);
        let side = points.iter().flat_map(|a| points.iter().map(move |b| (a - b).abs().max())).fold(0.0, f64::max);
        let together = |of_axis: &dyn Fn(usize, usize, usize) -> f64| {
            let mut kernel = DMatrix::zeros(2 * n, 2 * n);
            for axis in [0, 1] {
                let block = DMatrix::from_fn(n, n, |i, j| of_axis(axis, i, j));
                kernel.view_mut((axis * n, axis * n), (n, n)).copy_from(&block);
            }
            without(&rigid, kernel)
        };
        let same = |axis: usize, i: usize, j: usize| (points[i][axis] - points[j][axis]).abs() < 1e-6 * side;
        let lines = together(&|axis, i, j| f64::from(u8::from(same(axis, i, j))));
        let smooth = together(&|_, i, j| {
            let apart = (points[i] - points[j]).norm() / (SMOOTH * side);
            (-0.5 * apart * apart).exp()
        });
        let single = together(&|_, i, j| f64::from(u8::from(i == j)));
        let roots = shares.iter().filter_map(|shares| {
            let rest = 1.0 - shares.lines - shares.smooth;
            let kernel = &lines * shares.lines + &smooth * shares.smooth + &single * rest;
            // Rigid motions have no error at all, and zero cannot be divided by.
            let least = DMatrix::identity(2 * n, 2 * n) * NO_ERROR;
            Cholesky::new(kernel + least).map(|factor| (*shares, factor.l()))
        });
        Self { roots: roots.collect() }
    }
}

/// Relative variance of an error that counts as zero.
const NO_ERROR: f64 = 1e-6;

/// Shifts of all points along x and along y and their turn, as orthonormal columns.
fn rigid(points: &[Point3<f64>]) -> DMatrix<f64> {
    let n = points.len();
    let middle = points.iter().map(|point| point.coords).sum::<nalgebra::Vector3<f64>>() / n.max(1) as f64;
    let mut columns = DMatrix::zeros(2 * n, 3);
    for (i, point) in points.iter().enumerate() {
        let from_middle = point.coords - middle;
        (columns[(i, 0)], columns[(n + i, 1)]) = (1.0, 1.0);
        (columns[(i, 2)], columns[(n + i, 2)]) = (-from_middle.y, from_middle.x);
    }
    for mut column in columns.column_iter_mut() {
        let length = column.norm();
        if length > 0.0 {
            column /= length;
        }
    }
    columns
}

/// A covariance without rigid motions, scaled to a mean variance of one.
fn without(rigid: &DMatrix<f64>, kernel: DMatrix<f64>) -> DMatrix<f64> {
    let half = &kernel - rigid * (rigid.tr_mul(&kernel));
    let whole = &half - (&half * rigid) * rigid.transpose();
    let mean = whole.trace() / whole.nrows().max(1) as f64;
    if mean > 0.0 { whole / mean } else { kernel }
}

/// Posterior of the errors by the views, over all kinds and levels.
struct Posterior {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Gain of the most likely kind and level.
    gain: f64,
    /// Degrees of freedom that the errors use up.
    freedom: f64,
    likely: Vec<Shares>,
}

impl Posterior {
    fn of(equations: &Equations, kinds: &Kinds, cancel: &CancelToken) -> Result<Self, HandEyeError> {
        let mut spectra: Vec<(&DMatrix<f64>, Spectrum)> = Vec::with_capacity(kinds.roots.len());
        for (_, root) in &kinds.roots {
            if cancel.is_cancelled() {
                return Err(HandEyeError::Cancelled);
            }
            spectra.push((root, equations.along(root).spectrum()));
        }
        let gains: Vec<Vec<(f64, f64)>> = spectra
            .iter()
            .map(|(_, spectrum)| levels(&LEVELS_M).map(|level| (level, spectrum.gain(level))).collect())
            .collect();
        let gain = gains.iter().flatten().map(|(_, of)| *of).max_by(f64::total_cmp).unwrap_or(0.0);
        // Every level and every kind has the same prior probability.
        let weight = |of: f64| (0.5 * (of - gain)).exp();
        let sum: f64 = gains.iter().flatten().map(|(_, of)| weight(*of)).filter(|weight| *weight > NO_WEIGHT).sum();
        let n = equations.pull.len();
        let (mut mean, mut covariance, mut freedom) = (DVector::zeros(n), DMatrix::zeros(n, n), 0.0);
        let mut likely = Vec::new();
        for (((root, spectrum), gains), (shares, _)) in spectra.iter().zip(&gains).zip(&kinds.roots) {
            let of_shares: f64 = gains.iter().map(|(_, of)| weight(*of)).sum();
            if of_shares > UNLIKELY * sum {
                likely.push(*shares);
            }
            let mut variances = DVector::zeros(n);
            let axes = *root * &spectrum.axes;
            for (level, of) in gains {
                let weight = weight(*of);
                if weight <= NO_WEIGHT {
                    continue;
                }
                let at_level = spectrum.variances(*level);
                let errors = *root * spectrum.coefficients(&at_level);
                freedom += spectrum.freedom(&at_level) * (weight / sum);
                covariance.ger(weight / sum, &errors, &errors, 1.0);
                mean.axpy(weight / sum, &errors, 1.0);
                variances.axpy(weight / sum, &at_level, 1.0);
            }
            if variances.sum() > 0.0 {
                covariance += &axes * DMatrix::from_diagonal(&variances) * axes.transpose();
            }
        }
        covariance.ger(-1.0, &mean, &mean, 1.0);
        Ok(Self { mean, covariance, gain, freedom, likely })
    }

    fn sigma_m(&self) -> Vec<f64> {
        let n = self.mean.len() / 2;
        (0..n).map(|i| (0.5 * (self.covariance[(i, i)] + self.covariance[(n + i, n + i)])).max(0.0).sqrt()).collect()
    }

    /// `None` where the errors use up all residuals.
    fn shown(&self, gain: f64, residuals: f64) -> Option<PrintErrors> {
        let n = self.mean.len() / 2;
        let used_up = 1.0 - self.freedom / residuals;
        (used_up > 0.0).then(|| PrintErrors {
            errors_m: (0..n).map(|i| Vector2::new(self.mean[i], self.mean[n + i])).collect(),
            sigma_m: self.sigma_m(),
            gain,
            used_up,
            shares: self.likely.clone(),
        })
    }
}

#[cfg(test)]
#[path = "print_errors_tests.rs"]
mod tests;
