//! Rotations as other programs write them.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Below this cosine of pitch, roll and yaw turn about one axis and yaw is taken as 0. What that leaves out of the
/// rotation is no larger than this.
const GIMBAL_LOCK: f64 = 1e-12;

/// Roll, pitch, yaw in radians with R = Rz(yaw) · Ry(pitch) · Rx(roll): URDF, turns about fixed axes x, y, z.
///
/// Pitch is in [−π/2, π/2]. The angles reproduce the rotation to rounding everywhere: at and near gimbal lock yaw is
/// arbitrary, and roll is the remainder after yaw is removed, so that errors of the two do not add up.
pub(super) fn rpy(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let r = rotation.to_rotation_matrix().into_inner();
    let is_locked = r[(0, 0)].hypot(r[(1, 0)]) < GIMBAL_LOCK;
    let yaw = if is_locked { 0.0 } else { r[(1, 0)].atan2(r[(0, 0)]) };
    // Rz(−yaw) R = Ry(pitch) Rx(roll).
    let (s, c) = yaw.sin_cos();
    let pitch = (-r[(2, 0)]).atan2((c * r[(0, 0)] + s * r[(1, 0)]).max(0.0));
    let roll = (s * r[(0, 2)] - c * r[(1, 2)]).atan2(c * r[(1, 1)] - s * r[(0, 1)]);
    // Adding zero turns −0 into 0.
    [roll + 0.0, pitch + 0.0, yaw + 0.0]
}

/// The rotation of [`rpy`], multiplied out from its three turns.
pub(super) fn from_rpy([roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
    let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    about(Vector3::z_axis(), yaw) * about(Vector3::y_axis(), pitch) * about(Vector3::x_axis(), roll)
}

/// Rows of the homogeneous matrix.
pub(super) fn rows(isometry: &Isometry3<f64>) -> [[f64; 4]; 4] {
    let m = isometry.to_homogeneous();
    std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)] + 0.0))
}
