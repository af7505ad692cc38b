//! A calibration against captures that were never in its fit.
//!
//! The bare chain — reported robot pose and calibration, nothing fitted — predicts where the board is; the corners show
//! where it was seen. Both use the board and the joints as the calibration found them. The difference is the error that
//! a user of the calibration gets: that of the calibration, of the robot and of the image together. It is an error of
//! prediction, measured on the board; it is not the residual of any fit.

mod calibrated;
mod consistency;
mod depth_camera;
mod points;

use nalgebra::{Point3, Vector3};

use crate::CornerResidual;
use handeye_geometry::camera::CameraError;
use handeye_geometry::frames::{Anchor, Base, Camera, Pose, Target, Tip};
use handeye_geometry::planar_pose::{self, PoseError};
use handeye_geometry::progress::{Stage, Work};
use handeye_geometry::se3;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::BoardPoints;
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::view_equations::{DepthBias, PredictedDepths};

pub use crate::corrected_arm::TipAt;
pub use calibrated::{Predictor, Uncertainty};
pub use consistency::Consistency;
pub use depth_camera::{DepthCheck, DepthErrors, DepthReport, Estimated};
pub use points::MeasuredPoint;

/// Why there is nothing to verify with.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum VerifyError {
    /// The calibration is of a camera alone.
    #[error("the calibration has no hand-eye transform: calibrate with robot poses first")]
    NoHandEye,
    /// The calibration is from pose pairs.
    #[error("the calibration has no intrinsics: verification compares pixels, so the camera must be known")]
    NoIntrinsics,
    /// No capture was given.
    #[error("there is no capture to verify with: capture the board at poses that were not in the fit")]
    NoCaptures,
    /// The target's pose could not be found in a capture.
    #[error("capture {name:?}: {source}")]
    NoPose {
        /// Which capture.
        name: String,
        /// What failed.
        source: PoseError,
    },
    /// A capture whose robot pose is not finite.
    #[error("the robot pose of capture {name:?} is not finite: capture it again")]
    NotFinite {
        /// Which capture.
        name: String,
    },
    /// A capture without the joints of the arm whose errors are known.
    #[error("the joints of capture {name:?} are not known: capture it again with the robot connected")]
    NoJoints {
        /// Which capture.
        name: String,
    },
    /// The chain predicts the board where the camera cannot see it, although it did.
    #[error(
        "the calibration predicts the board of capture {name:?} behind the camera: the calibration is of another set-up, \
         or the board was moved"
    )]
    PredictedBehind {
        /// Which capture.
        name: String,
    },
    /// A pixel without ray.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A value that is not a valid depth.
    #[error("{depth_m} m is not a valid depth: choose a pixel with a measurement")]
    BadDepth {
        /// The depth given, metres.
        depth_m: f64,
    },
    /// The ray of a pixel does not meet the plane of the board in front of the camera.
    #[error(
        "the ray of pixel ({u_px:.1}, {v_px:.1}) does not meet the plane of the board: choose a pixel on the board"
    )]
    MissesBoard {
        /// Column in pixels.
        u_px: f64,
        /// Row in pixels.
        v_px: f64,
    },
    /// The caller asked the work to end.
    #[error("cancelled")]
    Cancelled,
}

/// Result for one capture.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureCheck {
    /// Name of the capture.
    pub name: String,
    /// RMS of the 2-D distances between measured corners and those that the bare chain predicts, pixels.
    pub rms_px: f64,
    /// The same with the board's pose fitted to this one image: the part due to corners and lens, pixels.
    pub pnp_rms_px: f64,
    /// Every corner against its prediction.
    pub residuals: Vec<CornerResidual>,
    /// The board as predicted.
    pub predicted_camera_from_target: Pose<Camera, Target>,
    /// The board as seen: its pose from the corners, and from the depths where the calibration uses them, with the shape that
    /// the calibration found.
    pub seen_camera_from_target: Pose<Camera, Target>,
    /// Middle of the board as seen minus as predicted, in camera axes, metres.
    pub centre_error_m: Vector3<f64>,
    /// Angle between the board as seen and as predicted, radians.
    pub orientation_error_rad: f64,
    /// Origin of the board as seen minus as predicted, in base axes, metres.
    pub origin_error_in_base_m: Vector3<f64>,
    /// Measured depth minus that of the predicted board where its corners are on average, metres; `None` without depths of the
    /// board's plane.
    pub depth_error_m: Option<f64>,
    /// Squared error of the board's pose over what the stated uncertainty expects, per degree of freedom: 1 on average,
    /// above 2.8 in one of a hundred captures. `None` when no uncertainty is stated.
    pub ratio: Option<f64>,
}

/// Result of all captures together.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// One entry per capture, in the order given.
    pub captures: Vec<CaptureCheck>,
    /// RMS over all corners of all captures, pixels.
    pub rms_px: f64,
    /// RMS of the distance between the board's middle as seen and as predicted, metres.
    pub centre_rms_m: f64,
    /// RMS of the angle between the board as seen and as predicted, radians.
    pub orientation_rms_rad: f64,
    /// Scatter of the board's origin over the captures, each located by robot, calibration and its own image: RMS
    /// distance from the mean, metres. In the frame in which the board is at rest: the base, or the tip when the camera
    /// does. A board that was moved after the calibration leaves it small while every prediction is wrong by the same
    /// amount. `None` for one capture.
    pub origin_scatter_m: Option<f64>,
    /// Whether the errors are of the size that the calibration states.
    pub consistency: Option<Consistency>,
}

impl Verification {
    /// Whether the errors are no larger than the calibration states; `None` where it states nothing.
    pub fn is_as_stated(&self) -> Option<bool> {
        self.consistency.map(|consistency| consistency.is_consistent())
    }
}

/// Checks a calibration with captures, robot pose and sight of the board, that were never in its fit. `work` is a `&CancelToken`,
/// or a [`Work`] to follow the progress.
///
/// # Needs
/// One capture with the board; ten give a useful average. The board has to be where it was for the calibration.
///
/// # Errors
/// [`VerifyError`]; the first in the order of the captures.
pub fn verify<'a>(
    calibrated: &Predictor,
    target: &TargetSpec,
    captures: &[&View],
    work: impl Into<Work<'a>>,
) -> Result<Verification, VerifyError> {
    let work = work.into();
    if captures.is_empty() {
        return Err(VerifyError::NoCaptures);
    }
    let board = calibrated.board(target);
    let mut consistency = calibrated.uncertainty.as_ref().and_then(|it| consistency::Sums::new(calibrated, it));
    let mut checks = Vec::with_capacity(captures.len());
    let mut tips = Vec::with_capacity(captures.len());
    for (done, view) in captures.iter().copied().enumerate() {
        if work.is_cancelled() {
            return Err(VerifyError::Cancelled);
        }
        work.report(Stage::Verification, done, captures.len());
        let base_from_tip = calibrated.base_from_tip(view)?;
        let mut check = check(calibrated, target, &board, view, &base_from_tip)?;
        check.ratio = consistency.as_mut().and_then(|sums| sums.add(calibrated, &board, view, &check));
        checks.push(check);
        tips.push(base_from_tip);
    }
    Ok(summary(calibrated, &tips, checks, consistency.and_then(consistency::Sums::finish)))
}

fn check(
    calibrated: &Predictor,
    target: &TargetSpec,
    board: &BoardPoints,
    view: &View,
    base_from_tip: &Pose<Base, Tip>,
) -> Result<CaptureCheck, VerifyError> {
    let name = || view.name.clone();
    let no_pose = |source| VerifyError::NoPose { name: name(), source };
    // This checks the corners, so every index below is a point of the target.
    let poses = planar_pose::solve(&view.corners, target, &calibrated.intrinsics).map_err(no_pose)?;
    let predicted = calibrated.camera_from_target(base_from_tip);
    let flat = poses.nearer_to(&predicted, view.corners.len()).camera_from_target;
    let seen = calibrated
        .seen(board, (&view.corners, view.depth.as_ref()), &flat)
        .ok_or_else(|| no_pose(PoseError::NoPose { corners: view.corners.len() }))?;
    let points = board.points(&calibrated.shape);
    let residuals_at = |camera_from_target: &Pose<Camera, Target>| -> Result<Vec<CornerResidual>, CameraError> {
        let residual = |corner: &Corner| {
            let px = calibrated.intrinsics.project(&(camera_from_target.isometry() * points[corner.index]))?;
            Ok(CornerResidual { index: corner.index, px: corner.px, residual_px: corner.px - px })
        };
        view.corners.iter().map(residual).collect()
    };
    let residuals = residuals_at(&predicted).map_err(|_behind| VerifyError::PredictedBehind { name: name() })?;
    let centre = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64);
    let origin_error = seen.translation() - predicted.translation();
    Ok(CaptureCheck {
        name: name(),
        rms_px: rms(residuals.iter().map(|r| r.residual_px.norm_squared())),
        pnp_rms_px: rms(residuals_at(&seen)?.iter().map(|r| r.residual_px.norm_squared())),
        centre_error_m: seen.isometry() * centre - predicted.isometry() * centre,
        orientation_error_rad: se3::rotation_vector(&(predicted.inverse() * seen).rotation()).norm(),
        origin_error_in_base_m: calibrated.base_from_camera(base_from_tip).rotation() * origin_error,
        depth_error_m: view.depth.as_ref().map(|plane| depth_error_m(calibrated, plane, &predicted)),
        residuals,
        predicted_camera_from_target: predicted,
        seen_camera_from_target: seen,
        ratio: None,
    })
}

/// Depth error against the predicted board.
fn depth_error_m(calibrated: &Predictor, plane: &DepthPlane, predicted: &Pose<Camera, Target>) -> f64 {
    let (lens, shape) = (&calibrated.intrinsics, &calibrated.shape);
    let expected = PredictedDepths::new(lens, shape, plane, &DepthBias::default(), predicted.isometry());
    plane.depth.x - expected.depth.x
}

fn rms(squares: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = squares.len().max(1) as f64;
    (squares.sum::<f64>() / count).sqrt()
}

fn summary(
    calibrated: &Predictor,
    tips: &[Pose<Base, Tip>],
    checks: Vec<CaptureCheck>,
    consistency: Option<Consistency>,
) -> Verification {
    let mode = calibrated.hand_eye.mode();
    let mount_from_camera = calibrated.hand_eye.mount_from_camera();
    let origins: Vec<Vector3<f64>> = tips
        .iter()
        .zip(&checks)
        .map(|(base_from_tip, check)| {
            let anchor_from_target: Pose<Anchor, Target> =
                mode.anchor_from_mount(base_from_tip) * mount_from_camera * check.seen_camera_from_target;
            anchor_from_target.translation()
        })
        .collect();
    let mean = origins.iter().sum::<Vector3<f64>>() / origins.len() as f64;
    let corners: Vec<f64> =
        checks.iter().flat_map(|c| c.residuals.iter().map(|r| r.residual_px.norm_squared())).collect();
    Verification {
        rms_px: rms(corners.into_iter()),
        centre_rms_m: rms(checks.iter().map(|c| c.centre_error_m.norm_squared())),
        orientation_rms_rad: rms(checks.iter().map(|c| c.orientation_error_rad.powi(2))),
        origin_scatter_m: (origins.len() > 1).then(|| rms(origins.iter().map(|o| (o - mean).norm_squared()))),
        consistency,
        captures: checks,
    }
}

#[cfg(test)]
mod found_tests;
#[cfg(test)]
mod tests;
