//! The joint estimate with wrong views and wrong corners left out.
//!
//! The distance of a view is that of its own pose, from its corners, to the pose that the chain predicts from its reported
//! robot pose: `T² = eᵀ V⁻¹ e` with `e` in the tangent space and `V` the sum of robot noise, corner noise and what the
//! estimate itself is uncertain by (added for a view outside the fit, taken off for one inside it). Of good views it follows
//! `6 F(6, ν)`. Views beyond a limit that one healthy session in a thousand passes, and twice as far out as any other, are
//! left out as outliers, and the rest is fitted again until nothing changes.
//!
//! Several wrong views hide each other: they raise the estimated noise until none of them stands out. That shows, because
//! then most distances are far too small. A grossly wrong view may also pull the fit of all into a corner from which it
//! does not return. In either case the fit begins with the six in ten views that the start fits best and grows from there.
//! At the end the farthest view in the fit is judged once more by a fit without it, until one is found right.
//!
//! A corner is left out as an outlier when its residual, its view's own pose being free, is several times what nine in ten corners
//! have; so long tails of honest noise are kept.
//!
//! # Reference
//! Atkinson & Riani 2000, "Robust diagnostic regression analysis" (forward search); Hadi 1992, "Identifying multiple
//! outliers in multivariate data", JRSS B 54.

use nalgebra::{Cholesky, DMatrix, Isometry3, Matrix6, SMatrix, Vector6};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::field;
use super::normal::System;
use super::view_block::{MAX_SHARED, prior_weight};
use super::{JointProblem, JointSolution, JointStart, fit};
use crate::estimate::handeye::HandEyeError;
use crate::estimate::handeye::joint::state::State;
use crate::estimate::handeye::motion::MIN_VIEWS;
use crate::estimate::wrong_corners;
use crate::geometry::frames::{Camera, Pose, Target};
use crate::geometry::se3;
use crate::geometry::statistics::{median, outliers};
use crate::geometry::view_equations::{FreeParameters, PoseEquations};
use crate::progress::{CancelToken, Work};
use crate::targets::observation::{Corner, View};

/// Share of healthy sessions in which some view may be left out as an outlier.
const FALSE_ALARM: f64 = 0.001;
/// Views below which none can be told from the others.
const NEED: usize = 6;
/// Part of the views that a fit begins with when wrong ones hide each other.
const CORE: f64 = 0.6;
/// Part of the views that has to remain; with fewer it is not a matter of some wrong views.
const LEAST_KEPT: f64 = 0.55;
/// Median of chi-square with six degrees of freedom.
const MEDIAN: f64 = 5.348;
/// The median distance over its expectation below which wrong views may hide each other. Of ten healthy views it scatters
/// by a quarter.
const HIDING: f64 = 0.6;
/// A view that far from the start, in terms of the median view, may lead a fit astray. Healthy views seldom reach it, and
/// beginning with a core costs them a fit and nothing else.
const TIMES_MEDIAN: f64 = 5.0;
/// Part of its limit from which the farthest view in a fit is judged once more by a fit without it.
const SUSPECT: f64 = 0.3;
/// Rounds of fitting and judging.
const ROUNDS: usize = 8;

/// How far a view lies from where the others expect it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distance {
    /// `T²` over its limit; above 1 the view is left out as an outlier if it stands apart from the others.
    pub of_limit: f64,
    /// Distance of the view's pose from the predicted one at the middle of the target, metres.
    pub metres: f64,
    /// Angle between the two, radians.
    pub radians: f64,
}

/// An estimate and what it was made without.
#[derive(Debug, Clone)]
pub struct Screened {
    /// The estimate from the views in the fit; its views are those, in their order.
    pub solution: JointSolution,
    /// Which views are in the fit, ascending.
    pub kept: Vec<usize>,
    /// The views that were given, without the corners left out as an outlier.
    pub views: Vec<View>,
    /// For every view, how far it is from what the fit expects.
    pub distances: Vec<Distance>,
    /// Outlier corners, as view and index of the point.
    pub corners: Vec<(usize, usize)>,
}

impl Screened {
    /// The views in the fit.
    pub fn kept_views(&self) -> Vec<View> {
        self.kept.iter().map(|&i| self.views[i].clone()).collect()
    }
}

/// Estimates from the views that belong together. `own` are the target's poses by the corners of each view alone, as PnP
/// gives them.
///
/// With fewer than six views, or when too many would have to go, all are kept.
///
/// The covariance is that of noise levels as if they were known.
///
/// # Errors
/// As [`estimate`](super::estimate).
pub fn estimate_screened<'a>(
    problem: &JointProblem<'_>,
    start: &JointStart,
    own: &[Pose<Camera, Target>],
    work: impl Into<Work<'a>>,
) -> Result<Screened, HandEyeError> {
    let work = work.into();
    let (views, mut corners) = without_wrong_corners(problem, start, own);
    let all: Vec<usize> = (0..views.len()).collect();
    // Only the fit of all views is followed: the others begin near their end.
    let cancel = work.cancel;
    let misfits = misfits(problem, start, &views, own);
    let judge = |fit: &Fit| distances(problem, &views, fit, own, cancel);
    let core = || core_fit(problem, start, &views, &misfits, cancel);
    let fit_all = || fit(&JointProblem { views: &views, ..*problem }, start, work);
    let of_all = |solution: JointSolution| Fit { solution, kept: all.clone() };
    let mut fit = if views.len() < NEED {
        of_all(fit_all()?)
    } else if let Some(core) = stands_out(&misfits).then(core).flatten() {
        core
    } else {
        match fit_all() {
            Ok(solution) => of_all(solution),
            Err(HandEyeError::Cancelled) => return Err(HandEyeError::Cancelled),
            Err(error) => core().ok_or(error)?,
        }
    };
    let mut judged = judge(&fit)?;
    if views.len() >= NEED {
        let hiding = fit.kept.len() == views.len() && median_of(&judged) < HIDING * MEDIAN;
        if hiding && let Some(core) = core() {
            fit = core;
            judged = judge(&fit)?;
        }
        if fit.kept.len() < views.len() {
            // A core is chosen for fitting well, so its noise levels are too small, by as much as the median distance says.
            let excess = (median_of(&judged) / MEDIAN).max(1.0);
            for j in &mut judged {
                j.squared /= excess;
            }
        }
        (fit, judged) = settle(problem, &views, fit, judged, &judge, cancel)?;
        for _ in 0..ROUNDS {
            let Some(next) = without_farthest(problem, &views, &fit, &judged, &judge, cancel)? else { break };
            (fit, judged) = settle(problem, &views, next.0, next.1, &judge, cancel)?;
        }
    }
    let least = (LEAST_KEPT * views.len() as f64).ceil() as usize;
    if fit.kept.len() < least.max(MIN_VIEWS) {
        fit = of_all(fit_all()?);
        judged = judge(&fit)?;
    }
    corners.sort_unstable();
    let distances = judged
        .iter()
        .map(|j| Distance { of_limit: j.squared / j.limit, metres: j.metres, radians: j.radians })
        .collect();
    Ok(Screened { solution: fit.solution, kept: fit.kept, views, distances, corners })
}

struct Fit {
    solution: JointSolution,
    kept: Vec<usize>,
}

struct Judged {
    squared: f64,
    limit: f64,
    metres: f64,
    radians: f64,
}

/// Fits and judges in turn until the same views are kept twice.
fn settle(
    problem: &JointProblem<'_>,
    views: &[View],
    mut fit: Fit,
    mut judged: Vec<Judged>,
    judge: &impl Fn(&Fit) -> Result<Vec<Judged>, HandEyeError>,
    cancel: &CancelToken,
) -> Result<(Fit, Vec<Judged>), HandEyeError> {
    let mut seen = vec![fit.kept.clone()];
    for _ in 0..ROUNDS {
        let wrong = wrong(&judged);
        let mut good: Vec<usize> = (0..views.len()).filter(|i| !wrong.contains(i)).collect();
        if good == fit.kept || good.len() < MIN_VIEWS {
            break;
        }
        if seen.contains(&good) {
            // Going in circles: what is good in both turns is.
            good.retain(|i| fit.kept.contains(i));
        }
        seen.push(good.clone());
        match fit_of(problem, &fit.solution.as_start(), views, good, cancel) {
            Ok(next) => fit = next,
            Err(HandEyeError::Cancelled) => return Err(HandEyeError::Cancelled),
            Err(_) => break,
        }
        judged = judge(&fit)?;
    }
    Ok((fit, judged))
}

/// The fit without its farthest view, when that view turns out to be wrong by it.
///
/// The noise levels of a fit follow a wrong view that is in it: alone among `N` it raises them until its own `T²` is a few
/// times `N` whatever its error, which is less than the limit when `N` is small. Judged from outside nothing bounds it.
fn without_farthest(
    problem: &JointProblem<'_>,
    views: &[View],
    fit: &Fit,
    judged: &[Judged],
    judge: &impl Fn(&Fit) -> Result<Vec<Judged>, HandEyeError>,
    cancel: &CancelToken,
) -> Result<Option<(Fit, Vec<Judged>)>, HandEyeError> {
    let farthest = fit.kept.iter().copied().max_by(|&a, &b| judged[a].squared.total_cmp(&judged[b].squared));
    let far = |i: usize| judged[i].squared > SUSPECT * judged[i].limit;
    let Some(farthest) = farthest.filter(|&i| fit.kept.len() > NEED && far(i)) else { return Ok(None) };
    let rest: Vec<usize> = fit.kept.iter().copied().filter(|&i| i != farthest).collect();
    let next = match fit_of(problem, &fit.solution.as_start(), views, rest, cancel) {
        Ok(next) => next,
        Err(HandEyeError::Cancelled) => return Err(HandEyeError::Cancelled),
        // Without it nothing is determined: it cannot be judged.
        Err(_) => return Ok(None),
    };
    let next_judged = judge(&next)?;
    let is_wrong = wrong(&next_judged).contains(&farthest);
    Ok(is_wrong.then_some((next, next_judged)))
}

/// The views that are outliers by their distances.
fn wrong(judged: &[Judged]) -> Vec<usize> {
    let squared: Vec<f64> = judged.iter().map(|j| j.squared).collect();
    outliers(&squared, judged.first().map_or(f64::INFINITY, |j| j.limit))
}

fn fit_of(
    problem: &JointProblem<'_>,
    start: &JointStart,
    views: &[View],
    kept: Vec<usize>,
    cancel: &CancelToken,
) -> Result<Fit, HandEyeError> {
    let chosen: Vec<View> = kept.iter().map(|&i| views[i].clone()).collect();
    // Noise levels of other views are no start: their likelihood may have another maximum near them.
    let start = JointStart { noise: None, ..*start };
    let solution = fit(&JointProblem { views: &chosen, ..*problem }, &start, cancel)?;
    Ok(Fit { solution, kept })
}

/// How far the target's own pose in every view is from where the start puts it, metres; angles count at its distance.
fn misfits(problem: &JointProblem<'_>, start: &JointStart, views: &[View], own: &[Pose<Camera, Target>]) -> Vec<f64> {
    let state = State::new(&JointProblem { views, ..*problem }, start);
    let centre = centre(problem, start);
    let misfit = |(view, own): (&View, &Pose<Camera, Target>)| {
        let chain = state.chain(problem, view, &Vector6::zeros()).camera_from_target;
        let (metres, radians) = apart(&chain, own.isometry(), &centre);
        metres + radians * own.translation().norm()
    };
    views.iter().zip(own).map(misfit).collect()
}

/// Whether some view is so far from the start that it may lead a fit astray.
fn stands_out(misfits: &[f64]) -> bool {
    misfits.iter().copied().fold(0.0, f64::max) > TIMES_MEDIAN * median(misfits.iter().copied()).unwrap_or(0.0)
}

/// The fit of the views that the start fits best; `None` when they determine nothing.
fn core_fit(
    problem: &JointProblem<'_>,
    start: &JointStart,
    views: &[View],
    misfits: &[f64],
    cancel: &CancelToken,
) -> Option<Fit> {
    let mut order: Vec<usize> = (0..views.len()).collect();
    order.sort_by(|a, b| misfits[*a].total_cmp(&misfits[*b]));
    let count = ((CORE * views.len() as f64).ceil() as usize).max(MIN_VIEWS + 1).min(views.len());
    let mut kept = order[..count].to_vec();
    kept.sort_unstable();
    fit_of(problem, start, views, kept, cancel).ok()
}

fn centre(problem: &JointProblem<'_>, start: &JointStart) -> nalgebra::Point3<f64> {
    let points = problem.board.points(&start.shape);
    let sum: nalgebra::Vector3<f64> = points.iter().map(|p| p.coords).sum();
    (sum / points.len().max(1) as f64).into()
}

/// How far two poses put a point apart, metres, and the angle between them.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>, point: &nalgebra::Point3<f64>) -> (f64, f64) {
    ((a * point - b * point).norm(), a.rotation.angle_to(&b.rotation))
}

/// The distance of every view from what a fit expects of it.
fn distances(
    problem: &JointProblem<'_>,
    views: &[View],
    fit: &Fit,
    own: &[Pose<Camera, Target>],
    cancel: &CancelToken,
) -> Result<Vec<Judged>, HandEyeError> {
    let solution = &fit.solution;
    let chosen: Vec<View> = fit.kept.iter().map(|&i| views[i].clone()).collect();
    let inside = JointProblem { views: &chosen, ..*problem };
    let state = State::of(solution);
    let system = System::new(&inside, &state, cancel)?;
    let covariance = system.reduce(&solution.noise)?.inverse();
    let layout = system.layout;
    // What is known of an unknown beforehand takes no residuals to find.
    let determined = layout.count() as f64 - system.prior_trace(&solution.noise, &covariance);
    let freedom = 0.5 * (6.0 * fit.kept.len() as f64 - determined);
    let limit = limit(views.len(), freedom.max(4.0));
    let robot = prior_weight(&solution.noise).map(f64::recip);
    let in_pixels = solution.noise.corner_px.powi(2) + solution.noise.view_px.powi(2);
    let centre = centre(problem, &solution.as_start());
    let judged = views.iter().zip(own).enumerate().map(|(i, (view, own))| {
        let chain = state.chain(problem, view, &Vector6::zeros());
        let gone = || Judged { squared: f64::INFINITY, limit, metres: f64::INFINITY, radians: f64::INFINITY };
        let Some((seen, equations)) = own_pose(problem, &state, view, own) else { return gone() };
        let Some(factor) = Cholesky::new(equations.pose) else { return gone() };
        let (metres, radians) = apart(&chain.camera_from_target, &seen, &centre);
        let error = se3::log(&(chain.camera_from_target.inverse() * seen));
        let mut by_shared = SMatrix::<f64, 6, MAX_SHARED>::zeros();
        by_shared.fixed_view_mut::<6, 6>(0, 0).copy_from(&chain.by_hand_eye);
        by_shared.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
        let by_form = factor.solve(&equations.pose_by_form);
        for j in 0..layout.form {
            by_shared.set_column(12 + j, &by_form.column(j));
        }
        for j in 0..layout.joints {
            by_shared.set_column(layout.joints_at() + j, &chain.by_joints.column(j));
        }
        if let Some(field) = &state.field {
            let columns = field::columns(&field.place(&view.base_from_tip), &chain.by_correction);
            by_shared.columns_mut(layout.field_at(), field::SLOPES).copy_from(&columns);
        }
        let by_shared: DMatrix<f64> = DMatrix::from_fn(6, layout.count(), |r, c| by_shared[(r, c)]);
        let shared = &by_shared * &covariance * by_shared.transpose();
        let shared = Matrix6::from_fn(|r, c| shared[(r, c)]);
        let own = chain.by_correction * Matrix6::from_diagonal(&robot) * chain.by_correction.transpose()
            + factor.inverse() * in_pixels;
        let expected = if fit.kept.binary_search(&i).is_ok() { own - shared } else { own + shared };
        // A view that the others do not determine has nothing to disagree with.
        let expected = Cholesky::new(expected).or_else(|| Cholesky::new(own));
        let squared = expected.map_or(f64::INFINITY, |v| error.dot(&v.solve(&error)));
        Judged { squared, limit, metres, radians }
    });
    Ok(judged.collect())
}

/// Limit of `T²` that all of `views` healthy views stay below but in [`FALSE_ALARM`] of sessions.
fn limit(views: usize, freedom: f64) -> f64 {
    let level = 1.0 - FALSE_ALARM / views as f64;
    // Both numbers are positive, so the distribution exists; without it nothing is left out as an outlier.
    FisherSnedecor::new(6.0, freedom).map_or(f64::INFINITY, |f| 6.0 * f.inverse_cdf(level))
}

/// The pose of a view by its corners alone with the lens and the target of the state, and the equations there; `None` when
/// it has none.
fn own_pose(
    problem: &JointProblem<'_>,
    state: &State,
    view: &View,
    start: &Pose<Camera, Target>,
) -> Option<(Isometry3<f64>, PoseEquations)> {
    // From PnP with a lens that was a little different, two steps are exact to first order in what is left.
    const STEPS: usize = 2;
    let sqrt_weights = problem.sqrt_weights(view);
    let seen = problem.seen(state, view, &sqrt_weights);
    let mut pose = *start.isometry();
    for _ in 0..STEPS {
        let equations = PoseEquations::new(&seen, &pose, FreeParameters::default()).ok()?;
        pose *= se3::exp(&-Cholesky::new(equations.pose)?.solve(&equations.pose_gradient));
    }
    let equations = PoseEquations::new(&seen, &pose, problem.free.form()).ok()?;
    Some((pose, equations))
}

/// The views without their wrong corners, and which those are.
fn without_wrong_corners(
    problem: &JointProblem<'_>,
    start: &JointStart,
    own: &[Pose<Camera, Target>],
) -> (Vec<View>, Vec<(usize, usize)>) {
    let points = problem.board.points(&start.shape);
    let residual = |corner: &Corner, own: &Pose<Camera, Target>| {
        let px = start.intrinsics.project(&(own.isometry() * points[corner.index])).ok()?;
        Some((px - corner.px).norm())
    };
    let lengths: Vec<f64> = problem
        .views
        .iter()
        .zip(own)
        .flat_map(|(view, own)| view.corners.iter().filter_map(move |corner| residual(corner, own)))
        .collect();
    let Some(limit) = wrong_corners::limit(lengths) else { return (problem.views.to_vec(), Vec::new()) };
    let mut aside = Vec::new();
    let mut views = problem.views.to_vec();
    for (i, (view, own)) in views.iter_mut().zip(own).enumerate() {
        let is_good = |corner: &Corner| residual(corner, own).is_none_or(|r| r <= limit);
        let good = view.corners.iter().filter(|c| is_good(c)).count();
        if good < view.corners.len() && wrong_corners::enough(good, view.corners.len()) {
            aside.extend(view.corners.iter().filter(|c| !is_good(c)).map(|c| (i, c.index)));
            view.corners.retain(is_good);
        }
    }
    (views, aside)
}

fn median_of(judged: &[Judged]) -> f64 {
    median(judged.iter().map(|j| j.squared)).unwrap_or(0.0)
}

#[cfg(test)]
#[path = "outliers_tests.rs"]
mod tests;
