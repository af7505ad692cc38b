//! The camera, and the target's pose in every view that goes with it.

use super::{CalibrateError, CameraFit, CameraKnowledge, Observations};
use crate::estimate::detected_view::DetectedView;
use crate::estimate::handeye::HandEyeError;
use crate::estimate::intrinsics::{self, Bend, IntrinsicsError, Options, Screened};
use crate::geometry::camera::Intrinsics;
use crate::geometry::frames::{Camera, Pose, Target};
use crate::geometry::planar_pose;
use crate::progress::{Stage, Work};
use crate::targets::bent::BoardShape;
use crate::targets::observation::Corner;

/// Camera and target poses.
pub struct Lens {
    pub intrinsics: Intrinsics,
    pub free: bool,
    /// The target as the corners show it; flat where the camera was given.
    pub shape: BoardShape,
    /// What the corners say of an estimated camera; `None` where it was given.
    pub fit: Option<CameraFit>,
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    pub rms_px: Vec<f64>,
    /// Wrong corners of each view, by the index of their point, ascending.
    pub aside: Vec<Vec<usize>>,
}

impl Lens {
    /// The camera as it is known, or as all views together show it.
    pub fn find(
        observations: &Observations,
        seen: &[DetectedView<'_>],
        keep_outliers: bool,
        work: &Work<'_>,
    ) -> Result<Self, CalibrateError> {
        match observations.camera {
            CameraKnowledge::Fixed(intrinsics) => Self::given(intrinsics, observations, seen, work),
            CameraKnowledge::Estimate { model, start } => {
                work.report(Stage::Intrinsics, 0, 1);
                let views: Vec<&[Corner]> = seen.iter().map(|s| s.corners).collect();
                let options = Options { start, bend: Bend::IfShown, ..Options::new(model) };
                let (target, size) = (&observations.target, observations.image_size);
                let screened = intrinsics::solve_screened(&views, target, size, &options, keep_outliers, work.cancel);
                let Screened { found, aside } = screened.map_err(|e| match e {
                    IntrinsicsError::Cancelled => CalibrateError::from(HandEyeError::Cancelled),
                    other => other.into(),
                })?;
                // The poses come with the camera.
                work.report(Stage::TargetPoses, 0, seen.len());
                if work.is_cancelled() {
                    return Err(HandEyeError::Cancelled.into());
                }
                Ok(Self {
                    intrinsics: found.intrinsics,
                    free: true,
                    shape: found.shape,
                    fit: Some(CameraFit::of(&found)),
                    camera_from_target: found.camera_from_target,
                    rms_px: found.rms_px,
                    aside,
                })
            }
        }
    }

    fn given(
        intrinsics: Intrinsics,
        observations: &Observations,
        seen: &[DetectedView<'_>],
        work: &Work<'_>,
    ) -> Result<Self, CalibrateError> {
        let mut camera_from_target = Vec::with_capacity(seen.len());
        let mut rms_px = Vec::with_capacity(seen.len());
        for (done, s) in seen.iter().enumerate() {
            if work.is_cancelled() {
                return Err(HandEyeError::Cancelled.into());
            }
            work.report(Stage::TargetPoses, done, seen.len());
            let pose = planar_pose::solve(s.corners, &observations.target, &intrinsics)?.best;
            camera_from_target.push(pose.camera_from_target);
            rms_px.push(pose.rms_px);
        }
        let aside = vec![Vec::new(); seen.len()];
        Ok(Self { intrinsics, free: false, shape: BoardShape::FLAT, fit: None, camera_from_target, rms_px, aside })
    }

    /// Whether the corners show a bent target.
    pub fn is_bent(&self) -> bool {
        self.fit.as_ref().is_some_and(|fit| fit.shape.is_some())
    }

    /// The corners of a view that the camera was found from.
    pub fn corners_left(&self, view: usize, corners: &[Corner]) -> Vec<Corner> {
        corners.iter().filter(|corner| self.aside[view].binary_search(&corner.index).is_err()).copied().collect()
    }
}
