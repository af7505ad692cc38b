//! The joint estimator: all corners of all views at once, with a noisy robot.
//!
//! # What it estimates
//! `mount_from_camera` and `anchor_from_target` (see [`super`]), a correction of every reported robot pose and, as far as
//! they are [`Free`], the intrinsics, the shape of the target and the errors of the robot's arm; with them the noise
//! levels that weigh corners against robot poses.
//!
//! # Model
//! Corner `j` of view `i`: `px_ij = project(camera_from_target_i * point_j) + noise`, noise independent and Gaussian
//! with `corner_px` per axis; where the data require it, the part of a view's noise that looks like a pose is larger
//! (`view_px`). The chain is `camera_from_target_i = mount_from_camera⁻¹ * mount_from_anchor_i * anchor_from_target`.
//! The true tip pose is `base_from_tip_i * E_i`, where `E_i` has translation `rho_i` and rotation `exp(phi_i)`; both
//! are Gaussian with `robot_m` and `robot_rad` per axis. Without `E_i` the answer would be worse than a closed form on
//! any real robot, because a tenth of a degree moves a corner by far more than its own noise.
//!
//! # How
//! Levenberg–Marquardt with analytic Jacobians; the corrections are eliminated view by view (Schur complement), so the
//! cost grows linearly with the number of views. The noise levels maximise the restricted likelihood (REML) of the
//! linearised model ([`variance`]); both steps alternate until the levels converge. The effect of estimated levels on
//! the covariance is in [`integrated`], that of a cost that is not quadratic in [`curvature`].
//!
//! # Reference
//! Triggs et al. 2000, "Bundle adjustment — a modern synthesis", §6; Patterson & Thompson 1971, "Recovery of
//! inter-block information when block sizes are unequal" (REML); Ulrich & Hillemann 2024, "Uncertainty-aware hand-eye
//! calibration" (robot poses as observations).

pub(crate) mod arm_errors;
pub(crate) mod chain;
mod curvature;
pub(crate) mod effects;
mod expected_pixels;
mod expected_view;
mod information;
mod integrated;
pub(crate) mod normal;
pub(crate) mod optimise;
pub mod outliers;
pub(crate) mod pose_dependent_error;
pub(crate) mod pose_part;
pub mod prediction;
pub(crate) mod print_errors;
mod problem;
pub(crate) mod residual_distortion;
pub(crate) mod shared_lens;
mod shown_effects;
mod shown_field;
mod shown_warp;
mod solution;
pub(crate) mod state;
mod variance;
pub(crate) mod view_block;
mod weights;
pub(crate) mod with_depths;

use std::sync::Arc;

use nalgebra::Point3;
pub use print_errors::PrintErrors;
pub use problem::{DepthWeight, Free, JointProblem, JointStart, LensPrior, Noise};
pub use residual_distortion::ShownDistortion;
pub use shown_effects::ShownEffects;
pub(crate) use shown_field::SIZE_SIGMA;
pub use shown_field::with_shown_field;
pub(crate) use shown_warp::warp_ratio;
pub use solution::{JointSolution, ViewFit};

use super::HandEye;
use super::HandEyeError;
use super::motion::MIN_VIEWS;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::{CancelToken, Stage, Work};
use handeye_geometry::targets::observation::Corner;

pub use arm_errors::{ArmErrors, ArmParameter, LEVELS_OF_ARMS, LinkError, TrueTip, arm_parameters};
pub use chain::{camera_from_target, correction_transform};
pub use expected_pixels::ExpectedPixels;
pub use expected_view::{ExpectedView, Posture, ViewModel};
pub use integrated::SmallSample;
pub use pose_dependent_error::{FIELD_VIEWS, PoseDependentError, Slopes, corrected_base_from_tip};
pub use weights::CornerWeights;

use curvature::Optimum;
use integrated::Integrated;
use optimise::Descent;
use state::State;
use variance::{Levels, Logs, to_logs};

/// Most rounds of weights and optimum.
const MAX_ROUNDS: usize = 20;
/// Relative change of every noise level below which the rounds end: a thousandth moves the answer by far less than its
/// uncertainty.
const ROUND_TOLERANCE: f64 = 1e-3;

/// Estimates the calibration from corners and reported robot poses. `work` is a `&CancelToken`, or a [`Work`] to follow
/// the progress too.
///
/// # Needs
/// Three views with robot rotations about two axes (check with [`super::motion`] first), every view with at least four
/// corners. `start` within the basin of convergence: any closed form on PnP poses is.
///
/// # Errors
/// [`HandEyeError::TooFewViews`], [`HandEyeError::NoSolution`] when the normal equations are singular or the start puts
/// the target behind the camera, [`HandEyeError::Cancelled`].
pub fn estimate<'a>(
    problem: &JointProblem<'_>,
    start: &JointStart,
    work: impl Into<Work<'a>>,
) -> Result<JointSolution, HandEyeError> {
    let work = work.into();
    let solution = fit(problem, start, work)?;
    with_stated_error(problem, solution, work.cancel)
}

/// The same without the effect of estimated noise levels and a curved cost on the covariance: for fits of which only the
/// answer is used.
pub(crate) fn fit<'a>(
    problem: &JointProblem<'_>,
    start: &JointStart,
    work: impl Into<Work<'a>>,
) -> Result<JointSolution, HandEyeError> {
    let work = work.into();
    if problem.views.len() < MIN_VIEWS {
        return Err(HandEyeError::TooFewViews { got: problem.views.len(), need: MIN_VIEWS });
    }
    let mut state = State::new(problem, start);
    let mut noise = problem.noise.or(start.noise).unwrap_or_else(|| variance::starting_noise(problem, &state));
    let mut levels =
        Levels { view: problem.view_noise == Some(true), field: state.has_field(), arm: state.arm.is_some() };
    if problem.noise.is_none() {
        // Whether the corners of a view share noise is decided by these views alone, not by where the fit began.
        if !levels.view {
            noise.view_px = 0.0;
        }
        if levels.field && noise.field_m == 0.0 {
            (noise.field_m, noise.field_rad) = (noise.robot_m, noise.robot_rad);
        }
        if levels.arm && noise.link_rad == 0.0 {
            [noise.link_rad, noise.link_m, noise.compliance_rad] = LEVELS_OF_ARMS;
        }
    }
    let (mut iterations, mut deviance) = (0, None);
    let mut system = normal::System::new(problem, &state, work.cancel)?;
    for round in 0..MAX_ROUNDS {
        work.report(Stage::Joint, round, MAX_ROUNDS);
        let damping = if round == 0 { optimise::FAR } else { optimise::NEAR };
        let descent = Descent { problem, noise: &noise, damping };
        let (found, steps) = optimise::minimise(descent, &mut state, system, work.cancel)?;
        system = found;
        iterations += steps;
        if problem.noise.is_some() {
            break;
        }
        let most_likely =
            |start: &Logs, levels| variance::restricted_likelihood(&system, start, levels, variance::EXACTLY);
        let (mut next, mut likelihood) = most_likely(&to_logs(&noise), levels)?;
        let mut settled = variance::change(&noise, &next) < ROUND_TOLERANCE;
        let lifted = variance::lifted(&system, &next, levels)?;
        if settled && lifted != variance::kept(to_logs(&next), levels) {
            // A level that vanished far from the optimum would stay zero at it.
            let (found, larger) = most_likely(&lifted, levels)?;
            if likelihood - larger > ANOTHER_TOP {
                (next, likelihood, settled) = (found, larger, false);
            }
        }
        if settled && !levels.view && problem.view_noise.is_none() {
            let start = Noise { view_px: next.corner_px, ..next };
            let with_view = Levels { view: true, ..levels };
            let (found, larger) = most_likely(&to_logs(&start), with_view)?;
            if likelihood - larger > VIEW_NOISE_GAIN {
                (levels, next, settled) = (with_view, found, false);
            }
        }
        (noise, deviance) = (next, Some(likelihood));
        if settled {
            break;
        }
    }
    if levels.view && noise.view_px < NO_VIEW_NOISE * noise.corner_px {
        // It was needed on the way and is not at the end.
        noise.view_px = 0.0;
    }
    let descent = Descent { problem, noise: &noise, damping: optimise::NEAR };
    let (system, steps) = optimise::minimise(descent, &mut state, system, work.cancel)?;
    let solution = finish(problem, &state, system, noise, &work)?;
    Ok(JointSolution { iterations: iterations + steps, deviance, ..solution })
}

/// Gain of minus twice the log-likelihood from which levels found from another start are another maximum of it, not the same
/// one reached more closely.
const ANOTHER_TOP: f64 = 1e-3;

/// Noise of the view below this part of a corner's noise counts as zero: it adds less than three parts in a thousand to the
/// variance of a pose.
const NO_VIEW_NOISE: f64 = 0.05;

/// Gain of minus twice the log-likelihood from which a noise that all corners of a view share is taken into the model: by
/// chance one session in a thousand. The level is at the edge of its range, so half of all healthy sessions gain nothing
/// and the rest follows chi-square with one degree of freedom (Self & Liang 1987). Robot errors that neighbouring poses
/// share can look like it and gain up to nine in sessions of fifteen views.
const VIEW_NOISE_GAIN: f64 = 9.55;

/// A solution of [`fit`] with the covariance that may be stated.
///
/// # Errors
/// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
pub(crate) fn with_stated_error(
    problem: &JointProblem<'_>,
    solution: JointSolution,
    cancel: &CancelToken,
) -> Result<JointSolution, HandEyeError> {
    let problem = &JointProblem { free: solution.free, ..*problem };
    let (state, noise) = (State::of(&solution), &solution.noise);
    let system = solution.linearised(problem)?;
    let reduced = system.reduce(noise)?;
    let plain = reduced.inverse();
    let integrated = if problem.noise.is_some() {
        Integrated { covariance: plain.clone(), small_sample: SmallSample::KNOWN }
    } else {
        let levels = Levels { view: noise.view_px > 0.0, field: state.has_field(), arm: state.arm.is_some() };
        integrated::integrate(system, noise, levels, plain.clone(), &solution.reference_point)?
    };
    let optimum = Optimum { problem, state: &state, system, noise, reduced: &reduced, covariance: &plain };
    let covariance = optimum.widened(integrated.covariance, &solution.reference_point)?;
    let mut views = solution.views.clone();
    for (view, block) in views.iter_mut().zip(&system.blocks) {
        if cancel.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        view.influence_m = reduced.influence_of(block, noise, &view.correction, &solution.reference_point);
    }
    Ok(JointSolution { covariance, small_sample: integrated.small_sample, views, ..solution })
}

fn finish(
    problem: &JointProblem<'_>,
    state: &State,
    system: normal::System,
    noise: Noise,
    work: &Work<'_>,
) -> Result<JointSolution, HandEyeError> {
    let covariance = system.reduce(&noise)?.inverse();
    let reference_point = state.mean_target_centre(problem);
    let points = problem.board.points(&state.shape);
    let mut views = Vec::with_capacity(problem.views.len());
    let (mut squared_px, mut corners) = (0.0, 0usize);
    for (correction, view) in state.corrections.iter().zip(problem.views) {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let camera_from_target = state.chain(problem, view, correction).camera_from_target;
        let of_view = squares(&state.intrinsics, &camera_from_target, &points, &view.corners);
        squared_px += of_view;
        corners += view.corners.len();
        views.push(ViewFit {
            rms_px: (of_view / view.corners.len() as f64).sqrt(),
            correction: *correction,
            camera_from_target: Pose::from_isometry(camera_from_target),
            influence_m: None,
        });
    }
    Ok(JointSolution {
        hand_eye: HandEye::new(problem.mode, state.mount_from_camera, state.anchor_from_target),
        intrinsics: state.intrinsics,
        shape: state.shape,
        depth: state.depth,
        arm: state.arm.clone(),
        field: state.field.clone(),
        deviance: None,
        covariance,
        small_sample: SmallSample::KNOWN,
        free: problem.free,
        noise,
        views,
        rms_px: (squared_px / corners as f64).sqrt(),
        reference_point,
        iterations: 0,
        system: Arc::new(system),
    })
}

/// Sum of squared 2-D residuals of corners, square pixels; not finite where a point has no image.
fn squares(
    intrinsics: &Intrinsics,
    camera_from_target: &nalgebra::Isometry3<f64>,
    points: &[Point3<f64>],
    corners: &[Corner],
) -> f64 {
    let squared = |corner: &Corner| {
        let px = intrinsics.project(&(camera_from_target * points[corner.index])).ok()?;
        Some((px - corner.px).norm_squared())
    };
    corners.iter().map(|corner| squared(corner).unwrap_or(f64::INFINITY)).sum()
}

#[cfg(test)]
mod tests;
