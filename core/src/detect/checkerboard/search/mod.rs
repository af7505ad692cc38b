//! Chessboards without help: found by their saddles, grown into a grid, refined by a model of the image.
//!
//! 1. [`saddles`]: on a pyramid of halved images, coarse first, points where the image curves up one way and down the
//!    other, with four alternating sectors on a ring around them;
//! 2. [`lattice`]: from a saddle with four neighbours the grid grows by prediction, step by step;
//! 3. [`board`]: the image around every corner is fitted ([`fit`]), with what the neighbours say about the bend of
//!    the edges and the fall of the light.

mod board;
mod edge;
mod fit;
mod lattice;
mod meeting;
mod patch;
mod pyramid;
mod saddles;

use image::GrayImage;

use crate::detect::order::Ordered;
use crate::targets::Grid;
use pyramid::Level;

/// Least squares for which a level is looked at, in its pixels, if the board fills the image: twice what it can see.
const LEVEL_SQUARE_PX: f64 = 10.0;

/// The board's inner corners in some order, refined; `None` when it is not seen.
pub(in crate::detect) fn find(image: &GrayImage, grid: &Grid) -> Option<Ordered> {
    let levels = Level::pyramid(image, coarsest(image, grid));
    levels.iter().enumerate().rev().find_map(|(depth, level)| board_of(&levels, depth, &saddles::find(level), grid))
}

/// Sides of the largest grid of corners in sight, whatever its size, on the levels where `grid` is looked for; `None` where
/// no grid has three by three.
pub(in crate::detect) fn largest(image: &GrayImage, grid: &Grid) -> Option<(usize, usize)> {
    let levels = Level::pyramid(image, coarsest(image, grid));
    let sides = levels.iter().filter_map(|level| lattice::largest(&saddles::find(level), level.size()));
    sides.max_by_key(|(width, height)| width * height)
}

fn board_of(levels: &[Level<'_>], depth: usize, saddles: &[saddles::Saddle], grid: &Grid) -> Option<Ordered> {
    let grown = lattice::grow(saddles, levels[depth].size(), grid.columns, grid.rows)?;
    let order = Ordered::new(grown.points, grid);
    if !order.is_regular() {
        return None;
    }
    let refined = board::refine(levels, depth, &order);
    // Points that only the grid speaks for must be corners.
    let proven = grown.seen.iter().zip(&refined.covariances_px2).all(|(seen, refined)| *seen || refined.is_some());
    (proven && refined.is_regular()).then_some(refined)
}

/// Refines corners that are known to a pixel or so; those whose image is not that of a corner stay, without a
/// covariance.
pub(in crate::detect) fn refine(image: &GrayImage, found: &Ordered) -> Ordered {
    board::refine(&[Level::full(image)], 0, found)
}

/// The coarsest level in which a board that fills the image still has squares of the least size.
fn coarsest(image: &GrayImage, grid: &Grid) -> usize {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let (long, short) = (grid.columns.max(grid.rows) as f64, grid.columns.min(grid.rows) as f64);
    let largest_px = (width.max(height) / long).min(width.min(height) / short);
    (largest_px / LEVEL_SQUARE_PX).log2().floor().clamp(0.0, 6.0) as usize
}

#[cfg(test)]
mod tests;
