//! Chessboards without help: found by their saddles, grown into a grid, refined by a model of the image.
//!
//! 1. [`saddles`]: on a pyramid of halved images, coarse first, points where the image curves up one way and down the
//!    other, with four alternating sectors on a ring around them;
//! 2. [`lattice`]: from a saddle with four neighbours the grid grows by prediction, step by step;
//! 3. [`board`]: the image around every corner is fitted ([`fit`]), with what the neighbours show about the bend of the
//!    edges and the fall of the light.

mod board;
mod edge;
mod fit;
mod lattice;
mod meeting;
mod patch;
mod pyramid;
mod saddles;

use image::GrayImage;
use nalgebra::{Matrix2, Vector2};

use crate::VisionError;
use crate::order::Ordered;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::Grid;
use pyramid::Level;

/// Smallest squares for which a level is searched, in its pixels, if the board fills the image: twice what it can see.
const LEVEL_SQUARE_PX: f64 = 10.0;
/// Smallest part of the corners that are fitted on a board of which some are hidden: as many as must be seen.
const LEAST_FITTED: f64 = lattice::MIN_SEEN;
/// Standard deviation per axis of a hidden corner as a part of the distance to its nearest neighbour: the most by which
/// perspective changes a step from one square to the next.
const HIDDEN_PART: f64 = 0.1;

/// Result of a search.
#[derive(Debug)]
pub(crate) struct Search {
    /// The board's inner corners in some order, refined; `None` when it is not seen.
    pub board: Option<Ordered>,
    /// Levels of the pyramid with a lattice of the board's size, whose corners were fitted: what takes long is not begun
    /// without one.
    pub fitted_levels: usize,
}

/// Looks for the board, the coarsest level first.
pub(crate) fn find(image: &GrayImage, grid: &Grid, cancel: &CancelToken) -> Result<Search, VisionError> {
    let levels = Level::pyramid(image, coarsest(image, grid), cancel)?;
    let (mut fitted_levels, mut partly): (usize, Option<Hidden>) = (0, None);
    for (depth, level) in levels.iter().enumerate().rev() {
        let saddles = saddles::find(level, cancel)?;
        let Some(grown) = lattice::grow(&saddles, level.size(), (grid.columns, grid.rows), cancel)? else { continue };
        let order = Ordered::new(grown.points, grid);
        if !order.is_regular() {
            continue;
        }
        fitted_levels += 1;
        let refined = board::refine(&levels, depth, &order, cancel)?;
        if !refined.is_regular() {
            continue;
        }
        let hidden = Hidden::of(refined, &grown.seen);
        if hidden.corners.is_empty() {
            return Ok(Search { board: Some(hidden.board), fitted_levels });
        }
        if partly.as_ref().is_none_or(|other| hidden.corners.len() < other.corners.len()) {
            partly = Some(hidden);
        }
    }
    // Another level may show what this one does not, so only now.
    Ok(Search { board: partly.and_then(Hidden::stated), fitted_levels })
}

/// Sides of the largest grid of corners in sight, whatever its size, on the levels where `grid` is searched; `None` where
/// no grid has three by three.
pub(crate) fn largest(
    image: &GrayImage,
    grid: &Grid,
    cancel: &CancelToken,
) -> Result<Option<(usize, usize)>, VisionError> {
    let mut best: Option<(usize, usize)> = None;
    for level in Level::pyramid(image, coarsest(image, grid), cancel)? {
        let sides = lattice::largest(&saddles::find(&level, cancel)?, level.size(), cancel)?;
        best = best.into_iter().chain(sides).max_by_key(|(width, height)| width * height);
    }
    Ok(best)
}

/// A board with corners that are supported by neither a saddle nor a fit: only by the grid.
struct Hidden {
    board: Ordered,
    corners: Vec<usize>,
}

impl Hidden {
    fn of(board: Ordered, seen: &[bool]) -> Self {
        let all = seen.iter().zip(&board.covariances_px2).enumerate();
        let corners = all.filter(|(_, (seen, fitted))| !**seen && fitted.is_none()).map(|(index, _)| index).collect();
        Self { board, corners }
    }

    /// The board with its hidden corners where their neighbours put them; `None` when too little of it is sure.
    fn stated(self) -> Option<Ordered> {
        let Self { board, corners } = self;
        let fitted = board.covariances_px2.iter().flatten().count();
        if (fitted as f64) < LEAST_FITTED * board.points.len() as f64 {
            return None;
        }
        let mut stated = board.clone();
        for index in corners {
            let (column, row) = (index % board.columns, index / board.columns);
            let sd_px = HIDDEN_PART * board.spacing(column, row);
            stated.points[index] = between_neighbours(&board, column, row).unwrap_or(board.points[index]);
            stated.covariances_px2[index] = Some(Matrix2::identity() * sd_px * sd_px);
        }
        Some(stated)
    }
}

/// The mean of the middles between opposite neighbours that were fitted.
fn between_neighbours(board: &Ordered, column: usize, row: usize) -> Option<Vector2<f64>> {
    let fitted = |column: usize, row: usize| {
        let index = row * board.columns + column;
        board.covariances_px2[index].map(|_| board.points[index])
    };
    let beside = (column > 0 && column + 1 < board.columns)
        .then(|| Some((fitted(column - 1, row)? + fitted(column + 1, row)?) / 2.0))
        .flatten();
    let above = (row > 0 && row + 1 < board.rows())
        .then(|| Some((fitted(column, row - 1)? + fitted(column, row + 1)?) / 2.0))
        .flatten();
    match (beside, above) {
        (Some(a), Some(b)) => Some((a + b) / 2.0),
        (one, other) => one.or(other),
    }
}

/// The coarsest level in which a board that fills the image still has squares of the smallest size.
fn coarsest(image: &GrayImage, grid: &Grid) -> usize {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let (long, short) = (grid.columns.max(grid.rows) as f64, grid.columns.min(grid.rows) as f64);
    let largest_px = (width.max(height) / long).min(width.min(height) / short);
    (largest_px / LEVEL_SQUARE_PX).log2().floor().clamp(0.0, 6.0) as usize
}

#[cfg(test)]
mod tests;
