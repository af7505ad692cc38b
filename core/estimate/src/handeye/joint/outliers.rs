//! The joint estimate with wrong views and wrong corners left out.
//!
//! Views are judged as in [`screening`](crate::handeye::screening): the error is that of a view's own pose, from its
//! corners, against the pose that the chain predicts from its reported robot pose, and its noise that of the robot with that
//! of the corners.
//!
//! A corner is left out as an outlier when its residual, its view's own pose being free, is several times what nine in ten corners
//! have; so long tails of ordinary noise are kept.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, Isometry3, Matrix6, Matrix6xX, Vector6};

use super::normal::System;
use super::variance::levels_of_effects;
use super::view_block::{Layout, prior_weight};
use super::{JointProblem, JointSolution, JointStart, Noise, fit};
use crate::handeye::HandEyeError;
use crate::handeye::joint::state::State;
use crate::handeye::screening::{Distance, Estimator, Judged, limit, screened};
use crate::{resolution, wrong_corners};
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::progress::Work;
use handeye_geometry::se3;
use handeye_geometry::statistics::pooled_freedom;
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::view_equations::{FreeParameters, PoseEquations};

/// An estimate and what was left out of it.
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

/// Estimates from the views that agree. `own` are the target's poses by the corners of each view alone, as PnP gives
/// them.
///
/// With fewer than six views, or when too many would have to go, all are kept.
///
/// The covariance takes the noise levels as known.
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
    let misfits = misfits(problem, start, &views, own);
    let fit = screened(&OfViews { problem, start, views: &views, own, work }, &misfits)?;
    corners.sort_unstable();
    let distances = fit.judged.iter().map(Distance::from).collect();
    Ok(Screened { solution: fit.solution, kept: fit.kept, views, distances, corners })
}

/// The estimate from a choice of views.
struct OfViews<'a> {
    problem: &'a JointProblem<'a>,
    start: &'a JointStart,
    views: &'a [View],
    own: &'a [Pose<Camera, Target>],
    work: Work<'a>,
}

impl Estimator for OfViews<'_> {
    type Solution = JointSolution;

    fn fit(&self, kept: &[usize], near: Option<&JointSolution>) -> Result<JointSolution, HandEyeError> {
        if kept.len() == self.views.len() && near.is_none() {
            // Only the fit of all views is followed: the others begin near their end.
            return fit(&JointProblem { views: self.views, ..*self.problem }, self.start, self.work);
        }
        let chosen: Vec<View> = kept.iter().map(|&i| self.views[i].clone()).collect();
        // Noise levels of other views are not a start: their likelihood may have another maximum near them.
        let start = JointStart { noise: None, ..near.map_or(*self.start, JointSolution::as_start) };
        fit(&JointProblem { views: &chosen, ..*self.problem }, &start, self.work.cancel)
    }

    fn judge(&self, solution: &JointSolution, kept: &[usize]) -> Result<Vec<Judged>, HandEyeError> {
        distances(self.problem, self.views, (solution, kept), self.own)
    }
}

/// Distance of the target's own pose in every view from the one that the start predicts, metres; angles count at its
/// distance.
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

fn centre(problem: &JointProblem<'_>, start: &JointStart) -> nalgebra::Point3<f64> {
    let points = problem.board.points(&start.shape);
    let sum: nalgebra::Vector3<f64> = points.iter().map(|p| p.coords).sum();
    (sum / points.len().max(1) as f64).into()
}

/// Distance between the places where two poses put a point, metres, and the angle between them.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>, point: &nalgebra::Point3<f64>) -> (f64, f64) {
    ((a * point - b * point).norm(), a.rotation.angle_to(&b.rotation))
}

/// The distance of every view from what a fit expects of it.
fn distances(
    problem: &JointProblem<'_>,
    views: &[View],
    (solution, kept): (&JointSolution, &[usize]),
    own: &[Pose<Camera, Target>],
) -> Result<Vec<Judged>, HandEyeError> {
    let state = State::of(solution).reaching(views);
    let system = &*solution.system;
    let covariance = system.reduce(&solution.noise)?.inverse();
    let layout = system.layout;
    // What is known of an unknown beforehand uses up no residuals.
    let determined = layout.count() as f64 - system.prior_trace(&solution.noise, &covariance);
    let freedom = 0.5 * (6.0 * kept.len() as f64 - determined);
    let of_noise = freedom.max(4.0);
    let slopes = slopes(system, &solution.noise, &covariance);
    let robot = prior_weight(&resolution::judged_by(&solution.noise)).map(f64::recip);
    let in_pixels = solution.noise.corner_px.powi(2) + solution.noise.view_px.powi(2);
    let centre = centre(problem, &solution.as_start());
    let judged = views.iter().zip(own).enumerate().map(|(i, (view, own))| {
        let chain = state.chain(problem, view, &Vector6::zeros());
        let gone = || Judged {
            squared: f64::INFINITY,
            limit: limit(views.len(), of_noise),
            metres: f64::INFINITY,
            radians: f64::INFINITY,
        };
        let Some((seen, equations)) = own_pose(problem, &state, view, own) else { return gone() };
        let Some(factor) = Cholesky::new(equations.pose) else { return gone() };
        let (metres, radians) = apart(&chain.camera_from_target, &seen, &centre);
        let error = se3::log(&(chain.camera_from_target.inverse() * seen));
        let mut by_shared = Matrix6xX::zeros(layout.count());
        by_shared.fixed_view_mut::<6, 6>(0, 0).copy_from(&chain.by_hand_eye);
        by_shared.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
        by_shared.columns_mut(Layout::FORM_AT, layout.form).copy_from(&factor.solve(&equations.pose_by_form));
        layout.of_arm_in(&mut by_shared, &chain.by_arm);
        if let Some(field) = &state.field {
            let columns = field.columns(&view.base_from_tip, &chain.by_correction);
            by_shared.columns_mut(layout.field_at(), columns.ncols()).copy_from(&columns);
        }
        let shared = &by_shared * &covariance * by_shared.transpose();
        let shared = Matrix6::from_fn(|r, c| shared[(r, c)]);
        let own = chain.by_correction * Matrix6::from_diagonal(&robot) * chain.by_correction.transpose()
            + factor.inverse() * resolution::pose_variance_px2(in_pixels, view.corners.len());
        let expected = if kept.binary_search(&i).is_ok() { own - shared } else { own + shared };
        // Where the others do not determine a view it cannot disagree with them.
        let expected = Cholesky::new(expected).or_else(|| Cholesky::new(own));
        let squared = expected.as_ref().map_or(f64::INFINITY, |v| error.dot(&v.solve(&error)));
        let freedom = expected.map_or(of_noise, |v| {
            // The derivative of the expected covariance by the log of the variance `v` of the slopes is
            // `B C_s C_sᵀ Bᵀ / v`.
            let share = |(part, variance, _): &(Range<usize>, f64, f64)| {
                let with = &by_shared * covariance.columns(part.start, part.len());
                v.solve(&Matrix6::from_iterator((&with * with.transpose()).iter().copied())).trace() / (6.0 * variance)
            };
            let of_field: Vec<(f64, f64)> = slopes.iter().map(|part| (share(part), part.2)).collect();
            let rest = 1.0 - of_field.iter().map(|(share, _)| share).sum::<f64>();
            pooled_freedom(of_field.into_iter().chain([(rest, of_noise)]))
        });
        Judged { squared, limit: limit(views.len(), freedom), metres, radians }
    });
    Ok(judged.collect())
}

/// The effects of each kind, slopes of the robot's field and errors of its arm: where they are among the shared unknowns, their
/// variance, and the number of them determined by the data, on which it rests.
fn slopes(system: &System, noise: &Noise, covariance: &DMatrix<f64>) -> Vec<(Range<usize>, f64, f64)> {
    let kinds = system.layout.effects().into_iter().zip(levels_of_effects(noise));
    let kinds = kinds.filter(|(part, _)| !part.is_empty()).map(|(part, sigma)| {
        let unknown: f64 = part.clone().map(|i| covariance[(i, i)]).sum::<f64>() / sigma.powi(2);
        let count = part.len() as f64;
        (part, sigma.powi(2), count - unknown)
    });
    kinds.collect()
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
    let whitener = problem.whitener(view);
    let seen = problem.seen(state, view, &whitener);
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
    let mut rejected = Vec::new();
    let mut views = problem.views.to_vec();
    for (i, (view, own)) in views.iter_mut().zip(own).enumerate() {
        let is_good = |corner: &Corner| residual(corner, own).is_none_or(|r| r <= limit);
        let good = view.corners.iter().filter(|c| is_good(c)).count();
        if good < view.corners.len() && wrong_corners::enough(good, view.corners.len()) {
            rejected.extend(view.corners.iter().filter(|c| !is_good(c)).map(|c| (i, c.index)));
            view.corners.retain(is_good);
        }
    }
    (views, rejected)
}

#[cfg(test)]
#[path = "outliers_tests.rs"]
mod tests;
