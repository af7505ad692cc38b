//! Corners of images without anti-aliasing, from all sides of all squares at once.
//!
//! A frame buffer with one sample a pixel, as CoppeliaSim's vision sensors have it, only shows between which two pixel centres
//! of a row or a column an edge passes. That is a uniform error of one pixel, not noise: it repeats as long as nothing moves.
//! Least squares on grey levels ([`super::search`]) treat it as noise and have errors of 0.07–0.25 px. But along its length an
//! edge passes at many places within a pixel, and each row states *between these two*: the rows restrict the places of both
//! ends of a side of a square to a small polygon ([`polygon`]). Its centroid and its second moments are what is known about
//! the side, and where an edge runs along a row they show that its place within the pixel is not known.
//!
//! All sides together ([`side`]) are linear equations of the displacements of the corners from a smooth map of the board
//! ([`map`]), with the moments of the polygons at first, and then with those of each polygon conditioned on the other sides, by
//! expectation propagation ([`together`]): where edges are aligned with the pixels no single side determines its place, but all
//! of them together do. Corners of the print are expected where that map has them to within [`PRINT_SQUARES`]: this prior
//! matters only where sides give no information, so that the printed positions are found.
//!
//! Sides that pass at the same place within a pixel are not independent: for a board that is seen straight, with squares of a
//! whole number of pixels, no number of sides determines where in the pixel it is. The part of a pixel that no side passes is
//! added to the covariance of all corners together ([`Phases`]).
//!
//! Corners share the ends of sides, so what is stated is the covariance of all of them.
//!
//! The bound: the mean and the covariance of the distribution that all inequalities and that expectation leave;
//! `docs/maths/hard_edges.md` has how near to it that comes.

mod banded;
mod map;
mod polygon;
mod side;
mod together;

use image::GrayImage;
use nalgebra::{Matrix2, Vector2};

use crate::order::Ordered;
use map::SmoothMap;
use side::{Edge, Passage, Reach, Side};
use together::{Displacements, Expected};

/// Printing error of a corner relative to a smooth map of the board, one standard deviation per axis, in squares: 0.1 mm of
/// 15 mm, which is much for a print.
const PRINT_SQUARES: f64 = 0.007;
/// Part of the pixels next to edges that may be neither dark nor light. Averaging over pixels leaves three in five, a
/// frame buffer none except where a texture is filtered.
const MOST_MIXED: f64 = 0.25;
/// Rows and columns that are checked before an image with softer edges is rejected.
const ENOUGH: usize = 150;
/// Smallest share of a square's sides that must give information.
const LEAST_SIDES: f64 = 0.6;
/// A corner that moves further than this \[px\] was not where the search had it, or its sides are not edges of the
/// board.
const FURTHEST_PX: f64 = 1.5;

/// How far to either side of an edge's expected place pixels are read, as a part of a square and at most in pixels: at first,
/// and when the places of the corners are known to a tenth of a pixel. The smaller, the nearer to its ends an edge can be
/// read.
const REACHES: [Reach; 2] = [Reach { part: 0.3, most_px: 2.0 }, Reach { part: 0.2, most_px: 1.0 }];

/// Rounds in which each polygon is combined with all others. A round solves the equations of all corners once more.
const ROUNDS: usize = 6;

/// The corners of an image with hard edges.
pub(super) struct Refined {
    /// All corners with their covariances.
    pub corners: Ordered,
    /// Which corners have a usable side along rows and one along columns; the others follow from these.
    pub seen: Vec<bool>,
}

/// The corners of an image with hard edges, with their covariances; `None` where edges are softer, or too little of the
/// board is seen: then the result of the search is kept.
pub(super) fn refine(image: &GrayImage, found: &Ordered) -> Option<Refined> {
    let [first, second] = &REACHES;
    let near = Pass::of(image, found, first, 0)?;
    let near = Ordered { points: near.points, ..found.clone() };
    let Pass { points, displacements, open_px2, seen } = Pass::of(image, &near, second, ROUNDS)?;
    let mut covariance_px2 = displacements.covariance_px2();
    // Covariance of all corners together.
    for a in 0..points.len() {
        for b in 0..points.len() {
            let mut shared = covariance_px2.fixed_view_mut::<2, 2>(2 * a, 2 * b);
            shared += open_px2;
        }
    }
    Some(Refined { corners: Ordered::together(points, covariance_px2, found.columns), seen })
}

/// All sides, measured once.
struct Pass {
    points: Vec<Vector2<f64>>,
    displacements: Displacements,
    open_px2: Matrix2<f64>,
    seen: Vec<bool>,
}

impl Pass {
    fn of(image: &GrayImage, found: &Ordered, reach: &Reach, rounds: usize) -> Option<Self> {
        let (columns, rows) = (found.columns, found.rows());
        let map = SmoothMap::of(found, PRINT_SQUARES)?;
        let sides = Side::all(columns, rows);
        let (mut mixed, mut crossings) = (0, 0);
        let mut used = Vec::with_capacity(sides.len());
        for side in &sides {
            let seen = side.seen(image, &map, reach);
            mixed += seen.mixed;
            crossings += seen.passages.len();
            if crossings >= ENOUGH && mixed as f64 > MOST_MIXED * crossings as f64 {
                return None;
            }
            if let Some(edge) = seen.edge {
                used.push((side, edge, seen.passages));
            }
        }
        let is_hard = mixed as f64 <= MOST_MIXED * crossings as f64;
        if !is_hard || (used.len() as f64) < LEAST_SIDES * sides.len() as f64 {
            return None;
        }
        let print_px = PRINT_SQUARES * map.square_px();
        let edges = used.iter().map(|(side, edge, _)| (side.ends.map(|end| end.corner), edge));
        let expected = Expected { smooth: map.smooth_displacements(), print_px, columns };
        let displacements = together::displacements(edges, &expected, rounds)?;
        let moved = displacements.moved();
        if moved.iter().any(|by| by.norm() > FURTHEST_PX) {
            return None;
        }
        let mut phases = Phases::default();
        for (side, edge, passages) in &used {
            if let [Some(a), Some(b)] = side.ends.map(|end| end.corner) {
                phases.add(edge, passages, [a, b].map(|corner| edge.normal.dot(&moved[corner])));
            }
        }
        let mut seen = vec![[false; 2]; moved.len()];
        for (side, ..) in displacements.kept.iter().map(|number| &used[*number]) {
            for corner in side.ends.iter().filter_map(|end| end.corner) {
                seen[corner][usize::from(side.is_along_rows())] = true;
            }
        }
        let place =
            |(index, by): (usize, &Vector2<f64>)| map.at((index % columns) as f64, (index / columns) as f64) + by;
        Some(Self {
            points: moved.iter().enumerate().map(place).collect(),
            displacements,
            open_px2: phases.open_px2(),
            seen: seen.into_iter().map(|along| along == [true; 2]).collect(),
        })
    }
}

/// Places within a pixel at which edges pass, −½ to ½, for those that run across rows and those that run across
/// columns.
#[derive(Default)]
struct Phases([Vec<f64>; 2]);

impl Phases {
    /// Part of the passages at either end of what they cover that may be wrong.
    const WRONG: f64 = 0.02;

    /// The passages of a side with its ends displaced by `[a, b]` pixels along its normal.
    fn add(&mut self, edge: &Edge, passages: &[Passage], [a, b]: [f64; 2]) {
        let across = edge.normal[edge.cross];
        let phase = |passage: &Passage| {
            let moved = ((1.0 - passage.part) * a + passage.part * b) / across;
            moved - 0.5 * (passage.low + passage.high)
        };
        self.0[edge.cross].extend(passages.iter().map(phase));
    }

    /// The variance of a displacement of the whole board that changes no pixel: uniform over what no edge passes.
    fn open_px2(mut self) -> Matrix2<f64> {
        let open = self.0.each_mut().map(|phases| {
            phases.sort_by(f64::total_cmp);
            let cut = (Self::WRONG * phases.len() as f64) as usize;
            let covered = match (phases.get(cut), phases.get(phases.len().saturating_sub(cut + 1))) {
                (Some(first), Some(last)) => last - first,
                _ => 0.0,
            };
            (1.0 - covered / (1.0 - 2.0 * Self::WRONG)).max(0.0).powi(2) / 12.0
        });
        Matrix2::new(open[0], 0.0, 0.0, open[1])
    }
}

#[cfg(test)]
mod tests;
