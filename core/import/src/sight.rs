//! Views of the target by the camera, independent of the robot.

use nalgebra::{Isometry3, Matrix6, Point3};

use super::formats::corners;
use super::recording::Stream;
use handeye_estimate::diagnose::doctor::views::SessionViews;
use handeye_estimate::diagnose::hypotheses::SeenTarget;
use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::numbering::Turns;
use handeye_estimate::{CameraKnowledge, Observations, ObservedView};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::Pose;
use handeye_geometry::statistics::median;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corners;
use handeye_wording::Text;
use handeye_wording::text;

/// The target's pose in images, or as it was recorded.
#[derive(Debug, Clone)]
pub struct Sight {
    /// `camera_from_target` in every image, metres; `None` where it was not found.
    pub seen: Vec<Option<Isometry3<f64>>>,
    /// Covariance of each by the noise of the corners, right perturbation; empty for poses that were recorded.
    pub(super) covariances: Vec<Option<Matrix6<f64>>>,
    /// The target as the camera sees it.
    pub target: SeenTarget,
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
        corners: &[Option<Corners>],
    ) -> Result<Self, Text> {
        // The robot is not asked: its poses are what is in doubt.
        let view = |(index, corners): (usize, &Option<Corners>)| {
            ObservedView::new(index.to_string(), Some(Pose::identity()), corners.clone())
        };
        let views = corners.iter().enumerate().map(view).collect();
        let observations = Observations { mode: Some(Mode::EyeInHand), target, image_size, camera, views };
        let views = SessionViews::new(&observations, None)?;
        let mut seen = vec![None; corners.len()];
        let mut covariances = vec![None; corners.len()];
        for view in &views.views {
            if let (Some(slot), Some(covariance)) = (seen.get_mut(view.row), covariances.get_mut(view.row)) {
                (*slot, *covariance) = (Some(view.camera_from_target), Some(view.covariance));
            }
        }
        let target = SeenTarget { turns: Turns::of(&target), ..views.target };
        Ok(Self { seen, covariances, target, intrinsics: views.intrinsics })
    }

    /// From points that another program has found; the size of the images is stated by the files or by a person.
    ///
    /// # Errors
    /// A sentence, where the size is not known, the points are not those of the target, or give no poses.
    pub fn of_points(
        target: TargetSpec,
        stream: &Stream,
        image_size: Option<(u32, u32)>,
        camera: CameraKnowledge,
    ) -> Result<Self, Text> {
        let corners = recorded_corners(stream, &target)?;
        let size = size_of_points(stream, image_size)?;
        Self::of_corners(target, size, camera, &corners)
    }

    /// The views of some of the images, by their indices.
    pub(super) fn of_images(&self, kept: &[usize]) -> Self {
        let seen = kept.iter().map(|image| self.seen[*image]).collect();
        let covariances = kept.iter().filter_map(|image| self.covariances.get(*image).copied()).collect();
        Self { seen, covariances, ..self.clone() }
    }

    /// From recorded poses of the target, metres.
    pub(crate) fn of_poses(target: Option<&TargetSpec>, seen: Vec<Option<Isometry3<f64>>>) -> Self {
        // Without a target, points within this distance of its origin measure how far poses are apart.
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
        let target = SeenTarget { outer, turns: Turns::default(), distance_m };
        Self { seen, covariances: Vec::new(), target, intrinsics: None }
    }
}

/// The corners of a stream that has points in the place of images, numbered as those of the target.
///
/// # Errors
/// A sentence, where they are not those of this target.
pub(super) fn recorded_corners(stream: &Stream, target: &TargetSpec) -> Result<Vec<Option<Corners>>, Text> {
    let views = stream.points.as_deref().unwrap_or_default();
    let numbered =
        views.iter().map(|points| points.as_ref().map(|points| corners::numbered(points, target)).transpose());
    numbered.map(|view| Ok(view?.map(Corners::from))).collect()
}

/// The size of the images that points are from, as the user or the files state it.
///
/// # Errors
/// A sentence, where neither does, or points are outside of the image.
pub fn size_of_points(stream: &Stream, reported: Option<(u32, u32)>) -> Result<(u32, u32), Text> {
    let size = reported.or((stream.size != (0, 0)).then_some(stream.size));
    let (width, height) = size.ok_or_else(|| {
        text!("no file says how large the images were: --set image_size=WIDTHxHEIGHT does, in pixels")
    })?;
    let is_inside = stream.points.iter().flatten().flatten().all(|points| corners::are_inside(points, (width, height)));
    if is_inside {
        Ok((width, height))
    } else {
        Err(text!(
            "there are corners beside an image of {width}×{height} px: if width and height are exchanged or of another image, say \
             --set image_size=WIDTHxHEIGHT",
            width = width,
            height = height
        ))
    }
}
