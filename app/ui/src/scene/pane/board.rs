//! Boards in three dimensions.

use egui::{Color32, Stroke};
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::targets::{AprilGrid, Layout, TargetSpec};
use nalgebra::{Point3, Vector2, Vector3};

use super::canvas::Canvas;
use crate::style::theme::Palette;
use handeye_workbench::scene::outline;

/// Corners of a dot of a board of dots.
const DOT_CORNERS: usize = 12;
/// Radius of a dot as part of the distance between neighbours.
const DOT_RADIUS: f64 = 0.25;
/// White around the pattern, as part of a square.
const MARGIN: f64 = 0.6;

/// From the middle of the pattern to beyond its corners \[m\].
fn size_m(target: &TargetSpec) -> f64 {
    let [first, _, third, _] = outline(target, MARGIN);
    0.6 * (third - first).norm()
}

/// The dark parts of the pattern; markers without their codes, which are unreadable at this size.
fn dark(target: &TargetSpec) -> Vec<Vec<Point3<f64>>> {
    let grid = target.grid();
    let side = grid.square_m;
    // One more square on each side than inner corners; the one between the first corners is dark.
    let squares = |is_dark: &dyn Fn(usize, usize) -> bool| -> Vec<Vec<Point3<f64>>> {
        let all = (0..=grid.rows).flat_map(|row| (0..=grid.columns).map(move |column| (column, row)));
        all.filter(|(column, row)| is_dark(*column, *row))
            .map(|(column, row)| {
                let corner = |x: usize, y: usize| {
                    Point3::new((column + x) as f64 * side - side, (row + y) as f64 * side - side, 0.0)
                };
                vec![corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
            })
            .collect()
    };
    let flat = |corners: [Vector2<f64>; 4]| corners.map(|c| Point3::new(c.x, c.y, 0.0)).to_vec();
    match target {
        TargetSpec::Chessboard(_) => squares(&|column, row| (column + row) % 2 == 0),
        TargetSpec::Charuco(board) => {
            let layout = board.layout.unwrap_or(Layout::New);
            let mut all = squares(&|column, row| board.is_dark(layout, column, row));
            all.extend(board.marker_squares(layout).into_iter().map(|square| flat(board.marker_corners(square))));
            all
        }
        TargetSpec::AprilGrid(board) => tags(board).into_iter().map(flat).collect(),
        TargetSpec::AprilTag(tag) => tags(&tag.alone()).into_iter().map(flat).collect(),
        TargetSpec::Circles(_) | TargetSpec::AsymmetricCircles(_) => {
            let around = |centre: Point3<f64>| {
                let corner = |i: usize| {
                    let (sin, cos) = (i as f64 / DOT_CORNERS as f64 * std::f64::consts::TAU).sin_cos();
                    centre + Vector3::new(cos, sin, 0.0) * (DOT_RADIUS * side)
                };
                (0..DOT_CORNERS).map(corner).collect()
            };
            target.points().into_iter().map(around).collect()
        }
    }
}

fn tags(board: &AprilGrid) -> Vec<[Vector2<f64>; 4]> {
    let places = (0..board.rows).flat_map(|row| (0..board.columns).map(move |column| (column, row)));
    places.map(|place| board.tag_corners(place)).collect()
}

/// The board with its pattern; from behind, a plain sheet.
pub fn printed(canvas: &mut Canvas, base_from_target: &Pose<Base, Target>, target: &TargetSpec, palette: &Palette) {
    let place = |corners: &[Point3<f64>]| -> Vec<Point3<f64>> {
        corners.iter().map(|corner| base_from_target.isometry() * corner).collect()
    };
    let sheet = place(&outline(target, MARGIN));
    // z goes into the board.
    let towards_viewer = base_from_target.rotation() * -Vector3::z();
    if canvas.eye.faces(&sheet[0], &towards_viewer) {
        let pattern = dark(target).into_iter().map(|corners| (place(&corners), palette.ink));
        canvas.faces(std::iter::once((sheet.clone(), palette.paper)).chain(pattern));
    } else {
        canvas.faces([(sheet.clone(), palette.paper.lerp_to_gamma(palette.ink, 0.3))]);
    }
    for index in 0..4 {
        let ends = [sheet[index], sheet[(index + 1) % 4]];
        canvas.line_on_face(ends, Stroke::new(1.0, palette.weak), false, size_m(target));
    }
}

/// How an outline is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// Continuous.
    Solid,
    Dashed,
}

/// The outline of the pattern only.
pub fn outlined(
    canvas: &mut Canvas,
    base_from_target: &Pose<Base, Target>,
    target: &TargetSpec,
    (width, colour): (f32, Color32),
    line: Line,
) {
    let corners = outline(target, 0.0).map(|corner| base_from_target.isometry() * corner);
    for index in 0..4 {
        let ends = [corners[index], corners[(index + 1) % 4]];
        canvas.line_on_face(ends, Stroke::new(width, colour), line == Line::Dashed, size_m(target));
    }
}

#[cfg(test)]
mod tests {
    use handeye_geometry::targets::Grid;

    use super::*;

    #[test]
    fn the_square_between_the_first_corners_is_dark_and_so_is_every_other_one() {
        let target = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });
        let dark = dark(&target);
        assert_eq!(dark.len(), 11 * 8 / 2);
        let holds = |x: f64, y: f64| {
            dark.iter().any(|square| (square[0].x..square[2].x).contains(&x) && (square[0].y..square[2].y).contains(&y))
        };
        assert!(holds(0.0075, 0.0075), "between the first corners");
        assert!(!holds(0.0225, 0.0075) && !holds(0.0075, 0.0225));
        assert!(holds(-0.0075, -0.0075) && holds(0.1425, 0.0825), "at two of its ends");
        assert!(!holds(0.1425, 0.0975), "eleven by eight squares: the two ends of the board are different");
        let outline = outline(&target, 0.0);
        assert!((outline[2] - Point3::new(0.15, 0.105, 0.0)).norm() < 1e-12, "{outline:?}");
    }

    #[test]
    fn a_board_of_dots_has_a_dot_at_each_point() {
        let target = TargetSpec::Circles(Grid { columns: 4, rows: 3, square_m: 0.02 });
        let dark = dark(&target);
        assert_eq!(dark.len(), 12);
        for (dot, point) in dark.iter().zip(target.points()) {
            assert!(dot.iter().all(|corner| ((corner - point).norm() - 0.005).abs() < 1e-12));
        }
    }
}
