//! The state of the robot as a driver reports it.

use handeye_arm::JointValues;
use handeye_geometry::frames::{Frame, Pose};
use serde::{Deserialize, Serialize};

use super::error::BadMessage;

/// Largest deviation of a quaternion's norm from 1: single precision and six printed digits, with a margin.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Translations longer than this are not metres \[m\].
const LONGEST_TRANSLATION_M: f64 = 100.0;

/// A rigid transform `dst_from_src`; the field that holds it names the frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseMessage {
    /// Origin of `src` in `dst`, metres.
    pub translation_m: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation_xyzw: [f64; 4],
}

impl PoseMessage {
    /// For the wire.
    pub(crate) fn of<Dst: Frame, Src: Frame>(pose: &Pose<Dst, Src>) -> Self {
        Self { translation_m: pose.translation().into(), rotation_xyzw: pose.xyzw() }
    }

    /// The pose between the frames that the field names.
    ///
    /// # Errors
    /// [`BadMessage::Pose`] for a quaternion that is not a rotation, or a translation of more than 100 m.
    pub(crate) fn pose<Dst: Frame, Src: Frame>(&self, field: &'static str) -> Result<Pose<Dst, Src>, BadMessage> {
        let norm = self.rotation_xyzw.iter().map(|v| v * v).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > UNIT_TOLERANCE || !norm.is_finite() {
            return Err(BadMessage::Pose {
                field,
                why: format!("rotation_xyzw has the norm {norm:.4}, a unit quaternion x, y, z, w is needed"),
            });
        }
        let length_m = self.translation_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length_m > LONGEST_TRANSLATION_M || !length_m.is_finite() {
            return Err(BadMessage::Pose {
                field,
                why: format!("translation_m is {length_m:.0} m long, metres are needed and not millimetres"),
            });
        }
        Ok(Pose::from_translation_xyzw(self.translation_m, self.rotation_xyzw))
    }
}

/// The robot at one instant, as the driver reports it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StateMessage {
    /// On the driver's clock, seconds.
    pub stamp: f64,
    /// A value for each joint, rad or m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints_rad: Option<JointValues>,
    /// Pose of the flange.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_from_flange: Option<PoseMessage>,
    /// The tool that is set on the controller.
    #[serde(default, alias = "flange_from_tip", skip_serializing_if = "Option::is_none")]
    pub flange_from_tcp: Option<PoseMessage>,
    /// Pose of the TCP.
    #[serde(default, alias = "base_from_tcp", skip_serializing_if = "Option::is_none")]
    pub base_from_tip: Option<PoseMessage>,
    /// Whether the controller moves the arm at this instant, where it reports that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<bool>,
}
