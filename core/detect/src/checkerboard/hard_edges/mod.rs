//! Corners of images without anti-aliasing, from all sides of all squares at once.
//!
//! A frame buffer with one sample a pixel, as CoppeliaSim's vision sensors have it, knows of an edge only between which two
//! pixel centres of a row or a column it passes. That is a uniform error of one pixel, and no noise: it repeats as long as
//! nothing moves. Least squares on grey levels ([`super::search`]) take it for noise and end 0.07–0.25 px off. But along its
//! length an edge passes at many places within a pixel, and each row says *between these two*: of the places of both ends of a
//! side of a square the rows leave a small polygon ([`polygon`]). Its centroid and its second moments are what is known of the
//! side, and where an edge runs along a row they say that its place within the pixel is not known.
//!
//! All sides together ([`side`]) are linear equations of the displacements of the corners from a smooth map of the board
//! ([`map`]), with the moments of the polygons at first, and then with those of what the other sides leave of each polygon, by
//! expectation propagation ([`together`]): where edges are aligned with the pixels no side knows its place, and all of them do.
//! Of the print it is expected that corners are where that map has them to within [`PRINT_SQUARES`]: it counts where
//! sides say nothing, and otherwise not, so that what is printed is what is found.
//!
//! Sides that pass at the same place within a pixel say the same, and not each something of its own: of a board that is seen
//! straight, with squares of a whole number of pixels, no number of sides tells where in the pixel it is. What part of a pixel
//! no side passes is left open in the covariance of all corners together ([`Phases`]).
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

/// How far a corner may be printed from where a smooth map of the board has it, one standard deviation per axis, in squares:
/// 0.1 mm of 15 mm, which is much for a print.
const PRINT_SQUARES: f64 = 0.007;
/// Part of the pixels beside edges that may be neither dark nor light. Averaging over pixels leaves three in five, a frame
/// buffer none but where a texture is filtered.
const MOST_MIXED: f64 = 0.25;
/// Rows and columns that are looked at before an image with softer edges is given back.
const ENOUGH: usize = 150;
/// Least part of the sides of squares that must say something.
const LEAST_SIDES: f64 = 0.6;
/// A corner that moves further than this \[px\] was not where the search had it, or its sides are no edges of the board.
const FURTHEST_PX: f64 = 1.5;

/// How far to either side of where an edge is expected pixels are looked at, as a part of a square and in pixels at the most:
/// at first, and when the places of the corners are known to a tenth of a pixel. The less, the nearer to its ends an edge can
/// be looked at.
const REACHES: [Reach; 2] = [Reach { part: 0.3, most_px: 2.0 }, Reach { part: 0.2, most_px: 1.0 }];

/// Rounds in which each polygon is seen in the light of all others. A round solves the equations of all corners once more.
const ROUNDS: usize = 6;

/// The corners of an image with hard edges.
pub(super) struct Refined {
    /// All corners with their covariances.
    pub corners: Ordered,
    /// Which of them have a side along rows and one along columns that counts; the others are where those have them.
    pub seen: Vec<bool>,
}

/// The corners of an image with hard edges, with their covariances; `None` where edges are softer, or the board is not seen
/// whole enough: then what the search found stands.
pub(super) fn refine(image: &GrayImage, found: &Ordered) -> Option<Refined> {
    let [first, second] = &REACHES;
    let near = Pass::of(image, found, first, 0)?;
    let near = Ordered { points: near.points, ..found.clone() };
    let Pass { points, displacements, open_px2, seen } = Pass::of(image, &near, second, ROUNDS)?;
    let mut covariance_px2 = displacements.covariance_px2();
    // Of all corners together.
    for a in 0..points.len() {
        for b in 0..points.len() {
            let mut shared = covariance_px2.fixed_view_mut::<2, 2>(2 * a, 2 * b);
            shared += open_px2;
        }
    }
    Some(Refined { corners: Ordered::together(points, covariance_px2, found.columns), seen })
}

/// All sides looked at once.
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

/// Where within a pixel edges pass, −½ to ½, for those that run across rows and those that run across columns.
#[derive(Default)]
struct Phases([Vec<f64>; 2]);

impl Phases {
    /// Part of the passages at either end of what they cover that may be wrong.
    const WRONG: f64 = 0.02;

    /// The passages of a side with its ends displaced by so many pixels along its normal.
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
