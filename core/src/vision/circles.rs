//! Grids of dots: found by OpenCV, centred by grey-level moments, brought into one order.

use image::GrayImage;
use nalgebra::Vector2;
use opencv::calib3d;
use opencv::core::{Point2f, Ptr, Size, Vector};
use opencv::features2d::{Feature2D, SimpleBlobDetector, SimpleBlobDetector_Params};

use super::VisionError;
use super::bridge::{failed, from_points2f, mat_from_gray};
use super::detect::Effort;
use super::order::{Ordered, canonical};
use crate::target::Grid;

/// A dot counts as the larger one when its area is this many times the usual: drawn 1.5 times as wide it has 2.25
/// times the area, and perspective and blur vary the ratio of equal dots by less than a fifth.
const LARGER_DOT: f64 = 1.5;
/// Largest distance of a dot from the middle of its two neighbours, as a part of their distance.
const MAX_BEND: f64 = 0.1;
/// Half window of the moments as a part of a grid step.
const CELL_PART: f64 = 0.5;
/// Ring of the window that counts as background, as a part of a grid step from the border inwards.
const RING_PART: f64 = 0.06;
/// Share of the contrast below which a pixel is background and above which it is wholly dot. A pixel on the edge counts
/// in proportion to its grey, which is exact for a dot of one colour; the margin keeps noise of the paper out. Narrower
/// ramps, which come closer to an outline, did worse on photographs.
const RAMP: (f64, f64) = (0.05, 1.0);
/// Moments that move a centre by more than this part of a grid step have not found the dot.
const MAX_MOVE: f64 = 0.15;

/// Centres are those of the dots' images; the centre of an ellipse is not the image of the circle's centre, which for
/// a dot of diameter d at distance z seen under an angle t is off by up to about f d² sin t / (4 z²) pixels towards
/// the camera's side.
pub(super) fn find(image: &GrayImage, grid: &Grid, effort: Effort) -> Result<Option<Ordered>, VisionError> {
    let Some((found, dark)) = search(image, grid, effort)? else { return Ok(None) };
    let dots: Vec<Option<Dot>> = measure(image, &found, dark);
    let larger = larger_dot(&found, &dots);
    let mut refined = found;
    for (point, dot) in refined.points.iter_mut().zip(&dots) {
        if let Some(dot) = dot.filter(|dot| dot.whole) {
            *point = dot.centre;
        }
    }
    let origin = larger.map(|index| refined.points[index]);
    Ok(Some(canonical(&refined, grid, |order| origin == Some(order.points[0]))))
}

/// The points in some order, and whether the dots are dark on light.
fn search(image: &GrayImage, grid: &Grid, effort: Effort) -> Result<Option<(Ordered, bool)>, VisionError> {
    const PLAIN: i32 = calib3d::CALIB_CB_SYMMETRIC_GRID;
    const CLUSTERED: i32 = calib3d::CALIB_CB_SYMMETRIC_GRID + calib3d::CALIB_CB_CLUSTERING;
    let attempts: &[(bool, i32)] = match effort {
        Effort::Live => &[(true, PLAIN)],
        Effort::Thorough => &[(true, PLAIN), (true, CLUSTERED), (false, PLAIN), (false, CLUSTERED)],
    };
    let mat = mat_from_gray(image)?;
    // The sizes are checked before: see `detect`.
    let pattern = Size::new(grid.columns as i32, grid.rows as i32);
    for &(dark, flags) in attempts {
        let detector: Ptr<Feature2D> = blob_detector(image, grid, dark)?.into();
        let mut centres = Vector::<Point2f>::new();
        let found = calib3d::find_circles_grid(&mat, pattern, &mut centres, flags, Some(&detector))
            .map_err(failed("look for a grid of dots"))?;
        if !found || centres.len() != grid.len() {
            continue;
        }
        let order = Ordered::new(from_points2f(&centres), grid);
        if order.is_regular() && order.is_smooth(MAX_BEND) {
            return Ok(Some((order, dark)));
        }
    }
    Ok(None)
}

fn blob_detector(image: &GrayImage, grid: &Grid, dark: bool) -> Result<Ptr<SimpleBlobDetector>, VisionError> {
    let mut params = SimpleBlobDetector_Params::default().map_err(failed("set up the search for dots"))?;
    params.blob_color = if dark { 0 } else { 255 };
    params.min_threshold = 20.0;
    params.max_threshold = 230.0;
    params.threshold_step = 10.0;
    // Twelve pixels make a dot 4 px wide; the largest fills the cell it would have if the grid filled the image.
    params.min_area = 12.0;
    params.max_area = (image.width() as f32 * image.height() as f32) / grid.len() as f32;
    params.min_dist_between_blobs = 5.0;
    params.filter_by_circularity = false;
    params.min_inertia_ratio = 0.2;
    params.min_convexity = 0.8;
    SimpleBlobDetector::create(params).map_err(failed("set up the search for dots"))
}

#[derive(Debug, Clone, Copy)]
struct Dot {
    centre: Vector2<f64>,
    /// Area as a part of its cell.
    area: f64,
    /// Whether the image border leaves its window whole; a cut window still tells a larger dot, but has no centre.
    whole: bool,
}

fn measure(image: &GrayImage, order: &Ordered, dark: bool) -> Vec<Option<Dot>> {
    let mut dots = Vec::with_capacity(order.points.len());
    for row in 0..order.rows() {
        for column in 0..order.columns {
            let steps = order.steps(column, row);
            let start = order.at(column, row);
            // The second window is centred on the dot, so that what it cuts off is the same on all sides.
            let dot = moments(image, start, &steps, dark)
                .and_then(|first| if first.whole { moments(image, first.centre, &steps, dark) } else { Some(first) })
                .filter(|dot| !dot.whole || (dot.centre - start).norm() <= MAX_MOVE * order.spacing(column, row));
            dots.push(dot);
        }
    }
    dots
}

/// Area and centroid of the pixels that differ from the background around them; `None` without contrast.
fn moments(
    image: &GrayImage,
    start: Vector2<f64>,
    (along_x, along_y): &(Vector2<f64>, Vector2<f64>),
    dark: bool,
) -> Option<Dot> {
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

fn quantile(values: &mut [f64], part: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    values.sort_by(f64::total_cmp);
    Some(values[(part * last as f64).round() as usize])
}

/// Index of the one larger dot, when it is at a corner of the grid.
fn larger_dot(order: &Ordered, dots: &[Option<Dot>]) -> Option<usize> {
    let mut areas: Vec<f64> = dots.iter().flatten().map(|dot| dot.area).collect();
    let usual = quantile(&mut areas, 0.5)?;
    let mut larger = (0..dots.len()).filter(|&i| dots[i].is_some_and(|dot| dot.area > LARGER_DOT * usual));
    let (index, more) = (larger.next()?, larger.next());
    let (column, row) = (index % order.columns, index / order.columns);
    let at_corner = (column == 0 || column + 1 == order.columns) && (row == 0 || row + 1 == order.rows());
    (more.is_none() && at_corner).then_some(index)
}
