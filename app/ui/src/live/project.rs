//! Lines in space as lines in the image, curved where the lens bends them.

use egui::{Pos2, Vec2};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::targets::TargetSpec;
use nalgebra::Point3;

use crate::live::place::Place;

/// Pieces into which a line of the length of a board is divided.
const PIECES: usize = 12;
/// A point that is this many images away from the centre is not on the screen, and its place means little.
const FARTHEST: f64 = 3.0;

/// What is needed to draw things of the board.
pub struct Projector<'a> {
    /// The camera.
    pub intrinsics: &'a Intrinsics,
    /// The board.
    pub camera_from_target: Pose<Camera, Target>,
    /// The image on the screen.
    pub place: &'a Place,
}

impl Projector<'_> {
    /// A point of the board on the screen; `None` behind the camera and far outside of the image.
    pub fn point(&self, in_target: &Point3<f64>) -> Option<Pos2> {
        let px = self.intrinsics.project(&(self.camera_from_target.isometry() * in_target)).ok()?;
        let (width, height) = (f64::from(self.intrinsics.width), f64::from(self.intrinsics.height));
        let is_near = |at: f64, size: f64| at.is_finite() && (at - size / 2.0).abs() < FARTHEST * size;
        if !(is_near(px.x, width) && is_near(px.y, height)) {
            return None;
        }
        Some(self.place.screen(Vec2::new(px.x as f32, px.y as f32)))
    }

    /// A straight line of the board: the pieces of it that can be seen.
    pub fn line(&self, from: &Point3<f64>, to: &Point3<f64>) -> Vec<Vec<Pos2>> {
        let mut pieces = vec![Vec::new()];
        for step in 0..=PIECES {
            let part = step as f64 / PIECES as f64;
            match self.point(&(from + (to - from) * part)) {
                Some(at) => pieces.last_mut().into_iter().for_each(|piece| piece.push(at)),
                None => pieces.push(Vec::new()),
            }
        }
        pieces.retain(|piece| piece.len() > 1);
        pieces
    }
}

/// A straight line of the board.
pub type BoardLine = [Point3<f64>; 2];

pub struct BoardLines {
    pub around: Vec<BoardLine>,
    /// Through its points.
    pub inside: Vec<BoardLine>,
}

pub fn board_lines(target: &TargetSpec) -> BoardLines {
    let grid = target.grid();
    let side = grid.square_m;
    let point = |column: usize, row: usize| target.point(row * grid.columns + column);
    let (last_column, last_row) = (grid.columns.saturating_sub(1), grid.rows.saturating_sub(1));
    // A chessboard has one more row of squares around its inner corners.
    let far = target.extent().add_scalar(side);
    let corners = [[-side, -side], [far.x, -side], [far.x, far.y], [-side, far.y]].map(|[x, y]| Point3::new(x, y, 0.0));
    let around = (0..4).map(|i| [corners[i], corners[(i + 1) % 4]]).collect();
    let rows = (0..grid.rows).map(|row| [point(0, row), point(last_column, row)]);
    let columns = (0..grid.columns).map(|column| [point(column, 0), point(column, last_row)]);
    BoardLines { around, inside: rows.chain(columns).collect() }
}
