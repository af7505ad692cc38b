//! Images of a board, drawn for tests.

use handeye_geometry::targets::{Grid, TargetSpec};
use image::{Rgb, RgbImage};

/// What is drawn.
pub const BOARD: TargetSpec = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });

/// The board straight on, squares of 24 px, with box blur of a radius.
pub fn board(blur_px: i32) -> RgbImage {
    brighter_board(blur_px, 0.0)
}

/// The same, brighter by this many grey levels.
pub(crate) fn brighter_board(blur_px: i32, brighter: f64) -> RgbImage {
    let level = |u: i32, v: i32| {
        let (x, y) = ((u - 100).div_euclid(24), (v - 100).div_euclid(24));
        let on_board = (-1..10).contains(&x) && (-1..7).contains(&y);
        if on_board && (x + y).rem_euclid(2) == 0 { 40.0 } else { 210.0 }
    };
    RgbImage::from_fn(480, 360, |u, v| {
        let around = -blur_px..=blur_px;
        let sum: f64 = around
            .clone()
            .flat_map(|du| around.clone().map(move |dv| (du, dv)))
            .map(|(du, dv)| level(u as i32 + du, v as i32 + dv))
            .sum();
        let count = f64::from((2 * blur_px + 1).pow(2));
        Rgb([(sum / count + brighter).round() as u8; 3])
    })
}
