//! The one order in which the points of a grid are reported, whatever order a detector finds them in.
//!
//! Right-handed in the image: from the camera's side, x turned by a quarter towards y turns clockwise, so x × y
//! points into the board. Of the orders left (two, or four for a square grid) the caller's preference decides, and
//! where that does not, the one whose x axis points most to the right in the image.

use nalgebra::{DMatrix, Matrix2, Vector2};

use handeye_geometry::targets::Grid;
use handeye_geometry::targets::corner_covariance::CornerCovariance;
use handeye_geometry::targets::observation::{Corner, Corners};

/// Points of a grid in one order: `points[row * columns + column]`.
#[derive(Debug, Clone)]
pub(super) struct Ordered {
    pub points: Vec<Vector2<f64>>,
    /// Covariance of each point, squared pixels; `None` where that is not known.
    pub covariances_px2: Vec<Option<Matrix2<f64>>>,
    /// The covariance of x and y of each point in turn, where they do not err independently.
    pub together_px2: Option<DMatrix<f64>>,
    pub columns: usize,
}

impl Ordered {
    pub fn new(points: Vec<Vector2<f64>>, grid: &Grid) -> Self {
        Self { covariances_px2: vec![None; points.len()], together_px2: None, points, columns: grid.columns }
    }

    /// Points whose errors are correlated.
    pub fn together(points: Vec<Vector2<f64>>, covariance_px2: DMatrix<f64>, columns: usize) -> Self {
        let own = |i| {
            let block: Matrix2<f64> = covariance_px2.fixed_view::<2, 2>(2 * i, 2 * i).into_owned();
            Some(0.5 * (block + block.transpose()))
        };
        Self {
            covariances_px2: (0..points.len()).map(own).collect(),
            together_px2: Some(covariance_px2),
            points,
            columns,
        }
    }

    /// As the points of a target, numbered in this order.
    pub fn corners(&self) -> Corners {
        let all = self.points.iter().zip(&self.covariances_px2).enumerate();
        let corners = all.map(|(index, (&px, &covariance_px2))| Corner { index, px, covariance_px2 }).collect();
        Corners::together(corners, self.together_px2.as_ref().and_then(CornerCovariance::new))
    }

    /// The points in another order: `place` gives the source of each.
    fn rearranged(&self, columns: usize, place: impl Iterator<Item = usize> + Clone) -> Self {
        let together = |all: &DMatrix<f64>| {
            let numbers: Vec<usize> = place.clone().flat_map(|i| [2 * i, 2 * i + 1]).collect();
            all.select_rows(&numbers).select_columns(&numbers)
        };
        Self {
            points: place.clone().map(|i| self.points[i]).collect(),
            together_px2: self.together_px2.as_ref().map(together),
            covariances_px2: place.map(|i| self.covariances_px2[i]).collect(),
            columns,
        }
    }

    pub fn rows(&self) -> usize {
        self.points.len() / self.columns
    }

    pub fn at(&self, column: usize, row: usize) -> Vector2<f64> {
        self.points[row * self.columns + column]
    }

    /// Corners of a cell in the order (0, 0), (1, 0), (1, 1), (0, 1).
    pub fn cell(&self, column: usize, row: usize) -> [Vector2<f64>; 4] {
        [self.at(column, row), self.at(column + 1, row), self.at(column + 1, row + 1), self.at(column, row + 1)]
    }

    /// Where the diagonals of a cell cross: the image of its centre under any perspective.
    ///
    /// Parallel diagonals cannot be the image of a square; then the mean of the corners is used.
    pub fn cell_centre(&self, column: usize, row: usize) -> Vector2<f64> {
        let [a, b, c, d] = self.cell(column, row);
        let (p, q) = (c - a, d - b);
        let cross = p.perp(&q);
        if cross.abs() < 1e-9 { (a + b + c + d) / 4.0 } else { a + p * ((b - a).perp(&q) / cross) }
    }

    /// Smallest distance from a point to its neighbours in the grid.
    pub fn spacing(&self, column: usize, row: usize) -> f64 {
        self.neighbours(column, row).map(|n| (n - self.at(column, row)).norm()).fold(f64::INFINITY, f64::min)
    }

    fn neighbours(&self, column: usize, row: usize) -> impl Iterator<Item = Vector2<f64>> + '_ {
        let (c, r) = (column as isize, row as isize);
        [(c - 1, r), (c + 1, r), (c, r - 1), (c, r + 1)].into_iter().filter_map(|(c, r)| {
            let inside = c >= 0 && r >= 0 && (c as usize) < self.columns && (r as usize) < self.rows();
            inside.then(|| self.at(c as usize, r as usize))
        })
    }

    /// Direction and length of one step along x and along y at a point, by central differences where possible.
    pub fn steps(&self, column: usize, row: usize) -> (Vector2<f64>, Vector2<f64>) {
        let span = |i: usize, n: usize| (i.saturating_sub(1), (i + 1).min(n - 1));
        let (c0, c1) = span(column, self.columns);
        let (r0, r1) = span(row, self.rows());
        (
            (self.at(c1, row) - self.at(c0, row)) / (c1 - c0) as f64,
            (self.at(column, r1) - self.at(column, r0)) / (r1 - r0) as f64,
        )
    }

    /// Whether every cell is a convex quadrilateral and all turn the same way: what the image of a flat grid is.
    pub fn is_regular(&self) -> bool {
        let mut turns = 0i64;
        let mut cells = 0i64;
        for row in 0..self.rows() - 1 {
            for column in 0..self.columns - 1 {
                let q = self.cell(column, row);
                let turn = |i: usize| (q[(i + 1) % 4] - q[i]).perp(&(q[(i + 2) % 4] - q[(i + 1) % 4]));
                let positive = (0..4).filter(|&i| turn(i) > 0.0).count();
                cells += 1;
                turns += match positive {
                    4 => 1,
                    0 => -1,
                    _ => return false,
                };
            }
        }
        turns.abs() == cells
    }

    /// Whether every point lies near the middle of its two neighbours along either axis: at most `max_bend` of their
    /// distance away. A grid of stray points fails this.
    pub fn is_smooth(&self, max_bend: f64) -> bool {
        let straight =
            |a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>| (b - (a + c) / 2.0).norm() <= max_bend * (c - a).norm();
        let (columns, rows) = (self.columns, self.rows());
        let along_x =
            (0..rows).all(|r| (1..columns - 1).all(|c| straight(self.at(c - 1, r), self.at(c, r), self.at(c + 1, r))));
        let along_y =
            (0..columns).all(|c| (1..rows - 1).all(|r| straight(self.at(c, r - 1), self.at(c, r), self.at(c, r + 1))));
        along_x && along_y
    }

    fn mirrored(&self) -> Self {
        let columns = self.columns;
        let place = (0..self.points.len()).map(|i| i / columns * columns + columns - 1 - i % columns);
        self.rearranged(columns, place)
    }

    fn half_turn(&self) -> Self {
        self.rearranged(self.columns, (0..self.points.len()).rev())
    }

    fn transposed(&self) -> Self {
        let (columns, rows) = (self.columns, self.rows());
        self.rearranged(rows, (0..self.points.len()).map(|i| i % rows * columns + i / rows))
    }

    /// Twice the area that the cells span, positive for a right-handed order.
    fn area(&self) -> f64 {
        let (c, r) = (self.columns - 1, self.rows() - 1);
        (self.at(c, r) - self.at(0, 0)).perp(&(self.at(0, r) - self.at(c, 0)))
    }

    fn x_points_right(&self) -> f64 {
        let x: Vector2<f64> = (0..self.rows()).map(|row| self.at(self.columns - 1, row) - self.at(0, row)).sum();
        x.x / x.norm()
    }
}

/// The right-handed order for which `preference` is highest; among equals the one whose x axis points most to the
/// right in the image.
pub(super) fn canonical<P: PartialOrd>(found: &Ordered, grid: &Grid, preference: impl Fn(&Ordered) -> P) -> Ordered {
    let right_handed = |order: Ordered| if order.area() < 0.0 { order.mirrored() } else { order };
    let first = right_handed(found.clone());
    let mut best = first.clone();
    let mut candidates = vec![first.half_turn()];
    if grid.columns == grid.rows {
        let turned = right_handed(found.transposed());
        candidates.push(turned.half_turn());
        candidates.push(turned);
    }
    for candidate in candidates {
        let (new, old) = (preference(&candidate), preference(&best));
        if new > old || (new == old && candidate.x_points_right() > best.x_points_right()) {
            best = candidate;
        }
    }
    best
}
