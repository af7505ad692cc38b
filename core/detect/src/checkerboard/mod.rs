//! Chessboards: found by their saddles ([`search`]), refined again where edges are hard ([`hard_edges`]), brought into one
//! order.

mod hard_edges;
pub mod saddle;
pub(crate) mod search;
pub mod subpixel;

use image::GrayImage;
use nalgebra::Matrix2;

use super::VisionError;
use super::order::{Ordered, canonical};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::observation::{Corner, Corners};

/// Least share of neighbouring squares that must differ in the direction of the pattern.
const MIN_ALTERNATION: f64 = 0.9;

/// Standard deviation per axis \[px\] stated for a corner that the model of a corner does not fit and `cornerSubPix`
/// refined: dirt, a reflection or a cut square is on it.
const UNSURE_PX: f64 = 0.15;

/// The board's corners with their covariances, in the order of [`super::detect_with`].
pub(super) fn find(image: &GrayImage, grid: &Grid, cancel: &CancelToken) -> Result<Option<Ordered>, VisionError> {
    let search::Search { board, fitted_levels } = search::find(image, grid, cancel)?;
    let Some(found) = board.filter(|order| alternation(image, order) >= MIN_ALTERNATION) else {
        if fitted_levels > 0 {
            tracing::debug!("a lattice of the size of the chessboard is in sight, but it is none");
        }
        return Ok(None);
    };
    let found = with_all_stated(image, found)?;
    let found = hard_edges::refine(image, &found).map_or(found, |refined| refined.corners);
    let ordered = canonical(&found, grid, |order| contrast_of_first_square(image, order) < 0.0);
    Ok(ordered.is_regular().then_some(ordered))
}

/// The sides of the largest chessboard in sight, or of the part of it that is seen, in inner corners, the longer first;
/// `None` below three by three. `grid` is the searched one.
///
/// # Errors
/// [`VisionError::Cancelled`].
pub fn chessboard_in_sight(
    image: &GrayImage,
    grid: &Grid,
    cancel: &CancelToken,
) -> Result<Option<(usize, usize)>, VisionError> {
    Ok(search::largest(image, grid, cancel)?.map(|(width, height)| (width.max(height), width.min(height))))
}

/// The corners of a chessboard as an image with hard edges has them, each with its covariance, from where all of them are to a
/// pixel or so; those that are hidden are left out. `None` for softer images, and where corners are missing.
pub fn on_hard_edges(image: &GrayImage, corners: &[Corner], grid: &Grid) -> Option<Corners> {
    let mut points = vec![None; grid.len()];
    for corner in corners {
        *points.get_mut(corner.index)? = Some(corner.px);
    }
    let found = Ordered::new(points.into_iter().collect::<Option<_>>()?, grid);
    let hard_edges::Refined { corners, seen } = hard_edges::refine(image, &found)?;
    let mut corners = corners.corners();
    corners.retain(|corner| seen[corner.index]);
    Some(corners)
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
