//! Blur of the edges of a chessboard.

use image::GrayImage;
use nalgebra::Vector2;

use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::observation::Corner;

/// Part of an edge, from either of its corners, that is left out: near a corner the other edge is seen.
const CORNER_PART: f64 = 0.25;
/// How far to either side of an edge pixels count, as a part of the distance to the next parallel edge.
const REACH: f64 = 0.45;
/// Part of that reach beyond which pixels show the square's own level.
const LEVEL_FROM: f64 = 0.8;
/// Least contrast of an edge in grey levels.
const MIN_CONTRAST: f64 = 10.0;
/// Edges of one direction below which there is no median.
const MIN_EDGES: usize = 3;

/// Largest blur (1σ) as a part of a square's side. The corner fit sees 0.42 of a square to either side of an edge; at
/// this blur that is 2.8σ, just enough for both levels to be seen, so that contrast and blur can be separated. By then
/// noise moves a corner twice as far as in a sharp image.
pub const MAX_BLUR_SHARE: f64 = 0.15;

/// Blur of the board's edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeBlur {
    /// Standard deviation \[px\] of the Gaussian that the edges look blurred by, the pixel's own area (0.29 px) included.
    pub sigma_px: f64,
    /// Side of a square \[px\] across the edges, as foreshortened as it is.
    pub square_px: f64,
}

impl EdgeBlur {
    /// Measures it: the median over edges, of the direction of edges that is more blurred (a moving camera blurs those
    /// across its motion).
    ///
    /// Each edge between two neighbouring corners is a straight line. The level of pixels next to it is compared with
    /// that of the square that they are in; for an edge blurred by a Gaussian the deviations sum up, along the normal,
    /// to `σ √(2/π)` times the contrast. Sums are taken with their sign, so that noise cancels. Accurate to a tenth
    /// between 0.5 px and [`MAX_BLUR_SHARE`] of the square; smaller blurs are overestimated by up to 0.3 px along rows
    /// and columns of pixels, larger ones end at a fifth of the square.
    ///
    /// `None` when fewer than three edges of either direction can be measured: squares of less than 5 px, no contrast.
    pub(crate) fn measure(grey: &GrayImage, corners: &[Corner], grid: &Grid) -> Option<Self> {
        let mut at = vec![None; grid.len()];
        for corner in corners {
            *at.get_mut(corner.index)? = Some(corner.px);
        }
        let along_rows = direction(grey, &at, grid, (1, 0), (0, 1));
        let along_columns = direction(grey, &at, grid, (0, 1), (1, 0));
        let share = |blur: &Self| blur.sigma_px / blur.square_px;
        [along_rows, along_columns].into_iter().flatten().max_by(|a, b| share(a).total_cmp(&share(b)))
    }

    /// Whether corners cannot be measured well with this blur, see [`MAX_BLUR_SHARE`].
    pub fn is_too_blurred(&self) -> bool {
        self.sigma_px > MAX_BLUR_SHARE * self.square_px
    }

    /// Distance \[px\] over which an edge goes from 10 % to 90 % of its contrast.
    pub fn edge_width_px(&self) -> f64 {
        2.563 * self.sigma_px
    }
}

/// The median of the edges that run from a corner to its neighbour `along`, with the squares on the side `across`.
fn direction(
    grey: &GrayImage,
    at: &[Option<Vector2<f64>>],
    grid: &Grid,
    along: (usize, usize),
    across: (usize, usize),
) -> Option<EdgeBlur> {
    let corner = |column: usize, row: usize| {
        let inside = column < grid.columns && row < grid.rows;
        if inside { at.get(row * grid.columns + column).copied().flatten() } else { None }
    };
    let mut sigmas = Vec::new();
    let mut sides = Vec::new();
    for row in 0..grid.rows {
        for column in 0..grid.columns {
            // The squares on both sides are whole only where there are corners on both sides.
            let (Some(before_column), Some(before_row)) = (column.checked_sub(across.0), row.checked_sub(across.1))
            else {
                continue;
            };
            let (Some(a), Some(b), Some(c), Some(d)) = (
                corner(column, row),
                corner(column + along.0, row + along.1),
                corner(column + across.0, row + across.1),
                corner(before_column, before_row),
            ) else {
                continue;
            };
            let Some(normal) = Vector2::new(a.y - b.y, b.x - a.x).try_normalize(1e-9) else { continue };
            let side = normal.dot(&(c - a)).abs().min(normal.dot(&(d - a)).abs());
            if let Some(sigma) = edge_sigma(grey, a, b, normal, REACH * side) {
                sigmas.push(sigma);
                sides.push(side);
            }
        }
    }
    if sigmas.len() < MIN_EDGES {
        return None;
    }
    Some(EdgeBlur { sigma_px: median_high(sigmas)?, square_px: median_high(sides)? })
}

/// Blur of one edge, from the pixels up to `reach` to either side of it.
fn edge_sigma(grey: &GrayImage, a: Vector2<f64>, b: Vector2<f64>, normal: Vector2<f64>, reach: f64) -> Option<f64> {
    let length = (b - a).norm();
    let tangent = (b - a) / length;
    let pixels = pixels_beside(grey, (a + b) / 2.0, tangent, normal, (0.5 - CORNER_PART) * length, reach);
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (count, sum) = values.fold((0u32, 0.0), |(count, sum), value| (count + 1, sum + value));
        (count > 0).then(|| sum / f64::from(count))
    };
    let side = |sign: f64| pixels.iter().filter(move |(t, _)| t * sign > 0.0).map(move |(t, level)| (t * sign, *level));
    let level = |sign: f64| mean(&mut side(sign).filter(|(t, _)| *t >= LEVEL_FROM * reach).map(|(_, level)| level));
    let (positive, negative) = (level(1.0)?, level(-1.0)?);
    let contrast = positive - negative;
    if contrast.abs() < MIN_CONTRAST {
        return None;
    }
    let above = mean(&mut side(1.0).map(|(_, level)| (positive - level) / contrast))?;
    let below = mean(&mut side(-1.0).map(|(_, level)| (level - negative) / contrast))?;
    let area_px = (above + below) * reach;
    Some((area_px * (std::f64::consts::PI / 2.0).sqrt()).max(0.0))
}

/// Distance to the line and level of the pixels within `half` along it and `reach` across it.
fn pixels_beside(
    grey: &GrayImage,
    middle: Vector2<f64>,
    tangent: Vector2<f64>,
    normal: Vector2<f64>,
    half: f64,
    reach: f64,
) -> Vec<(f64, f64)> {
    let extent = tangent.abs() * half + normal.abs() * reach;
    let (low, high) = ((middle - extent).map(f64::ceil), (middle + extent).map(f64::floor));
    let (width, height) = grey.dimensions();
    let inside = low.x >= 0.0 && low.y >= 0.0 && high.x < f64::from(width) && high.y < f64::from(height);
    // Also for what is not a number.
    if !inside || reach < 2.0 {
        return Vec::new();
    }
    let mut pixels = Vec::new();
    for v in low.y as u32..=high.y as u32 {
        for u in low.x as u32..=high.x as u32 {
            let p = Vector2::new(f64::from(u), f64::from(v)) - middle;
            let across = p.dot(&normal);
            if p.dot(&tangent).abs() <= half && across.abs() <= reach {
                pixels.push((across, f64::from(grey.get_pixel(u, v).0[0])));
            }
        }
    }
    pixels
}
