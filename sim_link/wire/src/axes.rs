//! The only definition of the axes of a CoppeliaSim vision sensor in a camera, and of those of its board on the sheet.

use handeye_geometry::frames::{Camera, Pose, Sensor};
use handeye_geometry::targets::TargetSpec;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// The camera (x right, y down, z forward) in the axes of a vision sensor (x left, y up, z forward): diag(−1, −1, 1), half
/// a turn about the optical axis, its own inverse.
pub fn sensor_from_camera() -> Pose<Sensor, Camera> {
    let half_turn = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 0.0, 0.0, 1.0));
    Pose::from_isometry(Isometry3::from_parts(Translation3::identity(), half_turn))
}

/// The target on the sheet that it is printed on, as in the public scene: the middles of both coincide. The sheet's z
/// points at the viewer and its y up; the target's z points into the sheet and its y down the rows.
pub fn sheet_from_target(target: &TargetSpec) -> Isometry3<f64> {
    let half_turn_about_x = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    Isometry3::from_parts(Translation3::identity(), half_turn_about_x) * Translation3::from(-target.centre().coords)
}
