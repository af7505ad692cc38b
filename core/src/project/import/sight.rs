//! What the camera saw of the target, before anything is said of the robot.

use nalgebra::{Isometry3, Point3};

use crate::diagnose::doctor::views::SessionViews;
use crate::estimate::handeye::Mode;
use crate::estimate::handeye::consensus::half_turn_about;
use crate::estimate::{CameraKnowledge, Observations, ObservedView};
use crate::geometry::camera::Intrinsics;
use crate::geometry::frames::Pose;
use crate::geometry::statistics::median;
use crate::targets::TargetSpec;
use crate::targets::observation::Corner;

/// The target's pose in images, or as it was recorded.
#[derive(Debug, Clone)]
pub struct Sight {
    /// `camera_from_target` in every image, metres; `None` where it was not found.
    pub seen: Vec<Option<Isometry3<f64>>>,
    /// Four outer points of the target, where misfits are measured.
    pub(super) outer: [Point3<f64>; 4],
    /// By which a symmetric target looks the same.
    pub(super) half_turn: Option<Isometry3<f64>>,
    /// Median distance of the target from the camera, metres.
    pub distance_m: f64,
    /// The camera that the poses were found with.
    pub intrinsics: Option<Intrinsics>,
}

impl Sight {
    /// From the corners of every image of a stream. The camera is calibrated from them where it is not known.
    ///
    /// # Errors
    /// A sentence, where corners and camera give no poses.
    pub fn of_corners(
        target: TargetSpec,
        image_size: (u32, u32),
        camera: CameraKnowledge,
        corners: &[Option<Vec<Corner>>],
    ) -> Result<Self, String> {
        // The robot is not asked: its poses are what is in doubt.
        let view = |(index, corners): (usize, &Option<Vec<Corner>>)| {
            ObservedView::new(index.to_string(), Some(Pose::identity()), corners.clone())
        };
        let views = corners.iter().enumerate().map(view).collect();
        let observations = Observations { mode: Some(Mode::EyeInHand), target, image_size, camera, views };
        let views = SessionViews::new(&observations, None)?;
        let mut seen = vec![None; corners.len()];
        for view in &views.views {
            if let Some(slot) = seen.get_mut(view.row) {
                *slot = Some(view.camera_from_target);
            }
        }
        let half_turn = target.is_symmetric().then(|| half_turn_about(&target.centre()));
        Ok(Self { seen, outer: views.outer, half_turn, distance_m: views.distance_m, intrinsics: views.intrinsics })
    }

    /// From recorded poses of the target, metres.
    pub fn of_poses(target: Option<&TargetSpec>, seen: Vec<Option<Isometry3<f64>>>) -> Self {
        // Without a target points at arm's length of a hand around its origin say how far poses are apart.
        const REACH_M: f64 = 0.05;
        let outer = match target {
            Some(target) => {
                let far = target.extent();
                [(0.0, 0.0), (far.x, 0.0), (0.0, far.y), (far.x, far.y)].map(|(x, y)| Point3::new(x, y, 0.0))
            }
            None => [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
                .map(|(x, y)| Point3::new(x * REACH_M, y * REACH_M, 0.0)),
        };
        let distances = seen.iter().flatten().map(|pose| pose.translation.vector.norm());
        let distance_m = median(distances).unwrap_or(0.0);
        Self { seen, outer, half_turn: None, distance_m, intrinsics: None }
    }
}
