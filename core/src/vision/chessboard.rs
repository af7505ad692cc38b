//! Chessboards: found by OpenCV, brought into one order, refined by our own corner model.

use image::GrayImage;
use nalgebra::Vector2;
use opencv::boxed_ref::BoxedRef;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Size, ToInputArray, Vector};
use opencv::imgproc;

use super::VisionError;
use super::bridge::{failed, from_points2f, mat_from_gray};
use super::detect::Effort;
use super::order::{Ordered, canonical};
use super::subpixel;
use crate::target::Grid;

/// Least share of neighbouring squares that must differ in the direction the pattern asks for.
const MIN_ALTERNATION: f64 = 0.9;
/// Images up to this many pixels are worth enlarging in search of a small board; beyond it costs seconds.
const MAX_PIXELS_TO_ENLARGE: u32 = 1_500_000;
/// Images of less width than this are not made smaller: squares would vanish.
const MIN_WIDTH_TO_REDUCE: u32 = 640;

pub(super) fn find(image: &GrayImage, grid: &Grid, effort: Effort) -> Result<Option<Ordered>, VisionError> {
    let Some(found) = search(image, grid, effort)? else { return Ok(None) };
    let ordered = canonical(&found, grid, |order| contrast_of_first_square(image, order) < 0.0);
    let refined = subpixel::refine(image, &ordered)?;
    Ok(refined.is_regular().then_some(refined))
}

/// The way to look, in the order in which they are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Strategy {
    /// Adaptive threshold and quads, given up at once when too few quads are in sight.
    Quick,
    /// The same with every threshold and dilation.
    Patient,
    /// Every threshold on an image of half the size: for large squares, blur and noise.
    Reduced,
    /// Every threshold on an image of twice the size: for small squares.
    Enlarged,
    /// The sector-based detector (Duda & Frese 2018): slow, for the boards that thresholds cannot separate.
    SectorBased,
}

fn strategies(image: &GrayImage, effort: Effort) -> Vec<Strategy> {
    let (width, height) = image.dimensions();
    let mut all = vec![Strategy::Quick];
    if effort == Effort::Thorough {
        all.push(Strategy::Patient);
        if width >= MIN_WIDTH_TO_REDUCE {
            all.push(Strategy::Reduced);
        }
        if width.saturating_mul(height) <= MAX_PIXELS_TO_ENLARGE {
            all.push(Strategy::Enlarged);
        }
        all.push(Strategy::SectorBased);
    }
    all
}

fn search(image: &GrayImage, grid: &Grid, effort: Effort) -> Result<Option<Ordered>, VisionError> {
    let mat = mat_from_gray(image)?;
    for strategy in strategies(image, effort) {
        let Some(points) = attempt(&mat, grid, strategy)? else { continue };
        let order = Ordered::new(points, grid);
        if order.is_regular() && alternation(image, &order) >= MIN_ALTERNATION {
            tracing::trace!(?strategy, "chessboard found");
            return Ok(Some(order));
        }
    }
    Ok(None)
}

fn attempt(mat: &BoxedRef<'_, Mat>, grid: &Grid, strategy: Strategy) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    const QUADS: i32 = calib3d::CALIB_CB_ADAPTIVE_THRESH + calib3d::CALIB_CB_NORMALIZE_IMAGE;
    match strategy {
        Strategy::Quick => find_quads(mat, grid, QUADS + calib3d::CALIB_CB_FAST_CHECK),
        Strategy::Patient => find_quads(mat, grid, QUADS),
        Strategy::Reduced => scaled(mat, grid, 0.5, QUADS),
        Strategy::Enlarged => scaled(mat, grid, 2.0, QUADS),
        Strategy::SectorBased => find_sectors(mat, grid),
    }
}

fn pattern(grid: &Grid) -> Size {
    // The sizes are checked before: see `detect`.
    Size::new(grid.columns as i32, grid.rows as i32)
}

fn find_quads(mat: &impl ToInputArray, grid: &Grid, flags: i32) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let mut corners = Vector::<Point2f>::new();
    let found = calib3d::find_chessboard_corners(mat, pattern(grid), &mut corners, flags)
        .map_err(failed("look for a chessboard"))?;
    Ok(complete(found, &corners, grid))
}

fn find_sectors(mat: &impl ToInputArray, grid: &Grid) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let flags = calib3d::CALIB_CB_NORMALIZE_IMAGE + calib3d::CALIB_CB_EXHAUSTIVE + calib3d::CALIB_CB_ACCURACY;
    for flags in [calib3d::CALIB_CB_ACCURACY, flags] {
        let mut corners = Vector::<Point2f>::new();
        let found = calib3d::find_chessboard_corners_sb(mat, pattern(grid), &mut corners, flags)
            .map_err(failed("look for a chessboard by sectors"))?;
        if let Some(points) = complete(found, &corners, grid) {
            return Ok(Some(points));
        }
    }
    Ok(None)
}

/// OpenCV leaves a partial list behind when it does not find all.
fn complete(found: bool, corners: &Vector<Point2f>, grid: &Grid) -> Option<Vec<Vector2<f64>>> {
    (found && corners.len() == grid.len()).then(|| from_points2f(corners))
}

fn scaled(
    mat: &BoxedRef<'_, Mat>,
    grid: &Grid,
    factor: f64,
    flags: i32,
) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let method = if factor < 1.0 { imgproc::INTER_AREA } else { imgproc::INTER_CUBIC };
    let mut resized = Mat::default();
    imgproc::resize(mat, &mut resized, Size::default(), factor, factor, method)
        .map_err(failed("change the size of the image"))?;
    let found = find_quads(&resized, grid, flags)?;
    // Pixel centres: a coordinate u covers u - 0.5 .. u + 0.5, so it is u + 0.5 that scales.
    let back = |p: Vector2<f64>| p.map(|c| (c + 0.5) / factor - 0.5);
    Ok(found.map(|points| points.into_iter().map(back).collect()))
}

/// Intensity around the centre of a cell: the mean of 3×3 pixels, or of the one pixel where squares are small.
fn cell_intensity(image: &GrayImage, order: &Ordered, column: usize, row: usize) -> f64 {
    let centre = order.cell_centre(column, row);
    let [a, b, c, d] = order.cell(column, row);
    let side =
        [(b - a).norm(), (c - b).norm(), (d - c).norm(), (a - d).norm()].into_iter().fold(f64::INFINITY, f64::min);
    let reach = i64::from(side > 6.0);
    let (width, height) = (i64::from(image.width()), i64::from(image.height()));
    let (u, v) = (centre.x.round() as i64, centre.y.round() as i64);
    let mut sum = 0.0;
    let mut count = 0.0;
    for y in v - reach..=v + reach {
        for x in u - reach..=u + reach {
            if (0..width).contains(&x) && (0..height).contains(&y) {
                sum += f64::from(image.get_pixel(x as u32, y as u32).0[0]);
                count += 1.0;
            }
        }
    }
    // A cell between corners in the image always covers a pixel of it; the fallback cannot decide anything.
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Differences between horizontally and vertically neighbouring cells: a cell of even parity less its odd neighbour.
fn differences(image: &GrayImage, order: &Ordered) -> Vec<f64> {
    let (columns, rows) = (order.columns - 1, order.rows() - 1);
    let intensity: Vec<f64> =
        (0..columns * rows).map(|i| cell_intensity(image, order, i % columns, i / columns)).collect();
    let mut out = Vec::with_capacity(2 * columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let sign = if (row + column) % 2 == 0 { 1.0 } else { -1.0 };
            let here = intensity[row * columns + column];
            if column + 1 < columns {
                out.push(sign * (here - intensity[row * columns + column + 1]));
            }
            if row + 1 < rows {
                out.push(sign * (here - intensity[(row + 1) * columns + column]));
            }
        }
    }
    out
}

/// Share of neighbouring cells that differ in the same direction: 1 for a chessboard, one half for anything else.
///
/// Neighbours are compared, not cells with a threshold, so that a gradient of the light across the board is harmless.
fn alternation(image: &GrayImage, order: &Ordered) -> f64 {
    let all = differences(image, order);
    let positive = all.iter().filter(|&&d| d > 0.0).count();
    let negative = all.iter().filter(|&&d| d < 0.0).count();
    positive.max(negative) as f64 / all.len() as f64
}

/// How much brighter the first square and all of its colour are than their neighbours; negative when it is dark.
fn contrast_of_first_square(image: &GrayImage, order: &Ordered) -> f64 {
    differences(image, order).iter().sum()
}
