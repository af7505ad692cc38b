//! The joint estimator: all corners of all views at once, with a noisy robot.
//!
//! # What it estimates
//! `mount_from_camera` and `anchor_from_target` (see [`super`]), the intrinsics when they are free, and a correction
//! of every reported robot pose; with them the two noise levels that weigh corners against robot poses.
//!
//! # Model
//! Corner `j` of view `i`: `px_ij = project(camera_from_target_i * point_j) + noise`, noise independent and Gaussian
//! with `corner_px` per axis. The chain is `camera_from_target_i = mount_from_camera⁻¹ * mount_from_anchor_i *
//! anchor_from_target`. The true tip pose is `base_from_tip_i * E_i`, where `E_i` has translation `rho_i` and rotation
//! `exp(phi_i)`; both are Gaussian with `robot_m` and `robot_rad` per axis. Without `E_i` the answer would be worse
//! than a closed form on any real robot, because a tenth of a degree moves a corner by far more than its own noise.
//!
//! # How
//! Levenberg–Marquardt with analytic Jacobians; the corrections are eliminated view by view (Schur complement), so the
//! cost grows linearly with the number of views. The noise levels maximise the restricted likelihood (REML) of the
//! linearised model ([`variance`]); both steps alternate until the levels stand still.
//!
//! # Reference
//! Triggs et al. 2000, "Bundle adjustment — a modern synthesis", §6; Patterson & Thompson 1971, "Recovery of
//! inter-block information when block sizes are unequal" (REML); Ulrich & Hillemann 2024, "Uncertainty-aware hand-eye
//! calibration" (robot poses as observations).

pub(crate) mod chain;
pub(crate) mod equations;
mod normal;
mod optimise;
pub mod prediction;
mod variance;

use nalgebra::{DMatrix, Matrix6, Point3, Vector6};

use super::{HandEye, HandEyeError, Mode};
use crate::camera::Intrinsics;
use crate::frames::{Anchor, Camera, Mount, Pose, Target};
use crate::observation::View;
use crate::progress::{Stage, Work};

pub use chain::camera_from_target;

/// Noise levels, one standard deviation per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of a corner, pixels.
    pub corner_px: f64,
    /// Of the reported tip position, metres.
    pub robot_m: f64,
    /// Of the reported tip orientation, radians.
    pub robot_rad: f64,
}

/// The data and what is known beforehand.
#[derive(Debug, Clone, Copy)]
pub struct JointProblem<'a> {
    /// Where the camera sits.
    pub mode: Mode,
    /// Points of the target in its frame, metres.
    pub points: &'a [Point3<f64>],
    /// Views with corners; a view without corners is an error of the caller.
    pub views: &'a [View],
    /// Whether focal lengths, principal point and distortion are estimated too.
    pub free_intrinsics: bool,
    /// Noise levels when they are known; otherwise they are estimated.
    pub noise: Option<Noise>,
}

/// Where the iteration starts.
#[derive(Debug, Clone, Copy)]
pub struct JointStart {
    /// Hand-eye transform, from a closed form.
    pub mount_from_camera: Pose<Mount, Camera>,
    /// Place of the target.
    pub anchor_from_target: Pose<Anchor, Target>,
    /// Intrinsics; kept when they are not free.
    pub intrinsics: Intrinsics,
}

/// What happened to one view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewFit {
    /// RMS of its 2-D corner residuals with the robot pose corrected, pixels.
    pub rms_px: f64,
    /// Correction of the reported tip pose: translation [m] and rotation vector [rad] in the tip frame.
    pub correction: Vector6<f64>,
    /// The target's pose by the chain with the robot pose corrected.
    pub camera_from_target: Pose<Camera, Target>,
    /// How far the camera point [`JointSolution::reference_point`] moves when this view is left out, metres, to first
    /// order; `None` when the rest does not determine an answer.
    pub influence_m: Option<f64>,
}

/// The joint estimate.
#[derive(Debug, Clone)]
pub struct JointSolution {
    /// Both rigid links.
    pub hand_eye: HandEye,
    /// The intrinsics, estimated or as given.
    pub intrinsics: Intrinsics,
    /// Covariance of `[mount_from_camera (6), anchor_from_target (6), free intrinsics…]`, metres, radians, pixels;
    /// right perturbations. It includes the robot's noise and the uncertainty of every other unknown, but not that of
    /// the noise levels.
    pub covariance: DMatrix<f64>,
    /// Noise levels, given or estimated.
    pub noise: Noise,
    /// One entry per view, in the order given.
    pub views: Vec<ViewFit>,
    /// RMS of all 2-D corner residuals with robot poses corrected, pixels.
    pub rms_px: f64,
    /// Middle of the target as the camera saw it on average, in camera coordinates [m]: where errors are stated.
    pub reference_point: Point3<f64>,
    /// Steps of the optimiser in all rounds together.
    pub iterations: usize,
}

impl JointSolution {
    /// Covariance of the hand-eye transform `[t; r]`, right perturbation.
    pub fn hand_eye_covariance(&self) -> Matrix6<f64> {
        self.covariance.fixed_view::<6, 6>(0, 0).into_owned()
    }

    /// Covariance of the target's place `[t; r]`, right perturbation.
    pub fn target_covariance(&self) -> Matrix6<f64> {
        self.covariance.fixed_view::<6, 6>(6, 6).into_owned()
    }

    /// Standard deviations of the free intrinsics in the order of [`Intrinsics::parameters`]; empty when fixed.
    pub fn intrinsics_sigma(&self) -> Vec<f64> {
        (12..self.covariance.nrows()).map(|i| self.covariance[(i, i)].max(0.0).sqrt()).collect()
    }
}

/// Views below which nothing is determined.
pub(crate) const NEED: usize = 3;
/// Rounds of weights and optimum at the most.
const MAX_ROUNDS: usize = 20;
/// Relative change of every noise level below which the rounds end: a thousandth moves the answer by far less than its
/// uncertainty.
const ROUND_TOLERANCE: f64 = 1e-3;

/// Estimates the calibration from corners and reported robot poses. `work` is a `&CancelToken`, or a [`Work`] to follow
/// the progress too.
///
/// # Needs
/// Three views with robot rotations about two axes (check with [`super::motion`] before), every view with at least
/// four corners. `start` within the basin of convergence: any closed form on PnP poses is.
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
    if problem.views.len() < NEED {
        return Err(HandEyeError::TooFewViews { got: problem.views.len(), need: NEED });
    }
    let mut state = optimise::State::new(problem, start);
    let mut noise = problem.noise.unwrap_or_else(|| variance::starting_noise(problem, &state));
    let mut iterations = 0;
    for round in 0..MAX_ROUNDS {
        work.report(Stage::Joint, round, MAX_ROUNDS);
        iterations += optimise::minimise(problem, &mut state, &noise, work.cancel)?;
        if problem.noise.is_some() {
            break;
        }
        let system = normal::System::new(problem, &state, work.cancel)?;
        let next = variance::restricted_likelihood(&system, &noise)?;
        let settled = variance::change(&noise, &next) < ROUND_TOLERANCE;
        noise = next;
        if settled {
            break;
        }
    }
    iterations += optimise::minimise(problem, &mut state, &noise, work.cancel)?;
    finish(problem, &state, noise, iterations, &work)
}

fn finish(
    problem: &JointProblem<'_>,
    state: &optimise::State,
    noise: Noise,
    iterations: usize,
    work: &Work<'_>,
) -> Result<JointSolution, HandEyeError> {
    let system = normal::System::new(problem, state, work.cancel)?;
    let reduced = system.reduce(&noise)?;
    let covariance = reduced.inverse();
    let reference_point = state.mean_target_centre(problem);
    let mut views = Vec::with_capacity(problem.views.len());
    for ((block, correction), view) in system.blocks.iter().zip(&state.corrections).zip(problem.views) {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        views.push(ViewFit {
            rms_px: (block.squared_px / block.corner_count() as f64).sqrt(),
            correction: *correction,
            camera_from_target: Pose::from_isometry(state.chain(problem, view, correction).camera_from_target),
            influence_m: reduced.influence_of(block, &noise, correction, &reference_point),
        });
    }
    let corners: usize = system.blocks.iter().map(normal::ViewBlock::corner_count).sum();
    Ok(JointSolution {
        hand_eye: HandEye::new(problem.mode, state.mount_from_camera, state.anchor_from_target),
        intrinsics: state.intrinsics,
        covariance,
        noise,
        views,
        rms_px: (system.squared_px() / corners as f64).sqrt(),
        reference_point,
        iterations,
    })
}

#[cfg(test)]
pub(crate) mod simulated;
#[cfg(test)]
mod tests;
