//! Result of the joint estimate.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, Matrix5, Matrix6, Point3, Vector6};

use crate::handeye::joint::JointProblem;
use crate::handeye::joint::arm_errors::ArmErrors;
use crate::handeye::joint::integrated::SmallSample;
use crate::handeye::joint::normal::System;
use crate::handeye::joint::pose_dependent_error::{PoseDependentError, corrected_base_from_tip};
use crate::handeye::joint::problem::{Free, JointStart, Noise};
use crate::handeye::{HandEye, HandEyeError};
use crate::uncertainty::overdispersion::widening::{Overdispersion, with_less_known};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::observation::View;
use handeye_geometry::view_equations::DepthBias;

/// Result for one view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewFit {
    /// RMS of its 2-D corner residuals with the robot pose corrected, pixels.
    pub rms_px: f64,
    /// Correction of the reported tip pose beyond that of the field: translation \[m\] and rotation vector \[rad\] in the tip
    /// frame.
    pub correction: Vector6<f64>,
    /// The target's pose by the chain with the robot pose corrected.
    pub camera_from_target: Pose<Camera, Target>,
    /// Distance by which the camera point [`JointSolution::reference_point`] moves when this view is left out, metres,
    /// to first order; `None` when the rest does not determine an answer, and before the error is stated.
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
    /// Errors of the depths; none where they were not estimated.
    pub depth: DepthBias,
    /// Errors of the robot's arm; `None` when they were not estimated.
    pub arm: Option<ArmErrors>,
    /// Pose-dependent errors of the robot; `None` when they were not estimated.
    pub field: Option<PoseDependentError>,
    /// Minus twice the log of the restricted likelihood of the noise levels; `None` when these were given.
    pub deviance: Option<f64>,
    /// Covariance of `[mount_from_camera (6), anchor_from_target (6), free intrinsics…, free warps, free scale, errors of
    /// depths, slopes of the field, errors of the arm]`, metres, radians, pixels; right perturbations. It includes the robot's
    /// noise and the uncertainty of every other unknown, including estimated noise levels.
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
    /// The views, linearised where the fit ended.
    pub(super) system: Arc<System>,
}

impl JointSolution {
    /// The views, linearised at the solution.
    ///
    /// # Errors
    /// [`HandEyeError::NoSolution`] when it is not a solution of the problem.
    pub(crate) fn linearised(&self, problem: &JointProblem<'_>) -> Result<&System, HandEyeError> {
        let views = problem.views.len();
        if self.views.len() != views || self.free != problem.free {
            let reason = "the solution is of another problem";
            return Err(HandEyeError::NoSolution { method: "what follows the joint estimate", views, reason });
        }
        Ok(&self.system)
    }

    /// Covariance of the hand-eye transform `[t; r]`, right perturbation.
    pub fn hand_eye_covariance(&self) -> Matrix6<f64> {
        self.covariance.fixed_view::<6, 6>(0, 0).into_owned()
    }

    /// Covariance of the target's place `[t; r]`, right perturbation.
    pub(crate) fn target_covariance(&self) -> Matrix6<f64> {
        self.covariance.fixed_view::<6, 6>(6, 6).into_owned()
    }

    /// Standard deviations of the free intrinsics in the order of [`Intrinsics::parameters`]; empty when fixed.
    pub(crate) fn intrinsics_sigma(&self) -> Vec<f64> {
        self.lens_places().map(|i| self.sigma(i)).collect()
    }

    /// Covariance of the two warps, square metres; `None` when they were not estimated.
    pub(crate) fn warp_covariance(&self) -> Option<nalgebra::Matrix2<f64>> {
        let at = 12 + self.free.form().warp_at(&self.intrinsics);
        self.free.warp.then(|| self.covariance.fixed_view::<2, 2>(at, at).into_owned())
    }

    /// Standard deviation of the scale; `None` when it was not estimated.
    pub fn scale_sigma(&self) -> Option<f64> {
        self.free.scale.then(|| self.sigma(12 + self.free.form().scale_at(&self.intrinsics)))
    }

    /// Covariance of the errors of the depths, in the order of [`DepthBias`]; zero when they were not estimated.
    pub(crate) fn depth_covariance(&self) -> Matrix5<f64> {
        let at = 12 + self.free.form().depth_at(&self.intrinsics);
        if self.free.depth { self.covariance.fixed_view::<5, 5>(at, at).into_owned() } else { Matrix5::zeros() }
    }

    fn sigma(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }

    /// Multiplies the covariance, and that of a free lens with what rests on it, because the data show that they are too small.
    pub fn widen(&mut self, widening: &Overdispersion) {
        if widening.lens > 1.0 {
            self.covariance = with_less_known(&self.covariance, self.lens_places(), widening.lens);
        }
        self.covariance *= widening.factor;
    }

    /// Where the free intrinsics are in the covariance; empty when they are fixed.
    pub(crate) fn lens_places(&self) -> Range<usize> {
        12..12 + self.free.form().warp_at(&self.intrinsics)
    }

    /// The reported tip pose of a view with what is known of the robot's errors taken out: those of its arm and its field.
    pub(crate) fn base_from_tip(&self, view: &View) -> Pose<Base, Tip> {
        corrected_base_from_tip(view, self.arm.as_ref(), self.field.as_ref())
    }

    /// The end of the iteration as the start of another.
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
