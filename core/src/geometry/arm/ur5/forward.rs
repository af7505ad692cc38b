//! Joint values to poses and velocities.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3};

use super::{END_TURN, JOINTS, JointAngles, ROWS, turn_z};

/// Where every part of the arm is for one configuration, in the arm frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmPose {
    /// Fixed frame of each joint, before the joint's own rotation: origin on its axis, z along it.
    pub arm_from_joint: [Isometry3<f64>; JOINTS],
    /// Frame that each joint carries: its fixed frame turned about z by the joint value.
    pub arm_from_link: [Isometry3<f64>; JOINTS],
    /// The attachment point behind the last joint.
    pub arm_from_connection: Isometry3<f64>,
}

/// Poses of joints, links and connection for the given joint values in radians.
///
/// # Frames and units
/// Everything is in the arm frame, metres. With all joints at zero the connection is at (−0.18495, 0, 0.98655) and
/// its axes are z, y and −x of the arm.
pub fn forward(joints: &JointAngles) -> ArmPose {
    let mut arm_from_joint = [Isometry3::identity(); JOINTS];
    let mut arm_from_link = [Isometry3::identity(); JOINTS];
    let mut arm_from_axis = turn_z(END_TURN);
    for i in 0..JOINTS {
        arm_from_joint[i] = arm_from_axis * turn_z(ROWS[i].theta_offset_rad);
        arm_from_link[i] = arm_from_joint[i] * turn_z(joints[i]);
        arm_from_axis = arm_from_link[i] * ROWS[i].link();
    }
    ArmPose { arm_from_joint, arm_from_link, arm_from_connection: arm_from_axis * turn_z(END_TURN) }
}

/// Geometric Jacobian at the connection: velocity (rows 0 to 2, m/s) and angular velocity (rows 3 to 5, rad/s) of the
/// connection per joint velocity, in the axes of the arm frame.
pub fn jacobian(joints: &JointAngles) -> Matrix6<f64> {
    jacobian_at(joints, &Isometry3::identity())
}

/// [`jacobian`] at the origin of a tool frame that is fixed to the connection.
pub fn jacobian_at(joints: &JointAngles, connection_from_tip: &Isometry3<f64>) -> Matrix6<f64> {
    let pose = forward(joints);
    let tip = pose.arm_from_connection * Point3::from(connection_from_tip.translation.vector);
    let mut columns = Matrix6::zeros();
    for (i, joint) in pose.arm_from_joint.iter().enumerate() {
        let axis = joint.rotation * Vector3::z();
        let arm = tip.coords - joint.translation.vector;
        columns.fixed_view_mut::<3, 1>(0, i).copy_from(&axis.cross(&arm));
        columns.fixed_view_mut::<3, 1>(3, i).copy_from(&axis);
    }
    columns
}
