//! The live camera: where it is, its images, and their depths as points in the base.

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::{DepthImage, DepthSample};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _, RgbImage};
use nalgebra::Vector2;
use rerun::{Color, EncodedDepthImage, EncodedImage, MediaType, Points3D, Radius};

use super::convert::{marks, point};
use super::error::RecordError;
use super::paths::{self, below};
use super::pen::Pen;
use super::style;
use handeye_workbench::jpeg::{self, ColorType};
use handeye_workbench::scene::Known;

/// No visible loss, at a tenth of the bytes.
const JPEG_QUALITY: u8 = 80;
/// One pixel in this many along rows and columns becomes a point in the base.
const POINT_STEP: usize = 8;
/// Depths are kept in steps of a tenth of a millimetre while they fit into 16 bits, and of a millimetre beyond.
const FINE_STEPS_PER_METRE: f32 = 10_000.0;
const COARSE_STEPS_PER_METRE: f32 = 1_000.0;

/// The lens of the live camera.
pub(super) fn lens(known: &Known) -> String {
    below(paths::camera(known.mode()), paths::LENS)
}

/// A colour image, compressed.
pub(super) fn write_image(pen: Pen<'_>, known: &Known, rgb: &RgbImage) -> Result<(), RecordError> {
    let path = below(&lens(known), paths::IMAGE);
    let size = (rgb.width() as usize, rgb.height() as usize);
    let bytes = jpeg::encoded(rgb.as_raw(), ColorType::Rgb, size, JPEG_QUALITY)
        .map_err(|error| not_compressed(&path, rgb.dimensions(), &error))?;
    pen.write(&path, &EncodedImage::from_file_contents(bytes).with_media_type(MediaType::jpeg()))
}

fn not_compressed(path: &str, (width, height): (u32, u32), error: &dyn std::error::Error) -> RecordError {
    RecordError::Image { path: path.to_owned(), width, height, reason: error.to_string() }
}

/// Depths as an image, and as coloured points in the base.
pub(super) fn write_depth(
    pen: Pen<'_>,
    known: &Known,
    base_from_tip: Option<&Pose<Base, Tip>>,
    (depth, rgb): (&DepthImage, &RgbImage),
    far_plane_m: Option<f32>,
) -> Result<(), RecordError> {
    // For a recorded image whose sensor is not known, its largest depth: nothing is behind it.
    let far_m =
        far_plane_m.unwrap_or_else(|| depth.metres.iter().copied().filter(|m| m.is_finite()).fold(0.0, f32::max));
    let path = below(&lens(known), paths::DEPTH);
    pen.write(&path, &compressed_depth(&path, depth, far_m)?)?;
    let base_from_camera = base_from_tip.and_then(|tip| known.base_from_camera(tip));
    let (Some(base_from_camera), Some(intrinsics)) = (base_from_camera, known.intrinsics()) else {
        return Ok(());
    };
    let (points, colours) = points_in_base(depth, rgb, far_m, &intrinsics, &base_from_camera);
    pen.write(
        paths::POINTS,
        &Points3D::new(points).with_colors(colours).with_radii([Radius::new_ui_points(style::THIN_UI_POINTS)]),
    )
}

/// 16 bits without loss; 0 where there is no surface.
fn compressed_depth(path: &str, depth: &DepthImage, far_m: f32) -> Result<EncodedDepthImage, RecordError> {
    let largest = f32::from(u16::MAX) / FINE_STEPS_PER_METRE;
    let per_metre = if far_m < largest { FINE_STEPS_PER_METRE } else { COARSE_STEPS_PER_METRE };
    let mut bytes = Vec::with_capacity(depth.metres.len() * 2);
    for row in 0..depth.height {
        for column in 0..depth.width {
            let steps = match depth.sample(column, row, far_m) {
                DepthSample::Metres(metres) => (metres * per_metre).round().min(f32::from(u16::MAX)) as u16,
                DepthSample::Far | DepthSample::Invalid => 0,
            };
            // The encoder takes samples as they lie in memory.
            bytes.extend(steps.to_ne_bytes());
        }
    }
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Up)
        .write_image(&bytes, depth.width, depth.height, ExtendedColorType::L16)
        .map_err(|error| not_compressed(path, (depth.width, depth.height), &error))?;
    Ok(EncodedDepthImage::new(png)
        .with_media_type(MediaType::png())
        .with_meter(per_metre)
        .with_colormap(rerun::components::Colormap::Turbo))
}

fn points_in_base(
    depth: &DepthImage,
    rgb: &RgbImage,
    far_m: f32,
    intrinsics: &Intrinsics,
    base_from_camera: &Pose<Base, Camera>,
) -> (Vec<[f32; 3]>, Vec<Color>) {
    let (mut points, mut colours) = (Vec::new(), Vec::new());
    for row in (0..depth.height).step_by(POINT_STEP) {
        for column in (0..depth.width).step_by(POINT_STEP) {
            // An image of a different size than the lens, or a pixel outside its model, has no points.
            let Ok(Some(in_camera)) = depth.point(column, row, far_m, intrinsics) else { continue };
            points.push(point(&(*base_from_camera * in_camera).point()));
            let colour = rgb.get_pixel_checked(column, row).map_or([160; 3], |pixel| pixel.0);
            colours.push(Color::from_rgb(colour[0], colour[1], colour[2]));
        }
    }
    (points, colours)
}

/// Where the corners of a board are in an image, as far as they are in it.
pub(super) fn projected(
    target: &TargetSpec,
    intrinsics: &Intrinsics,
    camera_from_target: &Pose<Camera, Target>,
) -> Vec<Vector2<f64>> {
    let inside = |px: &Vector2<f64>| {
        let (width, height) = (f64::from(intrinsics.width), f64::from(intrinsics.height));
        px.x >= -0.5 && px.y >= -0.5 && px.x <= width - 0.5 && px.y <= height - 0.5
    };
    let points = target.points();
    let pixels = points.iter().filter_map(|p| intrinsics.project(&(camera_from_target.isometry() * p)).ok());
    pixels.filter(inside).collect()
}

/// Where the calibration predicts the corners in the live image.
pub(super) fn write_prediction(
    pen: Pen<'_>,
    known: &Known,
    base_from_tip: &Pose<Base, Tip>,
) -> Result<(), RecordError> {
    let (Some(target), Some(intrinsics), Some(camera_from_target)) =
        (known.target, known.intrinsics(), known.predicted_camera_from_target(base_from_tip))
    else {
        return Ok(());
    };
    let path = below(&lens(known), paths::PREDICTED);
    pen.write(&path, &marks(projected(&target, &intrinsics, &camera_from_target), style::PREDICTED))
}
