//! Errors of a print relative to its grid.

use rand::Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::{BoardSpec, PrintSpec};
use handeye_render::PrintErrors;

/// Degrees of the products of polynomials that the smooth part is made of, along x and y: the second and third order. Order
/// zero would be a displacement of the board, and the first a turn, a size and a shear.
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
    let along = [polynomials(columns), polynomials(rows)];
    // On the outline the same as at the adjacent corner.
    let at = |axis: usize, degree: usize, index: i64| {
        let values = &along[axis][degree];
        values[index.clamp(0, values.len() as i64 - 1) as usize]
    };
    PrintErrors::new(columns, rows, |column, row| {
        let mut off = white[(row + 1) as usize * (columns + 2) + (column + 1) as usize];
        for ([i, j], strength) in SMOOTH.iter().zip(&smooth) {
            let value = at(0, *i, column) * at(1, *j, row);
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

/// Displacement of a line of the grid, in squares, where the sheet is a picture of `pixels` pixels.
fn rounding(line: i64, count: usize, paper_squares: f64, pixels: u32) -> f64 {
    let from_edge = line as f64 - 0.5 * (count as f64 - 1.0) + 0.5 * paper_squares;
    let pixel = paper_squares / f64::from(pixels);
    (from_edge / pixel).round() * pixel - from_edge
}

/// Polynomials of degree 0 to 3 of the place of a corner along an axis, orthonormal over the corners: the mean square of each
/// is 1. One of a degree that so few corners cannot have is zero.
fn polynomials(count: usize) -> [Vec<f64>; 4] {
    let mut all: [Vec<f64>; 4] = std::array::from_fn(|_| Vec::new());
    for degree in 0..all.len() {
        let mut values: Vec<f64> =
            (0..count).map(|i| (2.0 * i as f64 / count as f64 - 1.0).powi(degree as i32)).collect();
        for lower in &all[..degree] {
            let part = values.iter().zip(lower).map(|(a, b)| a * b).sum::<f64>() / count as f64;
            for (value, lower) in values.iter_mut().zip(lower) {
                *value -= part * lower;
            }
        }
        let rms = (values.iter().map(|value| value * value).sum::<f64>() / count as f64).sqrt();
        let scale = if rms > 1e-9 { 1.0 / rms } else { 0.0 };
        for value in &mut values {
            *value *= scale;
        }
        all[degree] = values;
    }
    all
}
