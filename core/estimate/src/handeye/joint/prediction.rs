//! What the data promise before more are taken: the expected error by number of views, and the residual that a view
//! outside the fit should have.

use nalgebra::{DMatrix, Matrix6, Vector6};

use super::normal::{System, covariance_of};
use super::view_block::prior_weight;
use super::{JointProblem, JointSolution};
use crate::handeye::HandEyeError;
use crate::handeye::joint::state::State;
use crate::handeye::motion::MIN_VIEWS;
use handeye_geometry::point_error;
use handeye_geometry::progress::{CancelToken, Stage, Work};

/// Most points of a curve: enough for any chart, and a thousand views cost no more than a few hundred.
const MOST_POINTS: usize = 100;

/// One point of an [`ErrorCurve`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorPoint {
    /// Number of views.
    pub views: usize,
    /// Expected error as in [`tip_error_95_m`](crate::uncertainty::quality::tip_error_95_m), metres; `None` where this few views
    /// leave a direction of the answer free, or so weak that the error would exceed the distance of the board.
    pub tip_error_95_m: Option<f64>,
}

/// The expected error of a measured point by number of views.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorCurve {
    /// Errors with the first views alone, in their order, from three to all of them. Every number of views up to a
    /// hundred of them; of more, a hundred evenly spaced, the last always among them.
    pub gathered: Vec<ErrorPoint>,
    /// Extrapolated to twice as many views, from the next on, with the same spacing.
    pub further: Vec<ErrorPoint>,
}

impl ErrorCurve {
    /// The number of views in the fit and the error with all of them, metres.
    pub fn now(&self) -> Option<(usize, f64)> {
        self.gathered.last().and_then(|p| Some((p.views, p.tip_error_95_m?)))
    }

    /// How many views in all the goal takes when further ones have as much information as those gathered had on
    /// average; at least as many as there are. `None` for a goal that is not positive, or when nothing is known yet.
    pub fn views_for(&self, goal_m: f64) -> Option<usize> {
        let (views, error_m) = self.now()?;
        if goal_m.is_nan() || goal_m <= 0.0 {
            return None;
        }
        let needed = views as f64 * (error_m / goal_m).powi(2).max(1.0);
        // Beyond any session; it keeps the conversion exact.
        (needed < 1e9).then(|| needed.ceil() as usize)
    }
}

/// The expected error by number of views.
///
/// The information of view `i` is `M_i = w Jsᵀ Js − w Jsᵀ Jd (w Jdᵀ Jd + P)⁻¹ w Jdᵀ Js` on the unknowns that all views
/// share, with `w = corner_px⁻²`, the prior `P` of the pose correction and the Jacobians at the estimate. The first `k`
/// views give the covariance `(M_1 + … + M_k)⁻¹`, and its hand-eye block the error at the reference point of the whole
/// solution. Noise levels are those of the whole solution, taken as known. `k` further views with as much information as
/// the average of the `n` gathered have the information `(k / n) (M_1 + … + M_n)`, so the error falls with `√(n / k)`.
///
/// The cost is linear in the number of views.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub(crate) fn error_by_views<'a>(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    work: impl Into<Work<'a>>,
) -> Result<ErrorCurve, HandEyeError> {
    let work = work.into();
    let count = problem.views.len();
    let system = solution.linearised(problem)?;
    let wanted = spaced(MIN_VIEWS, count);
    let mut wanted = wanted.iter().peekable();
    let n = system.layout.count();
    let mut information = DMatrix::zeros(n, n);
    let known = system.prior_information(&solution.noise);
    let mut gathered = Vec::new();
    for (index, block) in system.blocks.iter().enumerate() {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let views = index + 1;
        work.report(Stage::Prediction, index, count);
        if let Some((of_view, _)) = block.information(&solution.noise, &Vector6::zeros()) {
            information += of_view;
        }
        if wanted.next_if_eq(&&views).is_some() {
            let covariance = covariance_of(&(&information + &known));
            let error_m = covariance.map(|c| {
                let hand_eye: Matrix6<f64> = c.fixed_view::<6, 6>(0, 0).into_owned();
                point_error::radius_95(&point_error::covariance(&hand_eye, &solution.reference_point))
            });
            // Repeated views are not quite singular, by the rounding and the corrections of their poses; an error beyond
            // the distance of the board is as meaningless, because no derivative holds that far.
            let tip_error_95_m = error_m.filter(|e| *e <= solution.reference_point.coords.norm());
            gathered.push(ErrorPoint { views, tip_error_95_m });
        }
    }
    // Estimated noise levels widen every part by the same factor as the whole.
    let plain = gathered.last().and_then(|p: &ErrorPoint| p.tip_error_95_m).filter(|e| *e > 0.0);
    let of_point = point_error::covariance(&solution.hand_eye_covariance(), &solution.reference_point);
    let stated = solution.small_sample.radius_95(&of_point);
    let added = plain.map_or(1.0, |e| stated / e);
    for point in &mut gathered {
        point.tip_error_95_m = point.tip_error_95_m.map(|e| e * added);
    }
    let last = gathered.last().and_then(|p| p.tip_error_95_m);
    let further = spaced(count + 1, 2 * count)
        .into_iter()
        .map(|views| ErrorPoint { views, tip_error_95_m: last.map(|e| e * (count as f64 / views as f64).sqrt()) })
        .collect();
    Ok(ErrorCurve { gathered, further })
}

/// The corners of the views linearised at a solution with the robot at its reported poses.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub(crate) fn reported(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    cancel: &CancelToken,
) -> Result<System, HandEyeError> {
    let corrections = vec![Vector6::zeros(); solution.linearised(problem)?.blocks.len()];
    let problem = JointProblem { depth: None, ..*problem };
    System::new(&problem, &State { corrections, ..State::of(solution) }, cancel)
}

/// Numbers from `first` to `last`, all of them or [`MOST_POINTS`] evenly spaced; both ends are among them.
fn spaced(first: usize, last: usize) -> Vec<usize> {
    if last < first {
        return Vec::new();
    }
    let steps = (last - first).min(MOST_POINTS - 1);
    (0..=steps).map(|i| first + i * (last - first) / steps.max(1)).collect()
}

/// What a solution expects of corners, RMS of 2-D distances in pixels over the views it was fitted to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ExpectedResiduals {
    /// Displacement of a corner by the robot's noise.
    pub robot_px: f64,
    /// Residual of a view like these that was not in the fit, predicted from its reported robot pose: robot noise,
    /// corner noise and the uncertainty of the calibration together.
    pub prediction_px: f64,
}

/// The residuals that the noise levels and the covariance of a solution give for the corners of its own views.
///
/// With the normal equations of a view at its reported pose, the expected sum of squared distances of a prediction is
/// `tr(Jdᵀ Jd Σ_robot) + tr(Jsᵀ Js C) + 2 corners corner_px²`; the first term alone is the robot's. `C` is the covariance
/// of the shared unknowns.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub(crate) fn expected_residuals<'a>(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    work: impl Into<Work<'a>>,
) -> Result<ExpectedResiduals, HandEyeError> {
    let work = work.into();
    let system = reported(problem, solution, work.cancel)?;
    let robot_variance = prior_weight(&solution.noise).map(f64::recip);
    let (mut robot, mut shared, mut corners) = (0.0, 0.0, 0usize);
    for block in &system.blocks {
        robot += block.own.diagonal().dot(&robot_variance);
        shared += block.shared_trace(&solution.covariance);
        corners += block.corners;
    }
    let corner_squares = 2.0 * corners as f64 * solution.noise.corner_px.powi(2)
        + 6.0 * system.blocks.len() as f64 * solution.noise.view_px.powi(2);
    let rms = |squares: f64| (squares / corners.max(1) as f64).sqrt();
    Ok(ExpectedResiduals { robot_px: rms(robot), prediction_px: rms(robot + shared + corner_squares) })
}

#[cfg(test)]
#[path = "prediction_tests.rs"]
mod tests;
