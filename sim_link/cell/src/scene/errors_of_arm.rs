//! How an arm's links differ from those that its controller uses.

use handeye_arm::{Arm, ArmError, JointKind};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand_distr::{Distribution as _, StandardNormal};

use super::ArmErrorsSpec;
use super::errors_of_robot::stream_of;

/// The stream of random numbers that the errors of the links have for themselves.
const ARM_STREAM: u64 = 4;

/// Error of one joint, in its frame at rest turned so that the axis is z.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointError {
    /// Direction of the axis: a rotation vector along x and y, radians.
    pub tilt_rad: [f64; 2],
    /// Place of the axis along x and y, metres.
    pub shift_m: [f64; 2],
    /// Added to the encoder's value, radians.
    pub zero_rad: f64,
    /// Added to it under the largest torque that gravity can have on the joint, radians.
    pub compliance_rad: f64,
}

impl JointError {
    /// Where the joint really is, with `offset_rad` added to its angle and `gravity` as the torque's share, -1 to 1, of the
    /// largest torque.
    pub(super) fn displacement(&self, offset_rad: f64, gravity: f64) -> Isometry3<f64> {
        let ([x, y], [about_x, about_y]) = (self.shift_m, self.tilt_rad);
        let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(about_x, about_y, 0.0));
        let angle_rad = self.zero_rad + offset_rad + self.compliance_rad * gravity;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad);
        Isometry3::from_parts(Translation3::new(x, y, 0.0), tilt * turn)
    }
}

/// Draws the errors of an arm.
///
/// The first joint and the zero of the last have no error: it would be indistinguishable from another place of the arm or
/// another tool, and the true pose of the camera on the tip would not be unique. Every number is drawn whatever the levels
/// are, so that one level does not change what another draws.
pub(super) fn drawn(levels: &ArmErrorsSpec, arm: &Arm, seed: u64) -> Vec<JointError> {
    let mut rng = stream_of(seed, ARM_STREAM);
    let mut normal = |sigma: f64| {
        let unit: f64 = StandardNormal.sample(&mut rng);
        unit * sigma
    };
    let (angle_rad, length_m) = (levels.angle_deg.to_radians(), levels.length_mm * 1e-3);
    let last = arm.joint_count() - 1;
    let mut error_of = |(i, kind): (usize, JointKind)| {
        let turns = kind == JointKind::Revolute;
        let drawn = JointError {
            tilt_rad: [normal(angle_rad), normal(angle_rad)],
            shift_m: [normal(length_m), normal(length_m)],
            zero_rad: normal(if turns && i < last { angle_rad } else { 0.0 }),
            // A joint gives way to gravity, never against it.
            compliance_rad: normal(if turns { levels.compliance_deg.to_radians() } else { 0.0 }).abs(),
        };
        if i == 0 { JointError::default() } else { drawn }
    };
    arm.joints().iter().map(|joint| joint.kind).enumerate().map(&mut error_of).collect()
}

/// The torque of gravity about each joint over the largest that it could be, -1 to 1, where every joint and the tip weigh
/// alike. The largest is what it would be if all behind the joint were stretched out level.
///
/// `down` is the direction of gravity in the arm frame.
///
/// # Errors
/// [`ArmError`] for values that are not those of this arm.
pub(super) fn gravity(
    arm: &Arm,
    connection_from_tip: &Isometry3<f64>,
    down: &Vector3<f64>,
    joints: &[f64],
) -> Result<Vec<f64>, ArmError> {
    let frames = arm.frames(joints)?;
    let tip = (frames.base_from_flange * arm.flange_from_tip * connection_from_tip).translation.vector;
    let origins = frames.base_from_joint.iter().map(|frame| frame.translation.vector);
    let weights: Vec<Vector3<f64>> = origins.chain([tip]).collect();
    let share = |(i, base_from_joint): (usize, &Isometry3<f64>)| {
        let axis = base_from_joint.rotation * arm.joints()[i].axis.into_inner();
        let (mut torque, mut along, mut largest) = (0.0, 0.0, 0.0);
        for pair in weights[i..].windows(2) {
            along += (pair[1] - pair[0]).norm();
            largest += along;
            torque += axis.dot(&(pair[1] - weights[i]).cross(down));
        }
        if largest > 0.0 { torque / largest } else { 0.0 }
    };
    Ok(frames.base_from_joint.iter().enumerate().map(share).collect())
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "errors_of_arm_tests.rs"]
mod tests;
