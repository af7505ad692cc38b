//! The camera, and the target's pose in every view that goes with it.

use super::{CalibrateError, CameraKnowledge, Observations};
use crate::estimate::detected_view::DetectedView;
use crate::estimate::handeye::HandEyeError;
use crate::estimate::intrinsics::{self, IntrinsicsError, Options, SeenView};
use crate::geometry::camera::Intrinsics;
use crate::geometry::frames::{Camera, Pose, Target};
use crate::geometry::planar_pose;
use crate::progress::{Stage, Work};

/// Camera and target poses.
pub struct Lens {
    pub intrinsics: Intrinsics,
    pub free: bool,
    pub sigma: Option<[f64; 4]>,
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    pub rms_px: Vec<f64>,
}

impl Lens {
    /// The camera as it is known, or as all views together show it.
    pub fn find(
        observations: &Observations,
        seen: &[DetectedView<'_>],
        work: &Work<'_>,
    ) -> Result<Self, CalibrateError> {
        match observations.camera {
            CameraKnowledge::Fixed(intrinsics) => Self::given(intrinsics, observations, seen, work),
            CameraKnowledge::Estimate { model, start } => {
                work.report(Stage::Intrinsics, 0, 1);
                let views: Vec<SeenView<'_>> = seen.iter().map(|s| SeenView::unweighted(s.corners)).collect();
                let options = Options { start, ..Options::new(model) };
                let (target, size) = (&observations.target, observations.image_size);
                let found = intrinsics::solve(&views, target, size, &options, work.cancel).map_err(|e| match e {
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
                    sigma: Some(found.pinhole_sigma_px()),
                    camera_from_target: found.camera_from_target,
                    rms_px: found.rms_px,
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
        Ok(Self { intrinsics, free: false, sigma: None, camera_from_target, rms_px })
    }
}
