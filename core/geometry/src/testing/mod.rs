//! What tests of all crates share: what a machine must have for a test, the board of the reference cell, and camera places
//! to view it from. Feature `testing`.

mod machine;
mod views;

pub use machine::{Need, data_folder, programs, python, skip};
pub use views::{looking_at, looking_at_point};

use crate::targets::{Grid, TargetSpec};

/// The inner corners of the board of the reference cell.
pub const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.015 };

/// The board of the reference cell.
pub const BOARD: TargetSpec = TargetSpec::Chessboard(GRID);
