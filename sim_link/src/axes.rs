//! The one place that knows how the axes of a CoppeliaSim vision sensor lie in a camera.

use handeye_core::geometry::frames::{Camera, Pose, Sensor};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// The camera (x right, y down, z forward) in the axes of a vision sensor (x left, y up, z forward): diag(−1, −1, 1), half
/// a turn about the optical axis, its own inverse.
pub fn sensor_from_camera() -> Pose<Sensor, Camera> {
    let half_turn = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 0.0, 0.0, 1.0));
    Pose::from_isometry(Isometry3::from_parts(Translation3::identity(), half_turn))
}
