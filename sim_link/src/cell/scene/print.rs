//! How a print is off its grid.

use rand::Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::{BoardSpec, PrintSpec};
use crate::cell::render::PrintErrors;

/// Degrees of the products of Legendre polynomials that the smooth part is made of, along x and y: the second and third
/// order. Order zero would be a displacement of the board, and the first a turn, a size and a shear.
const SMOOTH: [[usize; 2]; 7] = [[2, 0], [1, 1], [0, 2], [3, 0], [2, 1], [1, 2], [0, 3]];

/// Draws the print of a board.
pub(super) fn printed(print: &PrintSpec, board: &BoardSpec, rng: &mut impl Rng) -> PrintErrors {
    let (columns, rows, square_m) = (board.columns, board.rows, board.square_m);
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let smooth_squares = print.smooth_mm * 1e-3 / square_m / (SMOOTH.len() as f64).sqrt();
    let smooth: Vec<[f64; 2]> = SMOOTH.iter().map(|_| [normal() * smooth_squares, normal() * smooth_squares]).collect();
    let white_squares = print.white_mm * 1e-3 / square_m;
    let nodes = (columns + 2) * (rows + 2);
    let white: Vec<[f64; 2]> = (0..nodes).map(|_| [normal() * white_squares, normal() * white_squares]).collect();
    PrintErrors::new(columns, rows, |column, row| {
        let place = [unit_place(column, columns), unit_place(row, rows)];
        let mut off = white[(row + 1) as usize * (columns + 2) + (column + 1) as usize];
        for ([i, j], strength) in SMOOTH.iter().zip(&smooth) {
            // A product of them has a mean square of 1 / (2i + 1) / (2j + 1).
            let scale = ((2 * i + 1) as f64 * (2 * j + 1) as f64).sqrt();
            let value = scale * legendre(*i, place[0]) * legendre(*j, place[1]);
            off = [off[0] + strength[0] * value, off[1] + strength[1] * value];
        }
        let lines = [(column, columns), (row, rows)];
        for (axis, (line, count)) in lines.into_iter().enumerate() {
            if let Some(pixels) = print.bitmap_px {
                off[axis] += rounding(line, count, board.paper_m[axis] / square_m, pixels[axis]);
            }
        }
        off
    })
}

/// What a line of the grid is displaced by, in squares, where the sheet is a picture of so many pixels.
fn rounding(line: i64, count: usize, paper_squares: f64, pixels: u32) -> f64 {
    let from_edge = line as f64 - 0.5 * (count as f64 - 1.0) + 0.5 * paper_squares;
    let pixel = paper_squares / f64::from(pixels);
    (from_edge / pixel).round() * pixel - from_edge
}

/// Where a corner is between the first, −1, and the last, 1; on the outline as at the corner beside it.
fn unit_place(index: i64, count: usize) -> f64 {
    let last = (count as f64 - 1.0).max(1.0);
    (2.0 * index as f64 / last - 1.0).clamp(-1.0, 1.0)
}

fn legendre(degree: usize, x: f64) -> f64 {
    match degree {
        0 => 1.0,
        1 => x,
        2 => 0.5 * (3.0 * x * x - 1.0),
        _ => 0.5 * (5.0 * x * x - 3.0) * x,
    }
}
