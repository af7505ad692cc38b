//! Names that a result does not know and the files of other programs want.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::ExportError;

/// Rotation of the optical frame in the body frame of a camera: x forward, y left, z up (ROS REP 103), as x, y, z, w.
pub const REP103_OPTICAL_XYZW: [f64; 4] = [-0.5, 0.5, -0.5, 0.5];
/// Largest deviation of a quaternion's length from 1: the rounding of six printed decimals.
const UNIT_TOLERANCE: f64 = 1e-5;

/// Names of frames, camera and calibration in the files of other programs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ExportNames {
    /// Name of the calibration where a format has one; also the name of its file.
    pub calibration: String,
    /// Name of the camera where a format has one, for example in `camera_info`.
    pub camera_name: String,
    /// The robot's base.
    pub base_frame: String,
    /// The robot's tip.
    pub effector_frame: String,
    /// The camera in optical axes: x right, y down, z forward.
    pub camera_frame: String,
    /// The calibration target.
    pub target_frame: String,
    /// The body frame of a camera whose driver publishes where its optical frame is. Formats that publish a transform
    /// then publish where this frame is; a frame with two parents would break the tree.
    pub camera_link: Option<CameraLink>,
}

/// A camera's body frame, and the optical frame in it as the camera's driver publishes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CameraLink {
    /// Its name.
    pub frame: String,
    /// Origin of the optical frame in it, metres.
    pub translation_m: [f64; 3],
    /// Rotation of the optical frame in it, unit quaternion x, y, z, w.
    pub rotation_xyzw: [f64; 4],
}

impl Default for CameraLink {
    /// `camera_link` where the optical frame is, turned as in ROS REP 103.
    fn default() -> Self {
        Self { frame: "camera_link".into(), translation_m: [0.0; 3], rotation_xyzw: REP103_OPTICAL_XYZW }
    }
}

impl CameraLink {
    /// `link_from_optical`.
    pub(super) fn link_from_optical(&self) -> Isometry3<f64> {
        let [x, y, z, w] = self.rotation_xyzw;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Isometry3::from_parts(Translation3::from(self.translation_m), rotation)
    }

    fn check(&self) -> Result<(), ExportError> {
        let length = self.rotation_xyzw.iter().map(|v| v * v).sum::<f64>().sqrt();
        let is_finite = self.translation_m.iter().all(|v| v.is_finite());
        // Written so that NaN is refused as well.
        if is_finite && (length - 1.0).abs() <= UNIT_TOLERANCE {
            return Ok(());
        }
        Err(ExportError::BadCameraLink { translation_m: self.translation_m, rotation_xyzw: self.rotation_xyzw })
    }
}

impl Default for ExportNames {
    /// The names that ROS drivers and robot descriptions use.
    fn default() -> Self {
        Self {
            calibration: "my_cell".into(),
            camera_name: "camera_color".into(),
            base_frame: "base_link".into(),
            effector_frame: "tool0".into(),
            camera_frame: "camera_color_optical_frame".into(),
            target_frame: "board".into(),
            camera_link: None,
        }
    }
}

impl ExportNames {
    /// Checks that every name is valid in every format: letters, digits and `_ - . /`, beginning with a letter, a
    /// digit, `_` or `/`; no two frames have the same.
    ///
    /// # Errors
    /// [`ExportError::BadName`] names the first that is not, [`ExportError::SameFrame`] the frames that share one,
    /// [`ExportError::BadCameraLink`] an invalid offset.
    pub fn check(&self) -> Result<(), ExportError> {
        let link = self.camera_link.as_ref().map(|link| ("camera link", &link.frame));
        let frames = [
            ("base frame", &self.base_frame),
            ("effector frame", &self.effector_frame),
            ("camera frame", &self.camera_frame),
            ("target frame", &self.target_frame),
        ];
        let frames: Vec<_> = frames.into_iter().chain(link).collect();
        let others = [("calibration", &self.calibration), ("camera", &self.camera_name)];
        for (what, name) in others.into_iter().chain(frames.iter().copied()) {
            let is_plain = name.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c));
            let starts_well = name.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == '/');
            // The calibration's name is also the name of a file.
            let is_path = what == "calibration" && name.contains('/');
            if !is_plain || !starts_well || is_path {
                return Err(ExportError::BadName { what, name: name.chars().take(40).collect() });
            }
        }
        for (i, (first, name)) in frames.iter().enumerate() {
            if let Some((second, _)) = frames[i + 1..].iter().find(|(_, other)| other == name) {
                return Err(ExportError::SameFrame { first, second, name: (*name).clone() });
            }
        }
        self.camera_link.as_ref().map_or(Ok(()), CameraLink::check)
    }
}
