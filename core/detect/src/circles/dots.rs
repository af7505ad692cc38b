//! Dots: found by OpenCV, centred by grey-level moments, and put right for perspective.

use image::GrayImage;
use nalgebra::{Matrix3, Vector2};
use opencv::core::Ptr;
use opencv::features2d::{Feature2D, SimpleBlobDetector, SimpleBlobDetector_Params};

use crate::VisionError;
use crate::bridge::failed;
use handeye_geometry::planar_pose::homography::{homography, mapped};

/// Half window of the moments as a part of a step.
const CELL_PART: f64 = 0.5;
/// Ring of the window that counts as background, as a part of a step from the border inwards.
const RING_PART: f64 = 0.06;
/// Share of the contrast below which a pixel is background and above which it is wholly dot. A pixel on the edge counts
/// in proportion to its grey, which is exact for a dot of one colour; the margin keeps noise of the paper out. Narrower
/// ramps, which come closer to an outline, did worse on photographs.
const RAMP: (f64, f64) = (0.05, 1.0);
/// Moments that move a centre by more than this part of a step have not found the dot.
const MAX_MOVE: f64 = 0.15;

/// One step of the grid along either axis, in pixels.
pub(crate) type Steps = (Vector2<f64>, Vector2<f64>);

#[derive(Debug, Clone, Copy)]
pub(crate) struct Dot {
    /// Centre of its image.
    pub centre: Vector2<f64>,
    /// Area as a part of its cell.
    pub area: f64,
    /// Whether the image border leaves its window whole; a cut window still shows a larger dot, but has no centre.
    pub whole: bool,
}

pub(crate) fn blob_detector(image: &GrayImage, dots: usize, dark: bool) -> Result<Ptr<Feature2D>, VisionError> {
    let mut params = SimpleBlobDetector_Params::default().map_err(failed("set up the search for dots"))?;
    params.blob_color = if dark { 0 } else { 255 };
    params.min_threshold = 20.0;
    params.max_threshold = 230.0;
    params.threshold_step = 10.0;
    // Twelve pixels make a dot 4 px wide; the largest fills the cell it would have if the grid filled the image.
    params.min_area = 12.0;
    params.max_area = (image.width() as f32 * image.height() as f32) / dots as f32;
    params.min_dist_between_blobs = 5.0;
    params.filter_by_circularity = false;
    params.min_inertia_ratio = 0.2;
    params.min_convexity = 0.8;
    Ok(SimpleBlobDetector::create(params).map_err(failed("set up the search for dots"))?.into())
}

/// The dot near `start`; `None` where there is none.
pub(crate) fn measure(image: &GrayImage, start: Vector2<f64>, steps: &Steps, dark: bool) -> Option<Dot> {
    let spacing = steps.0.norm().min(steps.1.norm());
    // The second window is centred on the dot, so that what it cuts off is the same on all sides.
    moments(image, start, steps, dark)
        .and_then(|first| if first.whole { moments(image, first.centre, steps, dark) } else { Some(first) })
        .filter(|dot| !dot.whole || (dot.centre - start).norm() <= MAX_MOVE * spacing)
}

/// Area and centroid of the pixels that differ from the background around them; `None` without contrast.
fn moments(image: &GrayImage, start: Vector2<f64>, (along_x, along_y): &Steps, dark: bool) -> Option<Dot> {
    let cell = along_x.perp(along_y);
    let half = (along_x.abs() + along_y.abs()) * CELL_PART;
    let (low, high) = ((start - half).map(f64::ceil), (start + half).map(f64::floor));
    let (width, height) = image.dimensions();
    let last = Vector2::new(f64::from(width) - 1.0, f64::from(height) - 1.0);
    let whole = low.x >= 0.0 && low.y >= 0.0 && high.x <= last.x && high.y <= last.y;
    let (low, high) = (low.sup(&Vector2::zeros()), high.inf(&last));
    let mut pixels = Vec::new();
    let mut ring = Vec::new();
    for v in low.y as u32..=high.y as u32 {
        for u in low.x as u32..=high.x as u32 {
            let p = Vector2::new(f64::from(u), f64::from(v)) - start;
            let reach = f64::max((p.perp(along_y) / cell).abs(), (along_x.perp(&p) / cell).abs());
            let grey = f64::from(image.get_pixel(u, v).0[0]);
            let level = if dark { 255.0 - grey } else { grey };
            if reach <= CELL_PART {
                pixels.push((p, level));
            }
            if (CELL_PART - RING_PART..=CELL_PART + RING_PART).contains(&reach) {
                ring.push(level);
            }
        }
    }
    let background = quantile(&mut ring, 0.5)?;
    let mut levels: Vec<f64> = pixels.iter().map(|(_, level)| *level).collect();
    let foreground = quantile(&mut levels, 0.95)?;
    let contrast = foreground - background;
    if contrast < 10.0 {
        return None;
    }
    let mut sum = Vector2::zeros();
    let mut area = 0.0;
    for (p, level) in pixels {
        let share = (((level - background) / contrast - RAMP.0) / (RAMP.1 - RAMP.0)).clamp(0.0, 1.0);
        sum += p * share;
        area += share;
    }
    (area > 0.0).then(|| Dot { centre: start + sum / area, area: area / cell.abs(), whole })
}

pub(crate) fn quantile(values: &mut [f64], part: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    values.sort_by(f64::total_cmp);
    Some(values[(part * last as f64).round() as usize])
}

/// Turns centres of images of dots into images of centres.
///
/// The image of a round dot is an ellipse, and its centre lies nearer to the camera's side than the image of the dot's
/// centre: for a dot of diameter d at distance z seen under an angle t by about f d² sin t cos t / (4 z²) pixels. The
/// shift follows from the map from target to image: with the dual conic of the dot, `D`, that of its image is `H D Hᵀ`,
/// and its centre is in its last column. The map is that of the centres themselves, and is found again from the corrected
/// ones. The distortion within one dot is neglected.
///
/// Reference: Heikkilä 2000, "Geometric camera calibration using circular control points", section 3.
pub(crate) fn image_of_centres(
    centres: &mut [Vector2<f64>],
    on_target: &[Vector2<f64>],
    radii: &[Option<f64>],
) -> Option<()> {
    let seen = centres.to_vec();
    for _ in 0..2 {
        let pairs: Vec<_> = on_target.iter().copied().zip(centres.iter().copied()).collect();
        let map = homography(&pairs)?;
        for (i, centre) in centres.iter_mut().enumerate() {
            if let Some(radius) = radii[i] {
                *centre = seen[i] - (centre_of_image(&map, on_target[i], radius) - mapped(&map, on_target[i]));
            }
        }
    }
    Some(())
}

/// Centre of the image of a circle.
fn centre_of_image(map: &Matrix3<f64>, centre: Vector2<f64>, radius: f64) -> Vector2<f64> {
    let (x, y, r2) = (centre.x, centre.y, radius * radius);
    let dual = Matrix3::new(x * x - r2, x * y, x, x * y, y * y - r2, y, x, y, 1.0);
    let image = map * dual * map.transpose();
    Vector2::new(image[(0, 2)], image[(1, 2)]) / image[(2, 2)]
}

/// Radius of a dot by the area of its image as a part of its cell.
pub(crate) fn radius(dot: &Dot, cell_m2: f64) -> f64 {
    (dot.area * cell_m2 / std::f64::consts::PI).sqrt()
}
