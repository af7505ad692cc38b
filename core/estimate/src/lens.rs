//! The camera, and the target's pose in every view that belongs to it.

use nalgebra::Vector2;

use super::{CalibrateError, CameraFit, CameraKnowledge, KnownLens, Observations};
use crate::detected_view::DetectedView;
use crate::handeye::HandEyeError;
use crate::intrinsics::{self, Bend, Found, IntrinsicsError, Options, Screened};
use crate::wrong_corners::without;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::observations::LENS_ACCURACY_PX;
use handeye_geometry::planar_pose::{self, PlanarPose, Solution};
use handeye_geometry::progress::{Stage, Work};
use handeye_geometry::statistics::median;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::Corners;
use handeye_geometry::view_equations::{ViewInput, Whitener};

/// Camera and target poses.
pub struct Lens {
    pub intrinsics: Intrinsics,
    pub free: bool,
    /// The shape of the target by the corners; flat where the camera was given.
    pub shape: BoardShape,
    /// What is known of it in addition to the views, where it is free.
    pub known: Option<KnownLens>,
    /// The fit of an estimated camera to the corners; `None` where it was given.
    pub fit: Option<CameraFit>,
    /// The pose of each view that fits its corners best.
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    /// The other pose that the corners leave possible.
    pub alternatives: Vec<Option<Pose<Camera, Target>>>,
    pub rms_px: Vec<f64>,
    /// Wrong corners of each view, by the index of their point, ascending.
    pub rejected: Vec<Vec<usize>>,
}

impl Lens {
    /// The camera as given, or as estimated from all views together.
    pub fn find(
        observations: &Observations,
        seen: &[DetectedView<'_>],
        keep_outliers: bool,
        work: &Work<'_>,
    ) -> Result<Self, CalibrateError> {
        match observations.camera {
            CameraKnowledge::Fixed(intrinsics) => Self::given(intrinsics, observations, seen, work),
            CameraKnowledge::Near(known) => {
                let given = Self::given(known.intrinsics, observations, seen, work)?;
                if !LENS_ACCURACY_PX.contains(&known.accuracy_px) {
                    return Err(CalibrateError::LensAccuracy { accuracy_px: known.accuracy_px });
                }
                // Only the robot's motion gives more information on it.
                let free = observations.mode.is_some();
                Ok(Self { free, known: Some(known).filter(|_| free), ..given })
            }
            CameraKnowledge::Estimate { model, start } => {
                work.report(Stage::Intrinsics, 0, 1);
                let views: Vec<&Corners> = seen.iter().map(|s| s.corners).collect();
                let options = Options { start, bend: Bend::IfShown, ..Options::new(model) };
                let (target, size) = (&observations.target, observations.image_size);
                let screened = intrinsics::solve_screened(&views, target, size, &options, keep_outliers, work.cancel);
                let Screened { found, rejected } = screened.map_err(|e| match e {
                    IntrinsicsError::Cancelled => CalibrateError::from(HandEyeError::Cancelled),
                    other => other.into(),
                })?;
                // The poses come with the camera.
                work.report(Stage::TargetPoses, 0, seen.len());
                if work.is_cancelled() {
                    return Err(HandEyeError::Cancelled.into());
                }
                let alternatives = alternatives(observations, seen, &found, &rejected);
                Ok(Self {
                    intrinsics: found.intrinsics,
                    free: true,
                    known: None,
                    shape: found.shape,
                    fit: Some(CameraFit::of(&found)),
                    camera_from_target: found.camera_from_target,
                    alternatives,
                    rms_px: found.rms_px,
                    rejected,
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
        intrinsics.validate().map_err(IntrinsicsError::from)?;
        check_fold(&intrinsics, seen)?;
        let mut poses = Vec::with_capacity(seen.len());
        for (done, s) in seen.iter().enumerate() {
            if work.is_cancelled() {
                return Err(HandEyeError::Cancelled.into());
            }
            work.report(Stage::TargetPoses, done, seen.len());
            poses.push(planar_pose::solve(s.corners, &observations.target, &intrinsics)?);
        }
        let corners: Vec<usize> = seen.iter().map(|s| s.corners.len()).collect();
        Ok(Self {
            intrinsics,
            free: false,
            known: None,
            shape: BoardShape::FLAT,
            fit: None,
            camera_from_target: poses.iter().map(|pose| pose.best.camera_from_target).collect(),
            alternatives: possible(&poses, &corners),
            rms_px: poses.iter().map(|pose| pose.best.rms_px).collect(),
            rejected: vec![Vec::new(); seen.len()],
        })
    }

    /// Whether the corners show a bent target.
    pub fn is_bent(&self) -> bool {
        self.fit.as_ref().is_some_and(|fit| fit.shape.is_some())
    }

    /// The corners of a view that the camera was found from.
    pub fn corners_left(&self, view: usize, corners: &Corners) -> Corners {
        without(corners, &self.rejected[view])
    }
}

/// Fails where a fold of the lens is within the corners: a corner beyond it has no ray, or that of another corner. A
/// fold farther out does no harm here; a finding names it.
fn check_fold(intrinsics: &Intrinsics, seen: &[DetectedView<'_>]) -> Result<(), IntrinsicsError> {
    let Err(fold) = intrinsics.check_fold() else { return Ok(()) };
    let centre = Vector2::new(intrinsics.cx, intrinsics.cy);
    let corners = seen.iter().flat_map(|s| s.corners);
    let seen_px = corners.map(|corner| (corner.px - centre).norm()).fold(0.0, f64::max);
    if fold.radius_px > seen_px {
        return Ok(());
    }
    Err(IntrinsicsError::FoldsBack { fold: Box::new(fold), seen_px })
}

/// The alternatives that are possible by the noise of a typical view, which the corners of a single one know badly.
fn possible(poses: &[PlanarPose], corners: &[usize]) -> Vec<Option<Pose<Camera, Target>>> {
    let own = poses.iter().zip(corners).map(|(pose, corners)| pose.sigma_px(*corners));
    let sigma_px = median(own).unwrap_or(0.0);
    let views = poses.iter().zip(corners);
    views.map(|(pose, n)| pose.possible_alternative(*n, sigma_px).map(|a| a.camera_from_target)).collect()
}

/// The other pose of every view with the camera and the target as they were found.
fn alternatives(
    observations: &Observations,
    seen: &[DetectedView<'_>],
    found: &Found,
    rejected: &[Vec<usize>],
) -> Vec<Option<Pose<Camera, Target>>> {
    let board = BoardPoints::new(&observations.target.points());
    let kept: Vec<Corners> = seen.iter().zip(rejected).map(|(s, rejected)| without(s.corners, rejected)).collect();
    let poses: Vec<PlanarPose> = (kept.iter().zip(&found.camera_from_target).zip(&found.rms_px).zip(&found.mirrored))
        .map(|(((corners, pose), rms_px), mirrored)| {
            let (intrinsics, shape) = (&found.intrinsics, &found.shape);
            let view =
                ViewInput { intrinsics, board: &board, shape, corners, whitener: &Whitener::Alike, depths: None };
            let best = Solution { camera_from_target: *pose, rms_px: *rms_px };
            PlanarPose { best, alternative: mirrored.and_then(|near| planar_pose::other(&view, &best, &near)) }
        })
        .collect();
    possible(&poses, &kept.iter().map(|corners| corners.len()).collect::<Vec<_>>())
}
