//! Calibration targets: what is printed, and where its points are.

pub mod bent;
pub mod corner_covariance;
pub mod depth_plane;
mod dictionary;
pub mod observation;
mod tags;

use std::fmt;

use nalgebra::{Point3, Vector2};
use serde::{Deserialize, Serialize};

use handeye_wording::Text;
use handeye_wording::text;

pub use dictionary::{Dictionary, UnknownDictionary};
pub use tags::{AprilGrid, AprilTag, Charuco, IdOrder, Layout};

/// A printed target. Its points lie in the plane z = 0 of the target frame (x along columns, y along rows, z into
/// the board), and are numbered row by row: point `row * columns + column` of [`TargetSpec::grid`].
///
/// [`TargetSpec::points`] defines the numbering. Not every lattice of points is evenly spaced: only
/// [`TargetSpec::point`] gives the place of a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum TargetSpec {
    /// A chessboard, described by its inner corners. The square between the corners (0, 0), (1, 0), (0, 1) and (1, 1)
    /// is dark; this distinguishes the two ends of a board.
    Chessboard(Grid),
    /// A symmetric grid of dots, described by their centres. A larger dot, where there is one, is the origin.
    Circles(Grid),
    /// A grid of dots whose odd rows are shifted by half the distance of the dots in a row, as in OpenCV: dot (column,
    /// row) is at `((2 column + row mod 2) square_m, row square_m)`.
    AsymmetricCircles(Grid),
    /// A chessboard with markers in its light squares, described by its inner corners.
    Charuco(Charuco),
    /// Rows of square tags; its points are the four corners of every tag.
    #[serde(rename = "aprilgrid")]
    AprilGrid(AprilGrid),
    /// One square tag; its points are its four corners.
    #[serde(rename = "apriltag")]
    AprilTag(AprilTag),
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

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point `index` of an evenly spaced grid in the target frame, metres.
    pub fn point(&self, index: usize) -> Point3<f64> {
        let (row, column) = (index / self.columns, index % self.columns);
        Point3::new(column as f64 * self.square_m, row as f64 * self.square_m, 0.0)
    }
}

/// A number of a target that is not valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[error("{key} = {value} is not usable: it must be {want}")]
pub struct BadTarget {
    /// Its name in a data set.
    pub key: &'static str,
    /// The number as stated.
    pub value: String,
    /// The values allowed.
    pub want: &'static str,
}

/// Most points along a side of a target; ten times the largest printed boards, and small enough to allocate.
const MOST_POINTS: usize = 1000;

impl TargetSpec {
    /// The lattice of its points: their numbers along x and y. Point `row * columns + column` is at that place of the
    /// lattice, both in the drawing and in a table of corners.
    ///
    /// The lattice of a chessboard, a `ChArUco` board, a symmetric grid of dots and a single tag is evenly spaced by
    /// `square_m`. That of tags is not, nor are the rows of asymmetric dots aligned: there `square_m` is a typical
    /// distance, good for the length of a drawn arrow.
    pub fn grid(&self) -> Grid {
        match self {
            Self::Chessboard(grid) | Self::Circles(grid) | Self::AsymmetricCircles(grid) => *grid,
            Self::Charuco(board) => board.grid(),
            Self::AprilGrid(board) => board.grid(),
            Self::AprilTag(tag) => tag.alone().grid(),
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.grid().len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point `index` in the target frame, metres.
    pub fn point(&self, index: usize) -> Point3<f64> {
        match self {
            Self::Chessboard(grid) | Self::Circles(grid) => grid.point(index),
            Self::AsymmetricCircles(grid) => {
                let (row, column) = (index / grid.columns, index % grid.columns);
                Point3::new((2 * column + row % 2) as f64 * grid.square_m, row as f64 * grid.square_m, 0.0)
            }
            Self::Charuco(board) => board.grid().point(index),
            Self::AprilGrid(board) => board.point(index),
            Self::AprilTag(tag) => tag.alone().point(index),
        }
    }

    /// All points in the target frame, metres.
    pub fn points(&self) -> Vec<Point3<f64>> {
        (0..self.len()).map(|i| self.point(i)).collect()
    }

    /// The corner of the points' extent opposite to the origin, metres.
    pub fn extent(&self) -> Vector2<f64> {
        let grid = self.grid();
        let Some(last) = grid.len().checked_sub(1) else { return Vector2::zeros() };
        let far = self.point(last).coords.xy();
        match self {
            // The shifted rows extend furthest.
            Self::AsymmetricCircles(grid) if grid.rows > 1 => {
                Vector2::new((2 * grid.columns - 1) as f64 * grid.square_m, far.y)
            }
            _ => far,
        }
    }

    /// Middle of the points in the target frame, metres.
    pub fn centre(&self) -> Point3<f64> {
        let half = self.extent() / 2.0;
        Point3::new(half.x, half.y, 0.0)
    }

    /// Places all over the extent of its points, in its plane, on a lattice of cells of equal size.
    pub fn places_all_over(&self) -> Vec<Point3<f64>> {
        const ALONG: [usize; 2] = [48, 32];
        let extent = self.extent();
        let [columns, rows] = if extent.x >= extent.y { ALONG } else { [ALONG[1], ALONG[0]] };
        let at = |length: f64, i: usize, n: usize| length * (i as f64 + 0.5) / n as f64;
        let place =
            |row: usize, column: usize| Point3::new(at(extent.x, column, columns), at(extent.y, row, rows), 0.0);
        (0..rows).flat_map(|row| (0..columns).map(move |column| place(row, column))).collect()
    }

    /// Whether the printed pattern looks the same after a turn, so that no detector can distinguish its ends.
    pub fn is_symmetric(&self) -> bool {
        !self.quarter_turns().is_empty()
    }

    /// Numbers of quarter turns about its middle after which the printed pattern looks the same.
    ///
    /// A chessboard does after half a turn when the sum of its inner corners per row and column is even (9×7), and does not when it
    /// is odd (9×6, 10×7); one that has as many rows as columns, an even number (8×8), after a quarter, too. A plain grid of dots
    /// does after half a turn, a square one after a quarter; a shifted one after half a turn when its rows are even in number.
    /// Markers never do.
    pub fn quarter_turns(&self) -> &'static [usize] {
        let half: &[usize] = &[2];
        let every: &[usize] = &[1, 2, 3];
        match self {
            Self::Chessboard(grid) if grid.columns == grid.rows && grid.rows.is_multiple_of(2) => every,
            Self::Chessboard(grid) if (grid.columns + grid.rows).is_multiple_of(2) => half,
            Self::Circles(grid) if grid.columns == grid.rows => every,
            Self::Circles(_) => half,
            Self::AsymmetricCircles(grid) if grid.rows.is_multiple_of(2) => half,
            Self::Chessboard(_)
            | Self::AsymmetricCircles(_)
            | Self::Charuco(_)
            | Self::AprilGrid(_)
            | Self::AprilTag(_) => &[],
        }
    }

    /// The number that a point has when the target is numbered from another corner, this many of its [`Self::quarter_turns`]
    /// away.
    pub fn renumbered(&self, index: usize, quarter_turns: usize) -> usize {
        let Grid { columns, rows, .. } = self.grid();
        let (column, row) = (index % columns, index / columns);
        match quarter_turns % 4 {
            0 => index,
            1 => (rows - 1 - column) * columns + row,
            2 => self.len() - 1 - index,
            _ => column * columns + (columns - 1 - row),
        }
    }

    /// Checks what the types do not ensure.
    ///
    /// # Errors
    /// [`BadTarget`] with the first number that is out of range.
    pub fn check(&self) -> Result<(), BadTarget> {
        match self {
            Self::Chessboard(grid) | Self::Circles(grid) | Self::AsymmetricCircles(grid) => {
                let want = "a whole number of points from 3 to 1000 (a chessboard counts inner corners)";
                count("columns", grid.columns, 3, want)?;
                count("rows", grid.rows, 3, want)?;
                length("square_m", grid.square_m)
            }
            Self::Charuco(board) => board.check(),
            Self::AprilGrid(board) => board.check(),
            Self::AprilTag(tag) => tag.alone().check_with_id("id"),
        }
    }

    /// Name of its kind in a data set.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Chessboard(_) => "chessboard",
            Self::Circles(_) => "circles",
            Self::AsymmetricCircles(_) => "asymmetric_circles",
            Self::Charuco(_) => "charuco",
            Self::AprilGrid(_) => "aprilgrid",
            Self::AprilTag(_) => "apriltag",
        }
    }
}

fn count(key: &'static str, value: usize, least: usize, want: &'static str) -> Result<(), BadTarget> {
    if (least..=MOST_POINTS).contains(&value) {
        return Ok(());
    }
    Err(BadTarget { key, value: value.to_string(), want })
}

fn length(key: &'static str, value: f64) -> Result<(), BadTarget> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(BadTarget { key, value: value.to_string(), want: "a positive length in metres" })
}

impl TargetSpec {
    /// Description of the target, with its sizes.
    pub fn text(&self) -> Text {
        let Grid { columns, rows, square_m } = self.grid();
        let reported = match self {
            Self::Chessboard(_) => text!("chessboard of {columns}×{rows} inner corners, {mm} mm apart"),
            Self::Circles(_) => text!("circle grid of {columns}×{rows} dots, {mm} mm apart"),
            Self::AsymmetricCircles(_) => text!("asymmetric circle grid of {columns}×{rows} dots, rows {mm} mm apart"),
            Self::Charuco(board) => return board.text(),
            Self::AprilGrid(board) => return board.text(),
            Self::AprilTag(tag) => return tag.text(),
        };
        reported.with("columns", columns).with("rows", rows).with("mm", mm(square_m))
    }
}

impl fmt::Display for TargetSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.text().fmt(f)
    }
}

/// Millimetres without the digits due to binary rounding.
fn mm(metres: f64) -> f64 {
    (metres * 1e9).round() / 1e6
}

#[cfg(test)]
mod tests;
