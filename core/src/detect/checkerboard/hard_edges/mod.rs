//! Corners of images without anti-aliasing, from all sides of all squares at once.
//!
//! A frame buffer with one sample a pixel, as CoppeliaSim's vision sensors have it, knows of an edge only between which two
//! pixel centres of a row or a column it passes. That is a uniform error of one pixel, and no noise: it repeats as long as
//! nothing moves. Least squares on grey levels ([`super::search`]) take it for noise and end 0.15–0.25 px off. But along its
//! length an edge passes at many places within a pixel, and each row says *between these two*: of the places of both ends of a
//! side of a square the rows leave a small polygon ([`polygon`]). Its centroid and its second moments are what is known of the
//! side, and where an edge runs along a row they say that its place within the pixel is not known.
//!
//! All sides together ([`side`]) are linear equations of the displacements of the corners from a smooth map of the board
//! ([`map`]). Of the print it is expected that corners are where that map has them to within [`PRINT_SQUARES`]: it counts where
//! sides say nothing, and otherwise not, so that what is printed is what is found.
//!
//! Sides that pass at the same place within a pixel say the same, and not each something of its own: of a board that is seen
//! straight, with squares of a whole number of pixels, no number of sides tells where in the pixel it is. What part of a pixel
//! no side passes is left open in the covariance of every corner ([`Phases`]).
//!
//! The bound: the mean and the covariance of the distribution that all inequalities and that expectation leave. Sides are
//! combined here as if their polygons were Gaussian; `docs/maths/hard_edges.md` has how near to the bound that comes.

mod map;
mod polygon;
mod side;

use image::GrayImage;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::detect::order::Ordered;
use map::SmoothMap;
use polygon::Moments;
use side::{Passage, Reach, Side};

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

/// The corners of an image with hard edges, with their covariances; `None` where edges are softer, or the board is not seen
/// whole enough: then what the search found stands.
pub(super) fn refine(image: &GrayImage, found: &Ordered) -> Option<Ordered> {
    let [first, second] = &REACHES;
    let near = refined(image, found, first)?;
    refined(image, &near, second)
}

fn refined(image: &GrayImage, found: &Ordered, reach: &Reach) -> Option<Ordered> {
    let (columns, rows) = (found.columns, found.rows());
    let map = SmoothMap::of(found)?;
    let sides = Side::all(columns, rows);
    let (mut mixed, mut crossings) = (0, 0);
    let mut equations = Equations::new(columns * rows);
    let mut used = Vec::with_capacity(sides.len());
    for side in &sides {
        let seen = side.seen(image, &map, reach);
        mixed += seen.mixed;
        crossings += seen.passages.len();
        if crossings >= ENOUGH && mixed as f64 > MOST_MIXED * crossings as f64 {
            return None;
        }
        if let Some(edge) = seen.edge {
            equations.add(side, &edge);
            used.push((side, edge, seen.passages));
        }
    }
    let is_hard = mixed as f64 <= MOST_MIXED * crossings as f64;
    if !is_hard || (used.len() as f64) < LEAST_SIDES * sides.len() as f64 {
        return None;
    }
    equations.expect(&map);
    let (moved, covariances_px2) = equations.solved()?;
    if moved.iter().any(|by| by.norm() > FURTHEST_PX) {
        return None;
    }
    let mut phases = Phases::default();
    for (side, edge, passages) in &used {
        if let [Some(a), Some(b)] = side.ends.map(|end| end.corner) {
            phases.add(edge, passages, [a, b].map(|corner| edge.normal.dot(&moved[corner])));
        }
    }
    let open_px2 = phases.open_px2();
    let place = |(index, by): (usize, &Vector2<f64>)| map.at((index % columns) as f64, (index / columns) as f64) + by;
    Some(Ordered {
        points: moved.iter().enumerate().map(place).collect(),
        covariances_px2: covariances_px2.into_iter().map(|covariance| Some(covariance + open_px2)).collect(),
        columns,
    })
}

/// Where within a pixel edges pass, −½ to ½, for those that run across rows and those that run across columns.
#[derive(Default)]
struct Phases([Vec<f64>; 2]);

impl Phases {
    /// Part of the passages at either end of what they cover that may be wrong.
    const WRONG: f64 = 0.02;

    /// The passages of a side with its ends displaced by so many pixels along its normal.
    fn add(&mut self, edge: &Moments, passages: &[Passage], [a, b]: [f64; 2]) {
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

/// Normal equations of the displacements of the corners from the map, x and y of each in turn.
struct Equations {
    normal: DMatrix<f64>,
    rhs: DVector<f64>,
}

impl Equations {
    fn new(corners: usize) -> Self {
        Self { normal: DMatrix::zeros(2 * corners, 2 * corners), rhs: DVector::zeros(2 * corners) }
    }

    /// What a side says of the displacements of its ends along its normal. The end on the outline of the print is no
    /// corner, so what is known of it is left out.
    fn add(&mut self, side: &Side, edge: &Moments) {
        let ends = side.ends.map(|end| end.corner);
        let information = match ends {
            [Some(_), Some(_)] => edge.covariance.try_inverse(),
            [Some(_), None] => Some(Matrix2::new(1.0 / edge.covariance.m11, 0.0, 0.0, 0.0)),
            [None, Some(_)] => Some(Matrix2::new(0.0, 0.0, 0.0, 1.0 / edge.covariance.m22)),
            [None, None] => None,
        };
        let Some(information) = information else { return };
        let weighted = information * edge.mean;
        for (a, corner) in ends.iter().enumerate() {
            let Some(corner) = corner else { continue };
            for i in 0..2 {
                self.rhs[2 * corner + i] += edge.normal[i] * weighted[a];
            }
            for (b, other) in ends.iter().enumerate() {
                let Some(other) = other else { continue };
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    self.normal[(2 * corner + i, 2 * other + j)] +=
                        edge.normal[i] * edge.normal[j] * information[(a, b)];
                }
            }
        }
    }

    /// What is expected of the print: independent displacements of the corners, besides any smooth one.
    fn expect(&mut self, map: &SmoothMap) {
        let weight = (PRINT_SQUARES * map.square_px()).powi(-2);
        let basis = map.smooth_displacements();
        let smooth = basis * basis.transpose();
        let corners = smooth.nrows();
        for a in 0..corners {
            for b in 0..corners {
                let of_axis = weight * (f64::from(u8::from(a == b)) - smooth[(a, b)]);
                self.normal[(2 * a, 2 * b)] += of_axis;
                self.normal[(2 * a + 1, 2 * b + 1)] += of_axis;
            }
        }
    }

    /// Displacements and covariances of all corners; `None` when the sides leave something open.
    fn solved(self) -> Option<(Vec<Vector2<f64>>, Vec<Matrix2<f64>>)> {
        let factor = self.normal.cholesky()?;
        let moved = factor.solve(&self.rhs);
        let covariance = factor.inverse();
        let corners = moved.len() / 2;
        let by = |i: usize| Vector2::new(moved[2 * i], moved[2 * i + 1]);
        let of = |i: usize| covariance.fixed_view::<2, 2>(2 * i, 2 * i).into_owned();
        let covariances: Vec<Matrix2<f64>> = (0..corners).map(of).map(|c| 0.5 * (c + c.transpose())).collect();
        let sound = covariances.iter().all(|c| c.iter().all(|v| v.is_finite()) && c.m11 > 0.0 && c.m22 > 0.0);
        sound.then(|| ((0..corners).map(by).collect(), covariances))
    }
}

#[cfg(test)]
mod tests;
