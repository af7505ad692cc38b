//! Conversions to and from OpenCV's types, for tests that compare our mathematics with OpenCV's.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use opencv::core::{Mat, Point2d, Point3d, Point3f, Scalar, Vec3d, Vector};
use opencv::prelude::*;

use super::VisionError;
use super::bridge::failed;
use handeye_geometry::camera::Intrinsics;

pub(super) fn to_points2d(points: &[Vector2<f64>]) -> Vector<Point2d> {
    points.iter().map(|p| Point2d::new(p.x, p.y)).collect()
}

pub(super) fn to_points3d(points: &[Point3<f64>]) -> Vector<Point3d> {
    points.iter().map(|p| Point3d::new(p.x, p.y, p.z)).collect()
}

pub(super) fn to_points3f(points: &[Point3<f64>]) -> Vector<Point3f> {
    points.iter().map(|p| Point3f::new(p.x as f32, p.y as f32, p.z as f32)).collect()
}

/// The 3×3 matrix K.
pub(super) fn camera_matrix(camera: &Intrinsics) -> Result<Mat, VisionError> {
    let m = camera.matrix();
    let mut out = Mat::new_rows_cols_with_default(3, 3, opencv::core::CV_64F, Scalar::all(0.0))
        .map_err(failed("make a camera matrix"))?;
    for row in 0..3 {
        for column in 0..3 {
            let slot = out.at_2d_mut::<f64>(row, column).map_err(failed("fill a camera matrix"))?;
            *slot = m[(row as usize, column as usize)];
        }
    }
    Ok(out)
}

/// The distortion coefficients as a vector, in OpenCV's order; empty for none.
pub(super) fn coefficients(camera: &Intrinsics) -> Vector<f64> {
    camera.distortion.coefficients().iter().copied().collect()
}

/// All numbers of a double matrix in row-major order.
pub(super) fn numbers(mat: &Mat) -> Result<Vec<f64>, VisionError> {
    let mut out = Mat::default();
    mat.convert_to(&mut out, opencv::core::CV_64F, 1.0, 0.0).map_err(failed("convert a matrix"))?;
    Ok(out.data_typed::<f64>().map_err(failed("read a matrix"))?.to_vec())
}

/// `camera_from_target` from OpenCV's rotation vector and translation.
pub(super) fn isometry(rotation_vector: &[f64; 3], translation: &[f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(*translation),
        UnitQuaternion::from_scaled_axis(Vector3::from(*rotation_vector)),
    )
}

/// Pairs of rotation vector and translation as OpenCV returns them for several views.
pub(super) fn isometries(rotations: &Vector<Vec3d>, translations: &Vector<Vec3d>) -> Vec<Isometry3<f64>> {
    rotations.iter().zip(translations.iter()).map(|(r, t)| isometry(&r.0, &t.0)).collect()
}
