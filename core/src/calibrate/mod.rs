//! From observations to a calibration: intrinsics, closed forms, the joint estimate, and what it is worth.
//!
//! One path for the window, the command line and the tests. It needs PnP and intrinsics and with them the feature
//! `opencv`.

mod corners;
mod pairs;
mod to_result;

use nalgebra::{Matrix6, Point3};

use crate::camera::{Distortion, Intrinsics};
use crate::frames::{Base, Camera, Pose, Target, Tip};
use crate::handeye::closed_form::{self, ClosedFormSolution};
use crate::handeye::joint::Noise;
use crate::handeye::{HandEye, HandEyeError, Mode, PosePair, motion};
use crate::observation::Corner;
use crate::progress::CancelToken;
use crate::target::TargetSpec;
use crate::vision::VisionError;

/// What was observed, from a dataset folder, a session or a live capture.
#[derive(Debug, Clone)]
pub struct Observations {
    /// Where the camera sits; `None` when there is no robot and only the camera is calibrated.
    pub mode: Option<Mode>,
    /// The target.
    pub target: TargetSpec,
    /// Width and height of the images in pixels.
    pub image_size: (u32, u32),
    /// What is known about the camera.
    pub camera: CameraKnowledge,
    /// One entry per image, in the order of the pose table.
    pub views: Vec<ObservedView>,
}

/// One image.
#[derive(Debug, Clone)]
pub struct ObservedView {
    /// Its name in reports.
    pub name: String,
    /// The reported robot pose; `None` when there is no robot.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// The corners; `None` when the target was not found.
    pub corners: Option<Vec<Corner>>,
    /// A target pose measured elsewhere, used when there are no corners.
    pub camera_from_target: Option<Pose<Camera, Target>>,
}

/// What is known about the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CameraKnowledge {
    /// These intrinsics, taken as exact.
    Fixed(Intrinsics),
    /// Intrinsics are estimated.
    Estimate {
        /// The lens model; its coefficients do not matter.
        model: Distortion,
        /// Where to start; `None` finds a start from the views.
        start: Option<Intrinsics>,
    },
}

/// Which answer is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// The joint estimate; from pose pairs alone the pose graph.
    #[default]
    Joint,
    /// A closed form, by its name in [`closed_form::all`].
    ClosedForm(&'static str),
}

impl Method {
    /// Names on the command line: `joint` and those of the closed forms.
    pub fn names() -> Vec<&'static str> {
        std::iter::once("joint").chain(closed_form::all().iter().map(|m| m.name())).collect()
    }

    /// The method of that name.
    pub fn by_name(name: &str) -> Option<Self> {
        if name == "joint" {
            return Some(Self::Joint);
        }
        closed_form::by_name(name).map(|m| Self::ClosedForm(m.name()))
    }
}

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// The target was not found in enough images.
    #[error(
        "the target ({target}) was found in {found} of {images} images, at least {need} are needed: check its kind, its \
         number of columns and rows, and that it is wholly in view"
    )]
    TargetNotFound {
        /// In how many.
        found: usize,
        /// Of how many.
        images: usize,
        /// Least number.
        need: usize,
        /// What was looked for.
        target: String,
    },
    /// Intrinsics or PnP failed.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The hand-eye solve failed.
    #[error(transparent)]
    HandEye(#[from] HandEyeError),
    /// A view of a hand-eye set has no robot pose.
    #[error("view {name:?} has no robot pose")]
    NoRobotPose {
        /// Which view.
        name: String,
    },
    /// Neither corners nor target poses.
    #[error("view {name:?} has neither corners nor a target pose")]
    NothingObserved {
        /// Which view.
        name: String,
    },
}

/// A finished calibration.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Both rigid links; `None` without a robot.
    pub hand_eye: Option<HandEye>,
    /// Covariance of the hand-eye transform, right perturbation `[t; r]`; `None` for a closed form.
    pub hand_eye_covariance: Option<Matrix6<f64>>,
    /// Covariance of the target's place.
    pub target_covariance: Option<Matrix6<f64>>,
    /// Intrinsics; `None` when only pose pairs were given.
    pub intrinsics: Option<Intrinsics>,
    /// Whether they were given and kept.
    pub intrinsics_fixed: bool,
    /// Standard deviations of fx, fy, cx, cy in pixels, when they were estimated.
    pub intrinsics_sigma: Option<[f64; 4]>,
    /// Noise levels of the joint estimate.
    pub noise: Option<Noise>,
    /// RMS of 2-D corner residuals, pixels.
    pub rms_px: Option<f64>,
    /// The same on views held out of the fit.
    pub heldout_rms_px: Option<f64>,
    /// Expected error of a measured point where the camera saw the target, 95 %, metres.
    pub tip_error_95_m: Option<f64>,
    /// Where that error is stated: camera coordinates, metres.
    pub reference_point: Option<Point3<f64>>,
    /// Every closed form and what it said.
    pub methods: Vec<MethodResult>,
    /// One entry per view, in the order of the observations.
    pub views: Vec<ViewResult>,
}

/// What one closed form said.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodResult {
    /// Its name.
    pub name: &'static str,
    /// Its answer, or why it has none.
    pub outcome: Result<ClosedFormSolution, HandEyeError>,
}

/// What became of one view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewResult {
    /// Its name.
    pub name: String,
    /// How it was used.
    pub status: ViewStatus,
    /// RMS of its 2-D corner residuals, pixels.
    pub rms_px: Option<f64>,
    /// How far the answer moves without it, metres at the reference point.
    pub influence_m: Option<f64>,
}

/// How a view was used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewStatus {
    /// It took part.
    Used,
    /// The target was not found in it.
    NoTarget,
}

/// Calibrates from observations.
///
/// # Needs
/// Three views with the target in sight; for a hand-eye, robot rotations about two axes.
///
/// # Errors
/// [`CalibrateError`] says what is missing and what to do.
pub fn calibrate(
    observations: &Observations,
    method: Method,
    cancel: &CancelToken,
) -> Result<Calibration, CalibrateError> {
    let only_poses = observations.views.iter().all(|v| v.corners.is_none())
        && observations.views.iter().any(|v| v.camera_from_target.is_some());
    if only_poses { pairs::calibrate(observations, method) } else { corners::calibrate(observations, method, cancel) }
}

/// A robot that never turned is better named than a singular matrix.
fn check_motion(pairs: &[PosePair]) -> Result<(), HandEyeError> {
    let poses: Vec<_> = pairs.iter().map(|pair| pair.anchor_from_mount).collect();
    motion::analyse(&poses).map(drop)
}

/// Runs every closed form.
fn closed_forms(pairs: &[PosePair]) -> Vec<MethodResult> {
    closed_form::all().iter().map(|m| MethodResult { name: m.name(), outcome: m.solve(pairs) }).collect()
}

/// The answer of one closed form, or its error.
fn chosen(methods: &[MethodResult], name: &str) -> Result<ClosedFormSolution, HandEyeError> {
    methods.iter().find(|m| m.name == name).map_or_else(
        || Err(HandEyeError::NoSolution { method: "closed form", views: 0, reason: "no method of that name" }),
        |m| m.outcome.clone(),
    )
}

/// The closed form whose chain fits best by `misfit`; ties go to the first.
fn best_start(
    methods: &[MethodResult],
    misfit: impl Fn(&ClosedFormSolution) -> f64,
) -> Result<ClosedFormSolution, HandEyeError> {
    let best = methods
        .iter()
        .filter_map(|m| m.outcome.as_ref().ok())
        .map(|s| (misfit(s), s))
        .filter(|(m, _)| m.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((_, solution)) => Ok(*solution),
        None => Err(methods.iter().find_map(|m| m.outcome.clone().err()).unwrap_or(HandEyeError::NoSolution {
            method: "the closed forms",
            views: 0,
            reason: "none gave a finite answer",
        })),
    }
}
