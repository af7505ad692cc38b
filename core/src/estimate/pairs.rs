//! Calibration from robot and target poses alone.

use super::{
    CalibrateError, CalibratedCamera, Calibration, CameraKnowledge, LinkCovariances, Method, Observations, ViewResult,
    ViewStatus, best_start, check_motion, chosen, closed_forms,
};
use crate::estimate::handeye::closed_form::ClosedFormSolution;
use crate::estimate::handeye::{HandEye, HandEyeError, Mode, PosePair, pose_graph};
use crate::geometry::se3;
use crate::progress::Work;

pub fn calibrate(observations: &Observations, method: Method, work: &Work<'_>) -> Result<Calibration, CalibrateError> {
    let mode = observations.mode.unwrap_or(Mode::EyeInHand);
    let pairs: Vec<PosePair> = observations
        .views
        .iter()
        .filter(|view| view.in_fit)
        .map(|view| match (view.base_from_tip, view.camera_from_target) {
            (Some(base_from_tip), Some(camera_from_target)) => {
                Ok(PosePair { anchor_from_mount: mode.anchor_from_mount(&base_from_tip), camera_from_target })
            }
            _ => Err(CalibrateError::NothingObserved { name: view.name.clone() }),
        })
        .collect::<Result<_, _>>()?;
    check_motion(mode, &pairs)?;
    let methods = closed_forms(&pairs, work)?;
    let mut calibration = Calibration {
        camera: match observations.camera {
            CameraKnowledge::Fixed(intrinsics) => Some(CalibratedCamera { intrinsics, fixed: true, sigma_px: None }),
            CameraKnowledge::Estimate { .. } => None,
        },
        methods,
        views: observations.views.iter().map(|v| ViewResult::new(v, ViewStatus::Used)).collect(),
        ..Calibration::default()
    };
    let (x, y) = match method {
        Method::ClosedForm(name) => {
            let solution = chosen(&calibration.methods, name)?;
            (solution.mount_from_camera, solution.anchor_from_target)
        }
        Method::Joint => {
            let start = best_start(&calibration.methods, |s| misfit(&pairs, s))?;
            let solution = pose_graph::refine(&pairs, &start)?;
            calibration.link_covariances = Some(LinkCovariances {
                hand_eye: solution.covariance.fixed_view::<6, 6>(0, 0).into_owned(),
                target: solution.covariance.fixed_view::<6, 6>(6, 6).into_owned(),
            });
            (solution.mount_from_camera, solution.anchor_from_target)
        }
    };
    if !(x.is_finite() && y.is_finite()) {
        return Err(CalibrateError::HandEye(HandEyeError::NoSolution {
            method: "the pose graph",
            views: pairs.len(),
            reason: "it diverged",
        }));
    }
    let used = calibration.views.iter_mut().filter(|v| v.status == ViewStatus::Used);
    for (view, pair) in used.zip(&pairs) {
        view.camera_from_target = Some(x.inverse() * pair.anchor_from_mount.inverse() * y);
    }
    calibration.hand_eye = Some(HandEye::new(mode, x, y));
    Ok(calibration)
}

/// Sum of squared disagreements, a radian counted as a metre: enough to rank starts.
fn misfit(pairs: &[PosePair], solution: &ClosedFormSolution) -> f64 {
    pairs
        .iter()
        .map(|pair| {
            let predicted =
                solution.mount_from_camera.inverse() * pair.anchor_from_mount.inverse() * solution.anchor_from_target;
            se3::log((pair.camera_from_target.inverse() * predicted).isometry()).norm_squared()
        })
        .sum()
}
