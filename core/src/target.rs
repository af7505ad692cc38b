//! Calibration targets: what is printed, and where its points are.

use std::fmt;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

/// A printed target. Its points lie in the plane z = 0 of the target frame (x along columns, y along rows, z into
/// the board), row by row from the origin: point `row * columns + column`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum TargetSpec {
    /// A chessboard, described by its inner corners. The square between the corners (0, 0), (1, 0), (0, 1) and (1, 1)
    /// is dark; this is what tells the two ends of a board apart.
    Chessboard(Grid),
    /// A symmetric grid of dots, described by their centres. A larger dot, where there is one, is the origin.
    Circles(Grid),
}

/// A rectangular grid of points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Points along x.
    pub columns: usize,
    /// Points along y.
    pub rows: usize,
    /// Distance between neighbours in metres.
    pub square_m: f64,
}

impl Grid {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Whether there is no point at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point `index` in the target frame, metres.
    pub fn point(&self, index: usize) -> Point3<f64> {
        let (row, column) = (index / self.columns, index % self.columns);
        Point3::new(column as f64 * self.square_m, row as f64 * self.square_m, 0.0)
    }
}

impl TargetSpec {
    /// The grid that its points form.
    pub fn grid(&self) -> &Grid {
        match self {
            Self::Chessboard(grid) | Self::Circles(grid) => grid,
        }
    }

    /// All points in the target frame, metres.
    pub fn points(&self) -> Vec<Point3<f64>> {
        let grid = self.grid();
        (0..grid.len()).map(|i| grid.point(i)).collect()
    }

    /// Middle of the points in the target frame, metres.
    pub fn centre(&self) -> Point3<f64> {
        let grid = self.grid();
        let half = |n: usize| (n as f64 - 1.0) / 2.0 * grid.square_m;
        Point3::new(half(grid.columns), half(grid.rows), 0.0)
    }

    /// Whether the printed pattern looks the same after half a turn, so that no detector can tell its ends apart.
    ///
    /// A chessboard does when the sum of its inner corners per row and column is even (9×7), and does not when it is
    /// odd (9×6, 10×7). A plain grid of dots always does.
    pub fn is_symmetric(&self) -> bool {
        match self {
            Self::Chessboard(grid) => (grid.columns + grid.rows) % 2 == 0,
            Self::Circles(_) => true,
        }
    }
}

impl fmt::Display for TargetSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, what) = match self {
            Self::Chessboard(_) => ("chessboard", "inner corners"),
            Self::Circles(_) => ("circle grid", "dots"),
        };
        let grid = self.grid();
        write!(f, "{kind} of {}×{} {what}, {} mm apart", grid.columns, grid.rows, grid.square_m * 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_run_row_by_row() {
        let target = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });
        let points = target.points();
        assert_eq!(points.len(), 70);
        assert_eq!(points[0], Point3::origin());
        assert_eq!(points[1], Point3::new(0.015, 0.0, 0.0));
        assert_eq!(points[10], Point3::new(0.0, 0.015, 0.0));
        assert!((target.centre() - Point3::new(0.0675, 0.045, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn only_boards_of_odd_sum_have_two_different_ends() {
        let board = |columns, rows| TargetSpec::Chessboard(Grid { columns, rows, square_m: 0.01 });
        assert!(!board(10, 7).is_symmetric());
        assert!(!board(9, 6).is_symmetric());
        assert!(board(9, 7).is_symmetric());
        assert!(board(8, 8).is_symmetric());
    }
}
