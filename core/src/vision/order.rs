//! The order of grid points: the same end of the target first in every view.

use image::GrayImage;
use nalgebra::Vector2;

use crate::target::Grid;

/// Points of a grid, row by row, as some detector ordered them.
type Points = Vec<Vector2<f64>>;

/// Brings the inner corners of a chessboard into the order of [`crate::target::TargetSpec`]: x cross y points into the
/// board, and the square between the first corners of the first two rows is dark.
pub fn chessboard(points: Points, grid: &Grid, image: &GrayImage) -> Points {
    let candidates: Vec<Points> = orientations(points, grid)
        .into_iter()
        .filter(|candidate| first_square_is_dark(candidate, grid, image))
        .collect();
    rightmost(candidates, grid)
}

/// All orders of a grid that keep its shape and are not mirrored: two, or four for a square grid.
pub fn orientations(points: Points, grid: &Grid) -> Vec<Points> {
    let upright = unmirrored(points, grid);
    let half_turn: Points = upright.iter().rev().copied().collect();
    let mut all = vec![upright, half_turn];
    if grid.columns == grid.rows {
        let turned: Vec<Points> = all.iter().map(|p| quarter_turn(p, grid.columns)).collect();
        all.extend(turned);
    }
    all
}

/// The order whose x axis points most to the right in the image.
pub fn rightmost(candidates: Vec<Points>, grid: &Grid) -> Points {
    let rightness = |points: &Points| {
        let x = axes(points, grid).0;
        x.x / x.norm()
    };
    candidates.into_iter().max_by(|a, b| rightness(a).total_cmp(&rightness(b))).unwrap_or_default()
}

/// Mean direction of rows and of columns in the image.
fn axes(points: &[Vector2<f64>], grid: &Grid) -> (Vector2<f64>, Vector2<f64>) {
    let (columns, rows) = (grid.columns, grid.rows);
    let x = (0..rows).map(|r| points[r * columns + columns - 1] - points[r * columns]).sum();
    let y = (0..columns).map(|c| points[(rows - 1) * columns + c] - points[c]).sum();
    (x, y)
}

fn unmirrored(points: Points, grid: &Grid) -> Points {
    let (x, y) = axes(&points, grid);
    if x.x * y.y - x.y * y.x > 0.0 {
        return points;
    }
    points.chunks(grid.columns).flat_map(|row| row.iter().rev().copied()).collect()
}

/// A square grid turned by 90°, not mirrored: new rows are old columns, read from the far end.
fn quarter_turn(points: &[Vector2<f64>], n: usize) -> Points {
    (0..n).flat_map(|row| (0..n).map(move |column| (row, column))).map(|(r, c)| points[(n - 1 - c) * n + r]).collect()
}

/// Compares the mean brightness of the squares that should be dark with that of the others.
fn first_square_is_dark(points: &[Vector2<f64>], grid: &Grid, image: &GrayImage) -> bool {
    let mut sums = [0.0; 2];
    let mut counts = [0.0; 2];
    for row in 0..grid.rows - 1 {
        for column in 0..grid.columns - 1 {
            let i = row * grid.columns + column;
            let centre = (points[i] + points[i + 1] + points[i + grid.columns] + points[i + grid.columns + 1]) / 4.0;
            let parity = (row + column) % 2;
            let (x, y) = (centre.x.round(), centre.y.round());
            if x >= 0.0 && y >= 0.0 && x < f64::from(image.width()) && y < f64::from(image.height()) {
                sums[parity] += f64::from(image.get_pixel(x as u32, y as u32).0[0]);
                counts[parity] += 1.0;
            }
        }
    }
    sums[0] * counts[1] < sums[1] * counts[0]
}
