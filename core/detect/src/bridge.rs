//! Conversions to and from OpenCV's types.

use image::GrayImage;
use nalgebra::Vector2;
use opencv::boxed_ref::BoxedRef;
use opencv::core::{Mat, Point2f, Vector};

use super::VisionError;

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
