//! Input of an export, with the names in it.

use nalgebra::Isometry3;

use super::{ExportError, ExportNames, rotation};
use handeye_estimate::handeye::Mode;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Mount, Pose, Tip};
use handeye_result::{CalibrationResult, IntrinsicsEstimate};

/// A result, and what else a format may need of its session.
#[derive(Debug, Clone, Copy)]
pub struct ExportInput<'a> {
    /// The result that is exported.
    pub result: &'a CalibrationResult,
    /// Names that it does not know.
    pub names: &'a ExportNames,
    /// Images with their robot poses, for formats about the camera's pose in every image; empty when there are none.
    pub views: &'a [ExportView],
}

/// An image and where the robot was.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportView {
    /// The image, as a path relative to the folder of images.
    pub name: String,
    /// Tip pose as the controller reported it.
    pub base_from_tip: Pose<Base, Tip>,
}

impl<'a> ExportInput<'a> {
    /// A calibration without its views.
    pub fn new(result: &'a CalibrationResult, names: &'a ExportNames) -> Self {
        Self { result, names, views: &[] }
    }

    /// The hand-eye from the parent frame to the optical frame.
    pub(super) fn optical(&self, format: &'static str) -> Result<NamedTransform<'a>, ExportError> {
        let (Some(mode), Some(estimate)) = (self.result.mode, &self.result.hand_eye) else {
            return Err(ExportError::NeedsHandEye { format });
        };
        let mount_from_camera =
            Pose::<Mount, Camera>::from_translation_xyzw(estimate.translation_m, estimate.rotation_xyzw);
        let parent = match mode {
            Mode::EyeInHand => &self.names.effector_frame,
            Mode::EyeToHand => &self.names.base_frame,
        };
        Ok(NamedTransform { mode, parent, child: &self.names.camera_frame, isometry: *mount_from_camera.isometry() })
    }

    /// The hand-eye as it is published: to the optical frame, or to the body of a camera whose driver publishes that.
    pub(super) fn published(&self, format: &'static str) -> Result<NamedTransform<'a>, ExportError> {
        let optical = self.optical(format)?;
        let Some(link) = &self.names.camera_link else { return Ok(optical) };
        let isometry = optical.isometry * link.link_from_optical().inverse();
        Ok(NamedTransform { child: &link.frame, isometry, ..optical })
    }

    /// The camera.
    pub(super) fn intrinsics(&self, format: &'static str) -> Result<Intrinsics, ExportError> {
        let estimate = self.result.intrinsics.as_ref();
        estimate.and_then(IntrinsicsEstimate::intrinsics).ok_or(ExportError::NeedsIntrinsics { format })
    }

    /// The optical frame of every view in the base.
    pub(super) fn camera_poses(&self, format: &'static str) -> Result<Vec<CameraPose<'a>>, ExportError> {
        let transform = self.optical(format)?;
        if transform.mode == Mode::EyeToHand {
            return Err(ExportError::NeedsMovingCamera { format });
        }
        let tip_from_camera = Pose::<Tip, Camera>::from_isometry(transform.isometry);
        if self.views.is_empty() {
            return Err(ExportError::NeedsViews { format });
        }
        let pose = |view: &'a ExportView| {
            if !view.base_from_tip.is_finite() {
                let problem = "its robot pose is not finite; take it out or correct the pose table";
                return Err(bad_view(format, view, problem));
            }
            Ok(CameraPose { name: &view.name, base_from_camera: view.base_from_tip * tip_from_camera })
        };
        self.views.iter().map(pose).collect()
    }
}

pub(super) fn bad_view(format: &'static str, view: &ExportView, problem: &'static str) -> ExportError {
    ExportError::BadView { format, name: view.name.chars().take(80).collect(), problem }
}

/// An image and where the camera was.
pub(super) struct CameraPose<'a> {
    pub name: &'a str,
    pub base_from_camera: Pose<Base, Camera>,
}

/// `parent_from_child` in the names of the export.
#[derive(Debug, Clone, Copy)]
pub(super) struct NamedTransform<'a> {
    pub mode: Mode,
    pub parent: &'a str,
    pub child: &'a str,
    pub isometry: Isometry3<f64>,
}

impl NamedTransform<'_> {
    /// Origin of the child in the parent, metres.
    pub fn translation(&self) -> [f64; 3] {
        plain_zeros(self.isometry.translation.vector.into())
    }

    /// Unit quaternion x, y, z, w with w ≥ 0, whatever the result holds.
    pub fn xyzw(&self) -> [f64; 4] {
        plain_zeros(Pose::<Mount, Camera>::from_isometry(self.isometry).xyzw())
    }

    /// Rows of the homogeneous matrix.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        rotation::rows(&self.isometry)
    }

    /// URDF roll, pitch, yaw in radians.
    pub fn rpy(&self) -> [f64; 3] {
        rotation::rpy(&self.isometry.rotation)
    }
}

/// Turns −0, which sign flips leave behind, into 0.
fn plain_zeros<const N: usize>(values: [f64; N]) -> [f64; N] {
    values.map(|v| v + 0.0)
}
