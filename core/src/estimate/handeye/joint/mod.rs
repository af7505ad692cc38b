//! The joint estimator: all corners of all views at once, with a noisy robot.
//!
//! # What it estimates
//! `mount_from_camera` and `anchor_from_target` (see [`super`]), a correction of every reported robot pose and, as far as
//! they are [`Free`], the intrinsics, the shape of the target and the offsets of the robot's joints; with them the noise
//! levels that weigh corners against robot poses.
//!
//! # Model
//! Corner `j` of view `i`: `px_ij = project(camera_from_target_i * point_j) + noise`, noise independent and Gaussian
//! with `corner_px` per axis; where the data ask for it, the part of a view's noise that looks like a pose is larger
//! (`view_px`). The chain is `camera_from_target_i = mount_from_camera⁻¹ * mount_from_anchor_i *
//! anchor_from_target`. The true tip pose is `base_from_tip_i * E_i`, where `E_i` has translation `rho_i` and rotation
//! `exp(phi_i)`; both are Gaussian with `robot_m` and `robot_rad` per axis. Without `E_i` the answer would be worse
//! than a closed form on any real robot, because a tenth of a degree moves a corner by far more than its own noise.
//!
//! # How
//! Levenberg–Marquardt with analytic Jacobians; the corrections are eliminated view by view (Schur complement), so the
//! cost grows linearly with the number of views. The noise levels maximise the restricted likelihood (REML) of the
//! linearised model ([`variance`]); both steps alternate until the levels stand still. What estimated levels do to the
//! covariance is in [`freedom`].
//!
//! # Reference
//! Triggs et al. 2000, "Bundle adjustment — a modern synthesis", §6; Patterson & Thompson 1971, "Recovery of
//! inter-block information when block sizes are unequal" (REML); Ulrich & Hillemann 2024, "Uncertainty-aware hand-eye
//! calibration" (robot poses as observations).

pub(crate) mod chain;
pub(crate) mod equations;
mod freedom;
mod gram;
pub(crate) mod normal;
pub(crate) mod optimise;
pub mod outliers;
pub mod prediction;
mod variance;
pub(crate) mod view_block;
mod weights;

use nalgebra::{DMatrix, Matrix6, Point3, Vector6};

use super::motion::MIN_VIEWS;
use super::{HandEye, HandEyeError, Mode};
use crate::geometry::camera::Intrinsics;
use crate::geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use crate::progress::{Stage, Work};
use crate::targets::bent::{BoardPoints, BoardShape};
use crate::targets::observation::{Corner, View};

pub use chain::{MAX_JOINTS, base_from_tip_by_joints, camera_from_target};
pub use freedom::SmallSample;
pub use weights::CornerWeights;

use variance::Levels;

/// Noise levels, one standard deviation per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of a corner, pixels.
    pub corner_px: f64,
    /// Of what all corners of a view have in common beyond that, pixels: errors of lens, target and image that look like
    /// a pose. A pose from `n` corners has the covariance `(corner_px² + view_px²) (Jᵀ J)⁻¹`. Zero where the data ask for
    /// none.
    pub view_px: f64,
    /// Of the reported tip position, metres.
    pub robot_m: f64,
    /// Of the reported tip orientation, radians.
    pub robot_rad: f64,
}

/// What is estimated besides the two rigid links.
#[expect(clippy::struct_excessive_bools, reason = "each is a choice of its own")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Free {
    /// Focal lengths, principal point and distortion.
    pub intrinsics: bool,
    /// The two warps of the target, see [`BoardShape`].
    pub warp: bool,
    /// The true size of the target over the stated one. It is seen through the robot's translations alone.
    pub scale: bool,
    /// A constant offset of every joint, where the views say how the tip turns with them, with a prior of
    /// [`JOINT_PRIOR_RAD`]. Those of the first and the last joint stay zero: the two links take them up.
    pub joints: bool,
}

impl Free {
    pub(crate) fn form(self) -> equations::FreeParameters {
        equations::FreeParameters { lens: self.intrinsics, warp: self.warp, scale: self.scale }
    }
}

/// What is known of free intrinsics beforehand.
#[derive(Debug, Clone, Copy)]
pub struct LensPrior<'a> {
    /// The expected intrinsics.
    pub expected: Intrinsics,
    /// Standard deviations in the order of [`Intrinsics::parameters`]; one that is not finite and positive says nothing.
    pub sigma: &'a [f64],
}

/// The data and what is known beforehand.
#[derive(Debug, Clone, Copy)]
pub struct JointProblem<'a> {
    /// Where the camera sits.
    pub mode: Mode,
    /// Points of the target as drawn.
    pub board: &'a BoardPoints,
    /// Views with corners; a view without corners is an error of the caller.
    pub views: &'a [View],
    /// What is estimated besides the links.
    pub free: Free,
    /// What is known of free intrinsics.
    pub lens_prior: Option<LensPrior<'a>>,
    /// How corners are weighed against each other; `None` for all alike.
    pub weights: Option<CornerWeights>,
    /// Noise levels when they are known; otherwise they are estimated.
    pub noise: Option<Noise>,
}

impl<'a> JointProblem<'a> {
    /// Both links from these views, with known intrinsics and a flat target, all corners alike, noise levels estimated.
    pub fn new(mode: Mode, board: &'a BoardPoints, views: &'a [View]) -> Self {
        Self { mode, board, views, free: Free::default(), lens_prior: None, weights: None, noise: None }
    }

    /// Number of joint offsets that are estimated: none unless all views know their joints.
    fn joint_count(&self) -> usize {
        let fewest = self.views.iter().map(|view| view.tip_by_joint.len()).min().unwrap_or(0);
        if self.free.joints { fewest.min(MAX_JOINTS) } else { 0 }
    }
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
    /// Shape of the target; kept when it is not free.
    pub shape: BoardShape,
    /// Noise levels to start from, where they are to be estimated; `None` finds a start from the misfit.
    pub noise: Option<Noise>,
}

/// What happened to one view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewFit {
    /// RMS of its 2-D corner residuals with the robot pose corrected, pixels.
    pub rms_px: f64,
    /// Correction of the reported tip pose: translation \[m\] and rotation vector \[rad\] in the tip frame.
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
    /// Shape of the target, estimated or as given.
    pub shape: BoardShape,
    /// Offsets of the joints, radians, to be added to the reported angles; empty when they were not estimated.
    pub joint_offsets_rad: Vec<f64>,
    /// Covariance of `[mount_from_camera (6), anchor_from_target (6), free intrinsics…, free warps, free scale, joints]`,
    /// metres, radians, pixels; right perturbations. It includes the robot's noise and the uncertainty of every other
    /// unknown, that of estimated noise levels too.
    pub covariance: DMatrix<f64>,
    /// How the error of the hand-eye transform is distributed in units of its covariance.
    pub small_sample: SmallSample,
    /// What was estimated.
    pub free: Free,
    /// Noise levels, given or estimated.
    pub noise: Noise,
    /// One entry per view, in the order given.
    pub views: Vec<ViewFit>,
    /// RMS of all 2-D corner residuals with robot poses corrected, pixels.
    pub rms_px: f64,
    /// Middle of the target as the camera saw it on average, in camera coordinates \[m\]: where errors are stated.
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
        (12..12 + self.free.form().warp_at(&self.intrinsics)).map(|i| self.sigma(i)).collect()
    }

    /// Covariance of the two warps, square metres; `None` when they were not estimated.
    pub fn warp_covariance(&self) -> Option<nalgebra::Matrix2<f64>> {
        let at = 12 + self.free.form().warp_at(&self.intrinsics);
        self.free.warp.then(|| self.covariance.fixed_view::<2, 2>(at, at).into_owned())
    }

    /// Standard deviation of the scale; `None` when it was not estimated.
    pub fn scale_sigma(&self) -> Option<f64> {
        self.free.scale.then(|| self.sigma(12 + self.free.form().scale_at(&self.intrinsics)))
    }

    /// Standard deviations of the joint offsets, radians.
    pub fn joint_offsets_sigma(&self) -> Vec<f64> {
        let n = self.covariance.nrows();
        (n - self.joint_offsets_rad.len()..n).map(|i| self.sigma(i)).collect()
    }

    fn sigma(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }

    /// Multiplies the covariance, because the data show that it is too small.
    pub fn widen(&mut self, factor: f64) {
        self.covariance *= factor;
    }

    /// Where the iteration ended, to start another from.
    pub fn as_start(&self) -> JointStart {
        JointStart {
            mount_from_camera: self.hand_eye.mount_from_camera(),
            anchor_from_target: self.hand_eye.anchor_from_target(),
            intrinsics: self.intrinsics,
            shape: self.shape,
            noise: Some(self.noise),
        }
    }
}

/// Standard deviation of a joint's offset before any data: a robot that is a degree off is a broken one, and without a
/// prior the offsets of the first and the last joint could not be told from the links.
pub const JOINT_PRIOR_RAD: f64 = 0.02;
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
    if problem.views.len() < MIN_VIEWS {
        return Err(HandEyeError::TooFewViews { got: problem.views.len(), need: MIN_VIEWS });
    }
    let mut state = optimise::State::new(problem, start);
    let mut noise = problem.noise.or(start.noise).unwrap_or_else(|| variance::starting_noise(problem, &state));
    let mut levels = Levels::Three;
    if problem.noise.is_none() {
        // Whether the corners of a view share noise is decided by these views alone, not by where the fit began.
        noise.view_px = 0.0;
    }
    let mut iterations = 0;
    for round in 0..MAX_ROUNDS {
        work.report(Stage::Joint, round, MAX_ROUNDS);
        let (system, steps) = optimise::minimise(problem, &mut state, &noise, work.cancel)?;
        iterations += steps;
        if problem.noise.is_some() {
            break;
        }
        let (mut next, likelihood) = variance::restricted_likelihood(&system, &noise, levels)?;
        let mut settled = variance::change(&noise, &next) < ROUND_TOLERANCE;
        if settled && levels == Levels::Three {
            let start = Noise { view_px: next.corner_px, ..next };
            let (with_view, larger) = variance::restricted_likelihood(&system, &start, Levels::WithView)?;
            if likelihood - larger > VIEW_NOISE_GAIN {
                (levels, next, settled) = (Levels::WithView, with_view, false);
            }
        }
        noise = next;
        if settled {
            break;
        }
    }
    if levels == Levels::WithView && noise.view_px < NO_VIEW_NOISE * noise.corner_px {
        // It was asked for on the way and is not needed at the end.
        noise.view_px = 0.0;
        levels = Levels::Three;
    }
    let (system, steps) = optimise::minimise(problem, &mut state, &noise, work.cancel)?;
    finish(problem, &state, &system, noise, levels, iterations + steps, &work)
}

/// Noise of the view below this part of a corner's noise is none.
const NO_VIEW_NOISE: f64 = 0.05;

/// Gain of minus twice the log-likelihood from which a noise that all corners of a view share is taken into the model: by
/// chance one session in a thousand. The level is at the edge of what it can be, so half of all healthy sessions gain
/// nothing and the rest follows chi-square with one degree of freedom (Self & Liang 1987). Robot errors that neighbouring
/// poses share can look like it and gain up to nine in sessions of fifteen views.
const VIEW_NOISE_GAIN: f64 = 9.55;

fn finish(
    problem: &JointProblem<'_>,
    state: &optimise::State,
    system: &normal::System,
    noise: Noise,
    levels: Levels,
    iterations: usize,
    work: &Work<'_>,
) -> Result<JointSolution, HandEyeError> {
    let reduced = system.reduce(&noise)?;
    let reference_point = state.mean_target_centre(problem);
    let plain = reduced.inverse();
    let adjusted = if problem.noise.is_some() {
        freedom::Adjusted { covariance: plain, small_sample: SmallSample::KNOWN }
    } else {
        freedom::adjust(system, &noise, levels, plain)?
    };
    let points = problem.board.points(&state.shape);
    let mut views = Vec::with_capacity(problem.views.len());
    let (mut squared_px, mut corners) = (0.0, 0usize);
    for ((block, correction), view) in system.blocks.iter().zip(&state.corrections).zip(problem.views) {
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
            influence_m: reduced.influence_of(block, system.layout, &noise, correction, &reference_point),
        });
    }
    Ok(JointSolution {
        hand_eye: HandEye::new(problem.mode, state.mount_from_camera, state.anchor_from_target),
        intrinsics: state.intrinsics,
        shape: state.shape,
        joint_offsets_rad: state.joints_rad.clone(),
        covariance: adjusted.covariance,
        small_sample: adjusted.small_sample,
        free: problem.free,
        noise,
        views,
        rms_px: (squared_px / corners as f64).sqrt(),
        reference_point,
        iterations,
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
pub(crate) mod simulated;
#[cfg(test)]
mod tests;
