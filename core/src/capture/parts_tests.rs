use image::{Rgb, RgbImage};
use nalgebra::Vector2;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use super::{Average, EdgeBlur, MAX_BLUR_SHARE, Scatter};
use crate::depth::DepthImage;
use crate::targets::observation::Corner;
use crate::testing::flat_board::{Board, image};
use crate::testing::sessions::GRID;

#[test]
fn colours_are_averaged_and_rounded_and_depths_leave_holes_out() {
    let frame = |level: u8, metres: [f32; 4]| {
        (RgbImage::from_pixel(2, 2, Rgb([level, 255, 0])), DepthImage { width: 2, height: 2, metres: metres.into() })
    };
    let nan = f32::NAN;
    // A surface that is measured twice of three times, one pixel far away twice, one never measured, one always.
    let (rgb, depth) = frame(10, [0.5, 3.5, 0.0, 1.0]);
    let mut average = Average::begin(&rgb, Some(&depth), 3.5);
    for (rgb, depth) in [frame(11, [nan, 3.5, nan, 2.0]), frame(11, [0.7, nan, 0.0, 3.0])] {
        assert!(average.add(&rgb, Some(&depth), 3.5));
    }
    let (rgb, depth) = average.finish();
    let depth = depth.expect("every image had one");
    assert_eq!(rgb.get_pixel(1, 1).0, [11, 255, 0], "10.67 is rounded up");
    assert!((depth.metres[0] - 0.6).abs() < 1e-6);
    assert_eq!(depth.metres[1], 3.5, "far, not a surface at the mean of far and nothing");
    assert_eq!(depth.metres[2], 0.0);
    assert_eq!(depth.metres[3], 2.0);
    let other = RgbImage::new(3, 2);
    assert!(!average.add(&other, Some(&depth), 3.5), "another size");
    assert!(!average.add(&rgb, None, 3.5), "no depth");
    assert_eq!(average.frames(), 3);
}

#[test]
fn the_scatter_is_that_of_one_image_whatever_the_places_of_the_corners() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let noise = Normal::new(0.0, 0.03).expect("a deviation");
    for (images, tolerance) in [(3, 0.15), (16, 0.06)] {
        let mut scatter = Scatter::default();
        for image in 0..images {
            // Every third corner is missing from every other image.
            let corners: Vec<Corner> = (0..70)
                .filter(|i| i % 3 > 0 || image % 2 == 0)
                .map(|index| {
                    let at = Vector2::new(index as f64 * 9.0, 100.0 - index as f64);
                    Corner::new(index, at + Vector2::new(noise.sample(&mut rng), noise.sample(&mut rng)))
                })
                .collect();
            if image < 2 {
                assert_eq!(scatter.sigma_px(), None);
            }
            scatter.add(&corners);
        }
        let sigma = scatter.sigma_px().expect("three images");
        // Three standard deviations of the estimate.
        assert!((sigma / 0.03 - 1.0).abs() < tolerance, "{images} images: {sigma} px");
    }
}

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
