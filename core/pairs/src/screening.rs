//! Which views an estimate is made from: wrong ones are left out.
//!
//! Views are judged by `T² = eᵀ V⁻¹ e`, where `e` is the deviation of a view from what a fit expects of it and `V` the noise of
//! the view with the uncertainty of the fit itself (added for a view outside the fit, subtracted for one inside it). For good
//! views it follows `6 F(6, ν)`. Views beyond a limit that one healthy session in a thousand passes, and twice as far out as any
//! other, are left out as outliers, and the rest is fitted again until nothing changes.
//!
//! Several wrong views hide each other: they raise the estimated noise until none of them stands out. That is detectable,
//! because then most distances are far too small. A grossly wrong view may also pull the fit of all into a wrong minimum
//! from which it does not return. In either case the fit begins with the six in ten views that the start fits best and
//! grows from there. At the end the farthest view in the fit is judged once more by a fit without it, until one is
//! confirmed.
//!
//! # Reference
//! Atkinson & Riani 2000, "Robust diagnostic regression analysis" (forward search); Hadi 1992, "Identifying multiple
//! outliers in multivariate data", JRSS B 54.

use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::motion::MIN_VIEWS;
use super::{HandEyeError, determined};
use handeye_geometry::statistics::{median, outliers};

/// Share of healthy sessions in which some view may be left out as an outlier.
const FALSE_ALARM: f64 = 0.001;
/// Views below which none can be identified as an outlier.
const NEED: usize = 6;
/// Part of the views that a fit begins with when wrong ones hide each other: free of them while four in ten are wrong.
const CORE: f64 = 0.6;
/// Part of the views that has to remain; with fewer the problem is not some wrong views: those left out would be about as
/// many, and might agree equally well.
const LEAST_KEPT: f64 = 0.55;
/// Median of chi-square with six degrees of freedom.
const MEDIAN: f64 = 5.348;
/// The median distance over its expectation below which wrong views may hide each other. For ten healthy views it
/// scatters by a quarter.
const HIDING: f64 = 0.6;
/// A view this far from the start, in terms of the median view, may mislead a fit. Healthy views seldom reach it, and
/// beginning with a core only costs them a fit.
const TIMES_MEDIAN: f64 = 5.0;
/// Part of its limit from which the farthest view in a fit is judged once more by a fit without it. A view that is far off in
/// position or in rotation only accounts for all of the estimated noise of that kind, and `T²` ends at the degrees of freedom
/// of that level, `3N − 6`. For seven views, the fewest that are judged like this, that is a quarter of the limit (15 of 61,
/// with as many degrees of freedom), and more for more views: half at ten.
const SUSPECT: f64 = 0.25;
/// Rounds of fitting and judging.
const ROUNDS: usize = 8;

/// An estimate from a subset of the views.
pub trait Estimator {
    /// Its result.
    type Solution;

    /// Fits the views kept, near an earlier solution of others, or without one from the start.
    ///
    /// # Errors
    /// [`HandEyeError::Cancelled`]; any other where these views do not determine an answer.
    fn fit(&self, kept: &[usize], near: Option<&Self::Solution>) -> Result<Self::Solution, HandEyeError>;

    /// Deviation of every view, kept or not, from what a solution expects of it.
    ///
    /// # Errors
    /// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`].
    fn judge(&self, solution: &Self::Solution, kept: &[usize]) -> Result<Vec<Judged>, HandEyeError>;
}

/// Deviation of a view from what a fit expects of it.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    /// `T²`.
    pub squared: f64,
    /// Limit that it stays below in healthy sessions, see [`limit`].
    pub limit: f64,
    /// Distance of the view's pose from the predicted one at the middle of the target, metres.
    pub metres: f64,
    /// Angle between the two, radians.
    pub radians: f64,
}

/// Deviation of a view from where the others expect it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distance {
    /// `T²` over its limit; above 1 the view is left out as an outlier if it stands apart from the others.
    pub of_limit: f64,
    /// Distance of the view's pose from the predicted one at the middle of the target, metres.
    pub metres: f64,
    /// Angle between the two, radians.
    pub radians: f64,
}

impl From<&Judged> for Distance {
    fn from(judged: &Judged) -> Self {
        Self { of_limit: judged.squared / judged.limit, metres: judged.metres, radians: judged.radians }
    }
}

/// A solution without the outlier views.
pub struct ScreenedFit<S> {
    /// The solution.
    pub solution: S,
    /// The views used for it, ascending.
    pub kept: Vec<usize>,
    /// Deviation of every view from it.
    pub judged: Vec<Judged>,
}

/// Limit of `T²` that all of `views` healthy views stay below except in [`FALSE_ALARM`] of sessions, where its noise rests on
/// `freedom` degrees of freedom.
pub fn limit(views: usize, freedom: f64) -> f64 {
    let level = 1.0 - FALSE_ALARM / views as f64;
    // Both numbers are positive, so the distribution exists; without it nothing is left out as an outlier.
    FisherSnedecor::new(6.0, freedom).map_or(f64::INFINITY, |f| 6.0 * f.inverse_cdf(level))
}

/// The estimate from the views that agree; `misfits` are the distances of the views from the start, in any unit.
///
/// With fewer than six views, or when too many would have to go, all are kept.
///
/// # Errors
/// As [`Estimator::fit`] of all views.
pub fn screened<E: Estimator>(estimator: &E, misfits: &[f64]) -> Result<ScreenedFit<E::Solution>, HandEyeError> {
    let views = misfits.len();
    let all: Vec<usize> = (0..views).collect();
    let fit_all = || fitted(estimator, all.clone(), None);
    let core = || fitted(estimator, core_of(misfits), None).ok();
    let mut fit = if views < NEED {
        fit_all()?
    } else if let Some(core) = stands_out(misfits).then(core).flatten() {
        core
    } else {
        match fit_all() {
            Err(error) if error != HandEyeError::Cancelled => core().ok_or(error)?,
            fit => fit?,
        }
    };
    if views >= NEED {
        let hiding = fit.kept.len() == views && fit.median() < HIDING * MEDIAN;
        if hiding && let Some(core) = core() {
            fit = core;
        }
        if fit.kept.len() < views {
            // A core is chosen for fitting well, so its noise levels are too small, by as much as the median distance
            // shows.
            let excess = (fit.median() / MEDIAN).max(1.0);
            for j in &mut fit.judged {
                j.squared /= excess;
            }
        }
        fit = settle(estimator, fit)?;
        for _ in 0..ROUNDS {
            let Some(next) = without_farthest(estimator, &fit)? else { break };
            fit = settle(estimator, next)?;
        }
    }
    let least = (LEAST_KEPT * views as f64).ceil() as usize;
    if fit.kept.len() < least.max(MIN_VIEWS) { fit_all() } else { Ok(fit) }
}

fn fitted<E: Estimator>(
    estimator: &E,
    kept: Vec<usize>,
    near: Option<&E::Solution>,
) -> Result<ScreenedFit<E::Solution>, HandEyeError> {
    let solution = estimator.fit(&kept, near)?;
    let judged = estimator.judge(&solution, &kept)?;
    Ok(ScreenedFit { solution, kept, judged })
}

impl<S> ScreenedFit<S> {
    /// The views that are outliers by their distances.
    fn wrong(&self) -> Vec<usize> {
        let of_limit: Vec<f64> = self.judged.iter().map(|j| j.squared / j.limit).collect();
        outliers(&of_limit, 1.0)
    }

    fn median(&self) -> f64 {
        median(self.judged.iter().map(|j| j.squared)).unwrap_or(0.0)
    }
}

/// Fits and judges in turn until the same views are kept twice.
fn settle<E: Estimator>(
    estimator: &E,
    mut fit: ScreenedFit<E::Solution>,
) -> Result<ScreenedFit<E::Solution>, HandEyeError> {
    let mut seen = vec![fit.kept.clone()];
    for _ in 0..ROUNDS {
        let wrong = fit.wrong();
        let mut good: Vec<usize> = (0..fit.judged.len()).filter(|i| !wrong.contains(i)).collect();
        if good == fit.kept || good.len() < MIN_VIEWS {
            break;
        }
        if seen.contains(&good) {
            // The rounds alternate: views that are good in both are kept.
            good.retain(|i| fit.kept.contains(i));
        }
        seen.push(good.clone());
        let Some(next) = determined(fitted(estimator, good, Some(&fit.solution)))? else { break };
        fit = next;
    }
    Ok(fit)
}

/// The fit without its farthest view, when that view turns out to be wrong by it.
///
/// The noise levels of a fit follow a wrong view that is in it: alone among `N` it raises them until its own `T²` is a few
/// times `N` whatever its error, which is less than the limit when `N` is small. Judged from outside, it is not bounded.
fn without_farthest<E: Estimator>(
    estimator: &E,
    fit: &ScreenedFit<E::Solution>,
) -> Result<Option<ScreenedFit<E::Solution>>, HandEyeError> {
    let of_limit = |i: usize| fit.judged[i].squared / fit.judged[i].limit;
    let farthest = fit.kept.iter().copied().max_by(|&a, &b| of_limit(a).total_cmp(&of_limit(b)));
    let Some(farthest) = farthest.filter(|&i| fit.kept.len() > NEED && of_limit(i) > SUSPECT) else { return Ok(None) };
    let rest = fit.kept.iter().copied().filter(|&i| i != farthest).collect();
    // Where the answer is not determined without it, it cannot be judged.
    let next = determined(fitted(estimator, rest, Some(&fit.solution)))?;
    Ok(next.filter(|next| next.wrong().contains(&farthest)))
}

/// Whether some view is so far from the start that it may mislead a fit.
fn stands_out(misfits: &[f64]) -> bool {
    misfits.iter().copied().fold(0.0, f64::max) > TIMES_MEDIAN * median(misfits.iter().copied()).unwrap_or(0.0)
}

/// The views that the start fits best.
fn core_of(misfits: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..misfits.len()).collect();
    order.sort_by(|a, b| misfits[*a].total_cmp(&misfits[*b]));
    let count = ((CORE * misfits.len() as f64).ceil() as usize).max(MIN_VIEWS + 1).min(misfits.len());
    let mut kept = order[..count].to_vec();
    kept.sort_unstable();
    kept
}
