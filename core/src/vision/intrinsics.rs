//! Intrinsic calibration from views of a flat target: [`crate::intrinsics`] on corners that are checked first.

use nalgebra::Matrix2;

use super::VisionError;
use super::pnp::check_corners;
use crate::board_shape::BoardPoints;
use crate::camera::{Distortion, Intrinsics};
use crate::frames::{Camera, Pose, Target};
use crate::intrinsics::{Found, IntrinsicsError, Options, SeenView, solve};
use crate::observation::Corner;
use crate::progress::CancelToken;
use crate::target::TargetSpec;

pub use crate::intrinsics::MIN_VIEWS;

/// Standard deviations of the pinhole's four numbers in pixels, for independent corner noise of the size that the
/// residuals show. Errors of the board (bent, misprinted) are not in them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinholeSigma {
    /// Of the focal length along x.
    pub fx: f64,
    /// Of the focal length along y.
    pub fy: f64,
    /// Of the principal point's column.
    pub cx: f64,
    /// Of the principal point's row.
    pub cy: f64,
}

impl PinholeSigma {
    /// Takes them from a calibration.
    pub fn of(found: &Found) -> Self {
        let sigma = |i: usize| found.sigma * found.unit_covariance[(i, i)].sqrt();
        Self { fx: sigma(0), fy: sigma(1), cx: sigma(2), cy: sigma(3) }
    }
}

/// Residuals of one view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewError {
    /// Root mean square of the 2-D distances, pixels.
    pub rms_px: f64,
    /// Norm of all residuals over the number of corners, `‖·‖₂ / N`: a figure that many scripts print as the error of
    /// a view. It is the RMS over √N, so 0.027 with 70 corners means 0.23 px.
    pub norm_per_corner_px: f64,
}

/// A calibrated camera with the evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct IntrinsicsCalibration {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// The target's pose in each view, in the order given.
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    /// The errors of each view, in the order given.
    pub views: Vec<ViewError>,
    /// Root mean square of all 2-D distances, pixels.
    pub rms_px: f64,
    /// Standard deviations.
    pub sigma: PinholeSigma,
}

/// Estimates the intrinsics and the target's pose in each view by least squares on the reprojection error.
///
/// `model` says which distortion to estimate (its numbers do not matter); `guess` is where to start, else a start is
/// found from the views. The board is taken to be flat and its points exact, and all corners count alike.
///
/// # Needs
/// [`MIN_VIEWS`] views with corners, tilted in different directions. Views without corners must be left out before.
///
/// # Errors
/// [`VisionError::TooFewViews`], [`VisionError::ParallelViews`] when the target's tilt is the same in all views,
/// [`VisionError::Undetermined`] when the information in the views leaves a number free, [`VisionError::NotACamera`]
/// when the optimisation diverged, and those of the corners ([`VisionError::TooFewCorners`],
/// [`VisionError::BadCorner`], [`VisionError::CollinearCorners`]) with the index of the view.
pub fn calibrate<V: AsRef<[Corner]>>(
    views: &[V],
    target: &TargetSpec,
    image_size: (u32, u32),
    model: Distortion,
    guess: Option<Intrinsics>,
) -> Result<IntrinsicsCalibration, VisionError> {
    let options = Options { start: guess, ..Options::new(model) };
    let found = calibrate_with(views, &[], target, image_size, &options, &CancelToken::default())?;
    let error = |(rms_px, view): (&f64, &V)| ViewError {
        rms_px: *rms_px,
        norm_per_corner_px: rms_px / (view.as_ref().len() as f64).sqrt(),
    };
    Ok(IntrinsicsCalibration {
        intrinsics: found.intrinsics,
        views: found.rms_px.iter().zip(views).map(error).collect(),
        rms_px: (found.cost / found.corners as f64).sqrt(),
        sigma: PinholeSigma::of(&found),
        camera_from_target: found.camera_from_target,
    })
}

/// [`calibrate`] with all options and the whole evidence.
///
/// `whiteners` has, for every view, one matrix per corner whose residual counts as `W r`; it is empty where all corners
/// count alike. `cancel` is polled at every view.
///
/// # Errors
/// As [`calibrate`], and [`VisionError::Cancelled`].
pub fn calibrate_with<V: AsRef<[Corner]>>(
    views: &[V],
    whiteners: &[Vec<Matrix2<f64>>],
    target: &TargetSpec,
    (width, height): (u32, u32),
    options: &Options,
    cancel: &CancelToken,
) -> Result<Found, VisionError> {
    if views.len() < MIN_VIEWS {
        return Err(VisionError::TooFewViews { got: views.len(), need: MIN_VIEWS });
    }
    if width == 0 || height == 0 {
        return Err(VisionError::BadImage { width, height });
    }
    for (index, view) in views.iter().enumerate() {
        check_corners(view.as_ref(), target, index)?;
    }
    let mut seen = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        let whiteners = whiteners.get(index).map_or(&[][..], Vec::as_slice);
        seen.push(SeenView { corners: view.as_ref(), whiteners });
    }
    let board = BoardPoints::new(&target.points());
    solve(&seen, &board, (width, height), options, cancel).map_err(VisionError::from)
}

impl From<IntrinsicsError> for VisionError {
    fn from(error: IntrinsicsError) -> Self {
        match error {
            IntrinsicsError::TooFewViews { got, need } => Self::TooFewViews { got, need },
            IntrinsicsError::DegenerateView { view, .. } => Self::CollinearCorners { view },
            IntrinsicsError::BadView { view, reason } => Self::NotACamera { reason: format!("view {view}: {reason}") },
            IntrinsicsError::BadStart { source } => Self::Camera { source },
            IntrinsicsError::ParallelViews { views, spread_deg } => Self::ParallelViews { views, spread_deg },
            IntrinsicsError::Undetermined { parameter, sigma_px } => Self::Undetermined { parameter, sigma_px },
            IntrinsicsError::NotACamera { reason } => Self::NotACamera { reason },
            IntrinsicsError::Cancelled => Self::Cancelled,
        }
    }
}
