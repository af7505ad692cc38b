//! Arms that are not built in, as URDF: of other shapes than those of Universal Robots, and one of these by another
//! author.

use crate::urdf::{Urdf, UrdfError};
use crate::{Arm, Joint, JointKind};

/// An arm as a URDF file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArmFile {
    /// Name of the arm in the file.
    pub name: &'static str,
    /// The text of the file.
    pub urdf: &'static str,
    /// The link that carries the tool.
    pub tip: &'static str,
}

/// The UR5, with frames and axes as in ROS.
pub const UR5: ArmFile = ArmFile { name: "ur5", urdf: include_str!("arms/ur5.urdf"), tip: "tool0" };
/// Franka Panda: seven revolute joints, the elbow offset from the line of the arm.
pub const PANDA: ArmFile =
    ArmFile { name: "panda", urdf: include_str!("../../../../assets/arms/panda.urdf"), tip: "panda_link8" };
/// UFACTORY xArm 6: six revolute joints, no closed form of ours.
pub const XARM6: ArmFile =
    ArmFile { name: "xarm6", urdf: include_str!("../../../../assets/arms/xarm6.urdf"), tip: "link6" };
/// The same on a linear track: seven joints, the first prismatic.
pub const XARM6_ON_TRACK: ArmFile =
    ArmFile { name: "xarm6_on_track", urdf: include_str!("arms/xarm6_on_track.urdf"), tip: "link6" };
/// A SCARA: four joints, one of them prismatic, one without limits.
pub const SCARA: ArmFile = ArmFile { name: "scara", urdf: include_str!("arms/scara.urdf"), tip: "tool" };
/// Four revolute joints: it turns about the vertical and bends in one plane.
pub const FOUR_JOINTS: ArmFile =
    ArmFile { name: "four_joints", urdf: include_str!("arms/four_joints.urdf"), tip: "hand" };

/// All of them.
pub const ALL: [ArmFile; 6] = [UR5, PANDA, XARM6, XARM6_ON_TRACK, SCARA, FOUR_JOINTS];

impl ArmFile {
    /// The arm.
    ///
    /// # Errors
    /// None, except for a mistake in the file.
    pub fn arm(&self) -> Result<Arm, UrdfError> {
        Urdf::parse(self.urdf, self.name)?.arm(None, Some(self.tip))
    }
}

/// A value for each joint from one in [0, 1) for each, evenly over its range; one revolution, or two metres, for a joint
/// without limits.
pub fn values_at(arm: &Arm, parts: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let value = |(joint, part): (&Joint, f64)| {
        let (min, max) = (joint.range.min, joint.range.max);
        let most = if joint.kind == JointKind::Revolute { std::f64::consts::PI } else { 1.0 };
        let (min, max) = if min.is_finite() && max.is_finite() { (min, max) } else { (-most, most) };
        min + (max - min) * part
    };
    arm.joints().iter().zip(parts).map(value).collect()
}
