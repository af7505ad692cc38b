//! Chessboards: found by our own detector, or with all effort by OpenCV's; brought into one order.

pub(crate) mod saddle;
pub(crate) mod search;
pub(crate) mod subpixel;

use image::GrayImage;
use nalgebra::{Matrix2, Vector2};
use opencv::boxed_ref::BoxedRef;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Size, ToInputArray, Vector};
use opencv::imgproc;
use opencv::prelude::*;

use super::VisionError;
use super::bridge::{failed, from_points2f, mat_from_gray};
use super::options::Effort;
use super::order::{Ordered, canonical};
use crate::targets::Grid;

/// Least share of neighbouring squares that must differ in the direction the pattern asks for.
const MIN_ALTERNATION: f64 = 0.9;
/// Larger images are searched at a half, a third … of their size first: quads cost in proportion to their number, and
/// texture has more of them the closer one looks.
const PIXELS_TO_REDUCE: u32 = 1_000_000;
/// Images up to this many pixels are worth enlarging in search of a small board.
const PIXELS_TO_ENLARGE: u32 = 500_000;

/// Standard deviation per axis \[px\] stated for a corner that the model of a corner does not fit and `cornerSubPix`
/// refined: dirt, a reflection or a cut square is on it.
const UNSURE_PX: f64 = 0.15;

/// The board's corners with their covariances, in the order of [`super::detect_with`].
///
/// A live search is by our own [`search`] alone; with all effort OpenCV looks where that sees a grid and not the board. Where
/// there is no grid of three by three corners on any level of the pyramid there is no board to look for again.
pub(super) fn find(image: &GrayImage, grid: &Grid, effort: Effort) -> Result<Option<Ordered>, VisionError> {
    let native = search::find(image, grid).filter(|order| alternation(image, order) >= MIN_ALTERNATION);
    let found = match (native, effort) {
        (Some(found), _) => Some(found),
        (None, Effort::Live) => None,
        (None, Effort::Thorough) if search::largest(image, grid).is_none() => None,
        (None, Effort::Thorough) => search(image, grid)?.map(|found| search::refine(image, &found)),
    };
    let Some(found) = found else { return Ok(None) };
    let found = with_all_stated(image, found)?;
    let ordered = canonical(&found, grid, |order| contrast_of_first_square(image, order) < 0.0);
    Ok(ordered.is_regular().then_some(ordered))
}

/// The sides of the largest chessboard in sight, or of the part of it that is seen, in inner corners, the longer first;
/// `None` below three by three. `grid` is what was looked for.
pub fn chessboard_in_sight(image: &GrayImage, grid: &Grid) -> Option<(usize, usize)> {
    search::largest(image, grid).map(|(width, height)| (width.max(height), width.min(height)))
}

/// Corners without a fit are refined by OpenCV and stated with [`UNSURE_PX`].
fn with_all_stated(image: &GrayImage, mut found: Ordered) -> Result<Ordered, VisionError> {
    if found.covariances_px2.iter().all(Option::is_some) {
        return Ok(found);
    }
    let sub_pix = subpixel::corner_sub_pix(image, &found)?;
    for (index, covariance_px2) in found.covariances_px2.iter_mut().enumerate() {
        if covariance_px2.is_none() {
            found.points[index] = sub_pix.points[index];
            *covariance_px2 = Some(Matrix2::identity() * UNSURE_PX * UNSURE_PX);
        }
    }
    Ok(found)
}

/// A way to look.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Strategy {
    /// Quads after one threshold for the whole image, given up at once when too few dark and light blobs are in sight.
    Plain { scale: f64 },
    /// The same after the light is evened out: the mean around each pixel is taken off.
    Flattened { scale: f64 },
    /// Quads after thresholds in windows of several sizes: for uneven light, several times as slow on a miss.
    Adaptive { scale: f64 },
    /// The sector-based detector (Duda & Frese 2018): half a second per megapixel, for boards whose squares no
    /// threshold separates. `robust` normalises the image and tries more.
    SectorBased { robust: bool },
}

fn strategies(image: &GrayImage) -> Vec<Strategy> {
    let pixels = image.width().saturating_mul(image.height());
    let divisor = (f64::from(pixels) / f64::from(PIXELS_TO_REDUCE)).sqrt().ceil().max(1.0);
    let scale = 1.0 / divisor;
    let mut all = vec![Strategy::Plain { scale }, Strategy::Flattened { scale }];
    if scale < 1.0 {
        all.extend([Strategy::Plain { scale: 1.0 }, Strategy::Flattened { scale: 1.0 }]);
    }
    all.push(Strategy::Adaptive { scale });
    if pixels <= PIXELS_TO_ENLARGE {
        all.push(Strategy::Plain { scale: 2.0 });
    }
    all.extend([Strategy::SectorBased { robust: false }, Strategy::SectorBased { robust: true }]);
    all
}

/// What OpenCV finds, to a pixel or so.
fn search(image: &GrayImage, grid: &Grid) -> Result<Option<Ordered>, VisionError> {
    let mat = mat_from_gray(image)?;
    for strategy in strategies(image) {
        let Some(points) = attempt(&mat, grid, strategy)? else { continue };
        let order = Ordered::new(points, grid);
        if order.is_regular() && alternation(image, &order) >= MIN_ALTERNATION {
            tracing::debug!(?strategy, "chessboard found by OpenCV after our own search missed it");
            return Ok(Some(order));
        }
    }
    Ok(None)
}

fn attempt(mat: &BoxedRef<'_, Mat>, grid: &Grid, strategy: Strategy) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    match strategy {
        Strategy::Plain { scale } => {
            scaled(mat, grid, scale, calib3d::CALIB_CB_NORMALIZE_IMAGE + calib3d::CALIB_CB_FAST_CHECK)
        }
        Strategy::Flattened { scale } => scaled(&flattened(mat)?, grid, scale, calib3d::CALIB_CB_FAST_CHECK),
        Strategy::Adaptive { scale } => {
            scaled(mat, grid, scale, calib3d::CALIB_CB_NORMALIZE_IMAGE + calib3d::CALIB_CB_ADAPTIVE_THRESH)
        }
        Strategy::SectorBased { robust } => find_sectors(mat, grid, robust),
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

fn find_sectors(mat: &impl ToInputArray, grid: &Grid, robust: bool) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let more = if robust { calib3d::CALIB_CB_NORMALIZE_IMAGE + calib3d::CALIB_CB_EXHAUSTIVE } else { 0 };
    let mut corners = Vector::<Point2f>::new();
    let flags = calib3d::CALIB_CB_ACCURACY + more;
    let found = calib3d::find_chessboard_corners_sb(mat, pattern(grid), &mut corners, flags)
        .map_err(failed("look for a chessboard by sectors"))?;
    Ok(complete(found, &corners, grid))
}

/// OpenCV leaves a partial list behind when it does not find all.
fn complete(found: bool, corners: &Vector<Point2f>, grid: &Grid) -> Option<Vec<Vector2<f64>>> {
    (found && corners.len() == grid.len()).then(|| from_points2f(corners))
}

/// The image less its mean over an eighth of its size, with half as much contrast again, around middle grey.
fn flattened(mat: &(impl ToInputArray + MatTraitConst)) -> Result<Mat, VisionError> {
    const GAIN: f64 = 1.5;
    let side = mat.cols().min(mat.rows()) / 8 + 1;
    let (mut mean, mut out) = (Mat::default(), Mat::default());
    imgproc::blur_def(mat, &mut mean, Size::new(side, side)).map_err(failed("even out the light"))?;
    opencv::core::add_weighted_def(mat, GAIN, &mean, -GAIN, 128.0, &mut out).map_err(failed("even out the light"))?;
    Ok(out)
}

fn scaled(
    mat: &impl ToInputArray,
    grid: &Grid,
    factor: f64,
    flags: i32,
) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    if factor == 1.0 {
        return find_quads(mat, grid, flags);
    }
    let method = if factor < 1.0 { imgproc::INTER_AREA } else { imgproc::INTER_CUBIC };
    let mut resized = Mat::default();
    imgproc::resize(mat, &mut resized, Size::default(), factor, factor, method)
        .map_err(failed("change the size of the image"))?;
    let found = find_quads(&resized, grid, flags)?;
    // Rounding of the size moves points by less than a pixel, which the refinement takes.
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
