//! Conversions to and from OpenCV's types.

use image::GrayImage;
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use opencv::boxed_ref::BoxedRef;
use opencv::core::{Mat, Point2d, Point2f, Point3d, Scalar, Vector};
#[cfg(test)]
use opencv::core::{Point3f, Vec3d};
use opencv::prelude::*;

use super::VisionError;
#[cfg(test)]
use crate::camera::Intrinsics;

/// Says which operation failed; OpenCV's text is kept without its file and line.
pub(super) fn failed(operation: &'static str) -> impl Fn(opencv::Error) -> VisionError {
    move |error| VisionError::OpenCv { operation, message: in_words(&error.message) }
}

/// The message in `OpenCV(4.6.0) file:line: error: (-215:Assertion failed) message in function 'f'`.
fn in_words(message: &str) -> String {
    let text = message.split_once("error: ").map_or(message, |(_, rest)| rest);
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The image as a matrix that shares its pixels.
pub(super) fn mat_from_gray(image: &GrayImage) -> Result<BoxedRef<'_, Mat>, VisionError> {
    let (width, height) = image.dimensions();
    let bad = VisionError::BadImage { width, height };
    let (Ok(columns), Ok(rows)) = (i32::try_from(width), i32::try_from(height)) else { return Err(bad) };
    if columns == 0 || rows == 0 {
        return Err(bad);
    }
    let pixels = image.as_raw().get(..width as usize * height as usize).ok_or(bad)?;
    Mat::new_rows_cols_with_data(rows, columns, pixels).map_err(failed("read the image"))
}

pub(super) fn to_points2f(points: &[Vector2<f64>]) -> Vector<Point2f> {
    points.iter().map(|p| Point2f::new(p.x as f32, p.y as f32)).collect()
}

pub(super) fn from_points2f(points: &Vector<Point2f>) -> Vec<Vector2<f64>> {
    points.iter().map(|p| Vector2::new(f64::from(p.x), f64::from(p.y))).collect()
}

pub(super) fn to_points2d(points: &[Vector2<f64>]) -> Vector<Point2d> {
    points.iter().map(|p| Point2d::new(p.x, p.y)).collect()
}

pub(super) fn to_points3d(points: &[Point3<f64>]) -> Vector<Point3d> {
    points.iter().map(|p| Point3d::new(p.x, p.y, p.z)).collect()
}

#[cfg(test)]
pub(super) fn to_points3f(points: &[Point3<f64>]) -> Vector<Point3f> {
    points.iter().map(|p| Point3f::new(p.x as f32, p.y as f32, p.z as f32)).collect()
}

/// The 3×3 matrix K.
#[cfg(test)]
pub(super) fn camera_matrix(camera: &Intrinsics) -> Result<Mat, VisionError> {
    mat_from_matrix3(&camera.matrix())
}

pub(super) fn mat_from_matrix3(m: &Matrix3<f64>) -> Result<Mat, VisionError> {
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
#[cfg(test)]
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
#[cfg(test)]
pub(super) fn isometries(rotations: &Vector<Vec3d>, translations: &Vector<Vec3d>) -> Vec<Isometry3<f64>> {
    rotations.iter().zip(translations.iter()).map(|(r, t)| isometry(&r.0, &t.0)).collect()
}
