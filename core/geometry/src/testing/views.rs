//! Views of a target from all sides.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector2, Vector3};

use crate::camera::Intrinsics;
use crate::targets::Grid;

/// `camera_from_target` with the camera `distance_m` from the board's middle, looked at from `tilt` off its normal
/// in the direction `azimuth`, then turned by `roll` around the optical axis; the board's middle is imaged
/// `offset_px` from the principal point.
pub fn looking_at(
    grid: &Grid,
    camera: &Intrinsics,
    distance_m: f64,
    angles_rad: [f64; 3],
    offset_px: Vector2<f64>,
) -> Isometry3<f64> {
    let centre = Point3::new(
        (grid.columns as f64 - 1.0) / 2.0 * grid.square_m,
        (grid.rows as f64 - 1.0) / 2.0 * grid.square_m,
        0.0,
    );
    looking_at_point(&centre, camera, distance_m, angles_rad, offset_px)
}

/// [`looking_at`] with any point of the target in place of the board's middle.
pub fn looking_at_point(
    centre: &Point3<f64>,
    camera: &Intrinsics,
    distance_m: f64,
    [tilt, azimuth, roll]: [f64; 3],
    offset_px: Vector2<f64>,
) -> Isometry3<f64> {
    let axis = Unit::new_normalize(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0));
    let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), roll) * Rotation3::from_axis_angle(&axis, tilt);
    let at = Vector3::new(offset_px.x / camera.fx, offset_px.y / camera.fy, 1.0) * distance_m;
    Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&rotation))
        * Translation3::from(-centre.coords)
}
