//! Input of the joint estimate.

use nalgebra::DMatrix;

use crate::handeye::Mode;
use crate::handeye::joint::arm_errors::ArmErrors;
use crate::handeye::joint::pose_dependent_error::{Axes, IN_BOTH, IN_TIP, Places, PoseDependentError};
use crate::handeye::joint::state::State;
use crate::handeye::joint::weights::CornerWeights;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
pub use handeye_geometry::observations::Noise;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::View;
use handeye_geometry::view_equations::{FreeParameters, MeasuredDepths, ViewInput, Whitener};

/// What is estimated in addition to the two rigid links.
#[expect(clippy::struct_excessive_bools, reason = "each is a choice of its own")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Free {
    /// Focal lengths, principal point and distortion.
    pub intrinsics: bool,
    /// The two warps of the target, see [`BoardShape`].
    pub warp: bool,
    /// The true size of the target over the stated one. It is determined only by the robot's translations.
    pub scale: bool,
    /// Errors of the robot's arm, where all views have joint values, see [`ArmErrors`].
    pub arm: bool,
    /// Pose-dependent errors of the robot, see [`PoseDependentError`].
    pub field: bool,
    /// Errors of the depths of the views, see [`DepthBias`](handeye_geometry::view_equations::DepthBias).
    pub depth: bool,
}

impl Free {
    pub(crate) fn form(self) -> FreeParameters {
        FreeParameters { lens: self.intrinsics, warp: self.warp, scale: self.scale, depth: self.depth }
    }
}

/// What is known of free intrinsics beforehand.
#[derive(Debug, Clone, Copy)]
pub struct LensPrior<'a> {
    /// The lens that is expected.
    pub expected: Intrinsics,
    /// Inverse of their covariance, in the order of [`Intrinsics::parameters`], one row each; zero in a direction of
    /// which nothing is known.
    pub information: &'a DMatrix<f64>,
}

/// Weight of depths against corners, and what is known of their tilt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthWeight {
    /// Pixels of corner error that count as much as a metre of depth error.
    pub px_per_m: f64,
    /// Whether their rotation against the lens is unknown; otherwise they are measured along it.
    pub turned: bool,
}

impl DepthWeight {
    /// Standard deviation of the tilt of the depths before any data, about either axis, radians.
    pub(super) fn tilt_sigma_rad(self) -> f64 {
        if self.turned { TURNED_RAD } else { STRAIGHT_RAD }
    }
}

/// Standard deviation of the tilt of depths that are not measured along the lens, about either axis, radians. That it is 0.3° is an
/// assumption about mountings of two sensors; its order is what matters. Where the tilt is known to a twentieth of it, depths count
/// as turned from 3.5 of the tilt's standard deviations on, and with three times as much from 4.0.
const TURNED_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;
/// And of those that are measured along it: practically zero.
const STRAIGHT_RAD: f64 = 1e-7;

/// The data and what is known beforehand.
#[derive(Debug, Clone, Copy)]
pub struct JointProblem<'a> {
    /// Where the camera is mounted.
    pub mode: Mode,
    /// Points of the target as drawn.
    pub board: &'a BoardPoints,
    /// Views with corners; a view without corners is an error of the caller.
    pub views: &'a [View],
    /// What is estimated in addition to the links.
    pub free: Free,
    /// What is known of free intrinsics.
    pub lens_prior: Option<LensPrior<'a>>,
    /// How corners are weighed against each other; `None` for equal weights.
    pub weights: Option<CornerWeights>,
    /// Weight of the depths of the views; `None` where they do not count.
    pub depth: Option<DepthWeight>,
    /// Noise levels when they are known; otherwise they are estimated.
    pub noise: Option<Noise>,
    /// Whether the corners of a view share noise ([`Noise::view_px`]), where that is decided; otherwise these views decide.
    pub view_noise: Option<bool>,
}

impl<'a> JointProblem<'a> {
    /// Both links from these views, with known intrinsics and a flat target, equal weights of all corners, noise levels
    /// estimated.
    pub fn new(mode: Mode, board: &'a BoardPoints, views: &'a [View]) -> Self {
        Self {
            mode,
            board,
            views,
            free: Free::default(),
            lens_prior: None,
            weights: None,
            depth: None,
            noise: None,
            view_noise: None,
        }
    }

    /// A view through the lens of a state, with the whitener of its corners.
    pub(super) fn seen<'v>(&'v self, state: &'v State, view: &'v View, whitener: &'v Whitener) -> ViewInput<'v> {
        ViewInput {
            intrinsics: &state.intrinsics,
            board: self.board,
            shape: &state.shape,
            corners: &view.corners,
            whitener,
            depths: self.depth.zip(view.depth.as_ref()).map(|(weight, plane)| MeasuredDepths {
                plane,
                bias: &state.depth,
                px_per_m: weight.px_per_m,
            }),
        }
    }

    /// Weights of the corners of a view.
    pub(super) fn whitener(&self, view: &View) -> Whitener {
        self.weights.map_or(Whitener::Alike, |weights| weights.whitener(&view.corners))
    }

    /// The arm without errors, where they are free and all views have joint values; with a field where that is free,
    /// too.
    pub(crate) fn arm(&self) -> Option<ArmErrors> {
        let joints = self.views.first()?.tip_from_joints.len();
        let all = joints > 1 && self.views.iter().all(|view| view.tip_from_joints.len() == joints);
        (self.free.arm && all).then(|| ArmErrors::none(joints).with_field(self.free_field(IN_BOTH)))
    }

    /// The field without errors, where it is free and not part of an arm's errors.
    pub(super) fn field(&self) -> Option<PoseDependentError> {
        if self.arm().is_some() { None } else { self.free_field(IN_TIP) }
    }

    /// Where the tip does not stay where it is.
    fn free_field(&self, frames: &'static [Axes]) -> Option<PoseDependentError> {
        let poses = self.views.iter().map(|view| &view.base_from_tip);
        let places = Places::of(poses).filter(|_| self.free.field)?;
        Some(PoseDependentError::none(places, frames))
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
