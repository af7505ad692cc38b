use nalgebra::Vector2;

use super::{EdgeBlur, MAX_BLUR_SHARE};
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::testing::GRID;
use handeye_simulate::flat_board::{Board, image};

fn measured(board: &Board, noise: f64) -> EdgeBlur {
    let grey = image(board.size, &board.levels(), noise, 5);
    EdgeBlur::measure(&grey, &board.corners(), &GRID).expect("a board of good size")
}

#[test]
fn the_blur_of_edges_is_that_of_the_image_up_to_the_limit() {
    for turn_rad in [0.05, 0.4, 0.785, -1.3] {
        for (square_px, sigma_px) in [(20.0, 0.5), (20.0, 1.0), (20.0, 2.0), (20.0, 3.0), (12.0, 1.5), (30.0, 4.0)] {
            for noise in [0.0, 5.0] {
                let size = (520, 480);
                let origin = Vector2::new(220.2, if turn_rad < 0.0 { 400.4 } else { 60.4 });
                let board = Board { size, origin, square_px, turn_rad, sigma_px, ..Board::new() };
                let blur = measured(&board, noise);
                let of = format!("turn {turn_rad}, square {square_px}, noise {noise}: {blur:?}");
                assert!((blur.sigma_px / sigma_px - 1.0).abs() < 0.1, "σ {sigma_px}, {of}");
                assert!((blur.square_px / square_px - 1.0).abs() < 0.02, "{of}");
                assert_eq!(blur.is_too_blurred(), blur.sigma_px > 0.15 * blur.square_px, "{of}");
            }
        }
    }
}

#[test]
fn an_image_beyond_the_limit_is_too_blurred_and_one_moved_along_rows_as_well() {
    let sharp = Board::new();
    assert!(!measured(&sharp, 2.0).is_too_blurred());
    for sigma_px in [1.15 * MAX_BLUR_SHARE * 20.0, 6.0] {
        let blur = measured(&Board { sigma_px, ..sharp }, 2.0);
        assert!(blur.is_too_blurred(), "σ {sigma_px}: {blur:?}");
    }
    // Only the edges across the motion are blurred.
    let moved = measured(&Board { motion_px: 4.0, ..sharp }, 2.0);
    assert!(moved.is_too_blurred(), "{moved:?}");
}

#[test]
fn a_board_too_small_or_without_contrast_has_no_blur() {
    let tiny = Board { square_px: 4.0, ..Board::new() };
    let grey = image(tiny.size, &tiny.levels(), 0.0, 1);
    assert_eq!(EdgeBlur::measure(&grey, &tiny.corners(), &GRID), None);
    let board = Board::new();
    let flat = image(board.size, &vec![100.0; 320 * 240], 3.0, 1);
    assert_eq!(EdgeBlur::measure(&flat, &board.corners(), &GRID), None);
    let stray = [Corner::new(999, Vector2::new(f64::NAN, 0.0))];
    assert_eq!(EdgeBlur::measure(&flat, &stray, &GRID), None);
}
