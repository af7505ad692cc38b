//! The black shapes of a target.

use nalgebra::Vector2;

use super::PrintError;
use handeye_detect::markers;
use handeye_geometry::targets::{AprilGrid, Charuco, Dictionary, Grid, Layout, TargetSpec};

/// Radius of a dot as a part of the distance between dots, and that of the larger dot at the origin: both leave as much
/// light between dots as a blurred image needs.
const DOT: f64 = 0.25;
const LARGER_DOT: f64 = 0.375;
/// Radius of a shifted dot as a part of the distance between rows: the nearest dot is 1.41 of it away.
const SHIFTED_DOT: f64 = 0.35;
/// Border of a tag on a board of tags where it is not stated: Kalibr's.
const KALIBR_BORDER: usize = 2;

/// Something black, metres in the target frame (x along columns, y along rows, that is, downwards on paper).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A rectangle with sides along x and y.
    Rectangle {
        /// The corner nearest to the origin.
        corner: Vector2<f64>,
        /// Its extent along x and y.
        size: Vector2<f64>,
    },
    /// A round dot.
    Dot {
        /// Its centre on the sheet, metres.
        centre: Vector2<f64>,
        /// Its radius, metres.
        radius: f64,
    },
}

impl Shape {
    fn square(corner: Vector2<f64>, side: f64) -> Self {
        Self::Rectangle { corner, size: Vector2::repeat(side) }
    }

    /// The corners of its extent.
    pub fn bounds(&self) -> (Vector2<f64>, Vector2<f64>) {
        match self {
            Self::Rectangle { corner, size } => (*corner, corner + size),
            Self::Dot { centre, radius } => (centre.add_scalar(-radius), centre.add_scalar(*radius)),
        }
    }

    /// Whether a point is in it.
    pub fn contains(&self, p: &Vector2<f64>) -> bool {
        match self {
            Self::Rectangle { corner, size } => {
                let q = p - corner;
                q.x >= 0.0 && q.y >= 0.0 && q.x < size.x && q.y < size.y
            }
            Self::Dot { centre, radius } => (p - centre).norm_squared() < radius * radius,
        }
    }
}

/// A target as it is drawn: black on white.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// The black shapes. They touch, and do not overlap.
    pub shapes: Vec<Shape>,
    /// Least white around it in metres.
    pub quiet_m: f64,
}

impl Drawing {
    /// Draws a target. A `ChArUco` board without a stated layout has the new one, a board of tags without a stated border
    /// that of Kalibr. Boards of tags with a border of two bits have Kalibr's squares between the corners of tags.
    ///
    /// # Errors
    /// [`PrintError::BadTarget`], [`PrintError::Markers`].
    pub fn of(target: &TargetSpec) -> Result<Self, PrintError> {
        target.check()?;
        Ok(match target {
            TargetSpec::Chessboard(grid) => {
                let dark = |column: usize, row: usize| (column + row).is_multiple_of(2);
                Self { shapes: squares(grid, dark), quiet_m: grid.square_m / 2.0 }
            }
            TargetSpec::Circles(grid) => {
                let radius = |index| grid.square_m * if index == 0 { LARGER_DOT } else { DOT };
                Self { shapes: dots(target, radius), quiet_m: grid.square_m / 2.0 }
            }
            TargetSpec::AsymmetricCircles(grid) => {
                Self { shapes: dots(target, |_| SHIFTED_DOT * grid.square_m), quiet_m: grid.square_m }
            }
            TargetSpec::Charuco(board) => charuco(board)?,
            TargetSpec::AprilGrid(board) => tags(board)?,
            TargetSpec::AprilTag(tag) => tags(&tag.alone())?,
        })
    }

    /// The corners of the extent of all that is black.
    pub fn bounds(&self) -> (Vector2<f64>, Vector2<f64>) {
        let nothing = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        self.shapes.iter().map(Shape::bounds).fold(nothing, |all, one| (all.0.inf(&one.0), all.1.sup(&one.1)))
    }
}

/// The dark squares around inner corners, by column and row of squares; (0, 0) is at the top left.
fn squares(grid: &Grid, dark: impl Fn(usize, usize) -> bool) -> Vec<Shape> {
    let all = (0..=grid.rows).flat_map(|row| (0..=grid.columns).map(move |column| (column, row)));
    let corner = |column: usize, row: usize| Vector2::new(column as f64 - 1.0, row as f64 - 1.0) * grid.square_m;
    all.filter(|(column, row)| dark(*column, *row))
        .map(|(column, row)| Shape::square(corner(column, row), grid.square_m))
        .collect()
}

fn dots(target: &TargetSpec, radius: impl Fn(usize) -> f64) -> Vec<Shape> {
    let points = target.points().into_iter().enumerate();
    points.map(|(index, p)| Shape::Dot { centre: p.coords.xy(), radius: radius(index) }).collect()
}

fn charuco(board: &Charuco) -> Result<Drawing, PrintError> {
    let layout = board.layout.unwrap_or(Layout::New);
    let mut shapes = squares(&board.grid(), |column, row| board.is_dark(layout, column, row));
    for (id, square) in board.marker_squares(layout).into_iter().enumerate() {
        let [corner, ..] = board.marker_corners(square);
        let cells = cells(board.dictionary, id, 1)?;
        shapes.extend(marker(corner, board.marker_m, &cells));
    }
    Ok(Drawing { shapes, quiet_m: board.square_m / 2.0 })
}

fn tags(board: &AprilGrid) -> Result<Drawing, PrintError> {
    let border_bits = board.border_bits.unwrap_or(KALIBR_BORDER);
    let mut shapes = Vec::new();
    for row in 0..board.rows {
        for column in 0..board.columns {
            let [corner, ..] = board.tag_corners((column, row));
            let mut cells = cells(board.family, board.id_at(column, row), border_bits)?;
            if board.family.is_apriltag() {
                // OpenCV draws the tags of the AprilTag project upside down.
                cells.reverse();
            }
            shapes.extend(marker(corner, board.tag_m, &cells));
        }
    }
    let gap = board.spacing_m;
    if border_bits == KALIBR_BORDER && gap > 0.0 {
        let between = (0..=board.rows).flat_map(|row| (0..=board.columns).map(move |column| (column, row)));
        shapes.extend(between.map(|(column, row)| {
            let at = Vector2::new(column as f64, row as f64) * board.pitch_m();
            Shape::square(at.add_scalar(-gap), gap)
        }));
    }
    let cell = board.tag_m / (board.family.bits() + 2 * border_bits) as f64;
    Ok(Drawing { shapes, quiet_m: cell.max(gap / 2.0) })
}

/// The cells of a marker, row by row, its border included; `true` is black. The codes are in OpenCV.
fn cells(dictionary: Dictionary, id: usize, border_bits: usize) -> Result<Vec<bool>, PrintError> {
    markers::cells(dictionary, id, border_bits).map_err(|e| PrintError::Markers { reason: e.to_string() })
}

/// The black cells of a marker, adjacent ones in a row as one.
fn marker(corner: Vector2<f64>, side: f64, cells: &[bool]) -> Vec<Shape> {
    // Cells are a square.
    let n = (cells.len() as f64).sqrt().round() as usize;
    let cell = side / n as f64;
    let mut shapes = Vec::new();
    for (row, line) in cells.chunks(n).enumerate() {
        let mut column = 0;
        while column < n {
            let run = line[column..].iter().take_while(|black| **black).count();
            if run > 0 {
                let at = corner + Vector2::new(column as f64, row as f64) * cell;
                shapes.push(Shape::Rectangle { corner: at, size: Vector2::new(run as f64 * cell, cell) });
            }
            column += run.max(1);
        }
    }
    shapes
}
