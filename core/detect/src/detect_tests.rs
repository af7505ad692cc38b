use image::{GrayImage, Luma};
use nalgebra::Vector2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{DetectOptions, VisionError, detect, detect_with};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::looking_at;
use handeye_simulate::Scene;

/// Far above the fit's error on clean images, far below the distance between corners.
const SAME_CORNER_PX: f64 = 0.1;

fn scene(columns: usize, rows: usize, angles: [f64; 3]) -> Scene {
    let camera = Intrinsics::pinhole(640, 480, 581.0);
    let grid = Grid { columns, rows, square_m: 0.015 };
    let pose = looking_at(&grid, &camera, 0.42, angles, Vector2::new(12.0, -7.0));
    Scene::new(camera, grid, pose)
}

fn found(scene: &Scene) -> Corners {
    let target = TargetSpec::Chessboard(scene.grid());
    let corners = detect_with(&scene.render(1), &target, &DetectOptions::live()).expect("searches").expect("found");
    assert!(corners.iter().enumerate().all(|(i, c)| c.index == i));
    corners
}

/// Largest distance to the truth in the order of the truth.
fn worst(corners: &[Corner], truth: &[Vector2<f64>]) -> f64 {
    corners.iter().zip(truth).map(|(c, t)| (c.px - t).norm()).fold(0.0, f64::max)
}

#[test]
fn a_square_board_of_odd_side_begins_at_a_dark_end_and_runs_right_handed() {
    // 7×7 inner corners: two of its four ends are dark, alike after half a turn.
    for step in 0..12 {
        let scene = scene(7, 7, [0.3, 0.7, f64::from(step) * 30f64.to_radians() + 0.1]);
        let (corners, truth) = (found(&scene), scene.truth());
        let turned: Vec<_> = truth.iter().rev().copied().collect();
        let error = worst(&corners, &truth).min(worst(&corners, &turned));
        assert!(error < SAME_CORNER_PX, "turned by {}°: {error} px", step * 30);
    }
}

#[test]
fn corners_of_a_rendered_board_are_right_to_a_hundredth_of_a_pixel() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (mut sum, mut bias, mut count) = (0.0, Vector2::zeros(), 0.0);
    for view in 0..6 {
        let mut scene = Scene::random(&mut rng, 0.7, 3.1);
        scene.noise = 2.0;
        let target = TargetSpec::Chessboard(scene.grid());
        let corners = detect(&scene.render(view), &target).expect("searches").expect("found");
        for (corner, truth) in corners.iter().zip(scene.truth()) {
            let error = corner.px - truth;
            sum += error.norm_squared();
            bias += error;
            count += 1.0;
        }
    }
    let rms_per_axis = f64::sqrt(sum / (2.0 * count));
    // Measured 0.008 px for blur 0.7 px and noise of 2 grey levels; cornerSubPix has 0.02.
    assert!(rms_per_axis < 0.012, "{rms_per_axis}");
    // The mean over 420 corners is 20 times better than one.
    assert!((bias / count).norm() < 0.003, "{}", bias / count);
}

#[test]
fn small_and_large_boards_are_found() {
    for (distance, blur) in [(0.24, 0.7), (0.9, 0.7), (1.3, 0.5), (0.42, 2.5)] {
        let mut scene = scene(10, 7, [0.2, 0.7, 0.3]);
        scene.camera_from_target =
            looking_at(&scene.grid(), &scene.camera, distance, [0.2, 0.7, 0.3], Vector2::zeros());
        (scene.blur_px, scene.noise) = (blur, 2.0);
        let target = TargetSpec::Chessboard(scene.grid());
        let corners = detect(&scene.render(3), &target).expect("searches");
        let corners = corners.unwrap_or_else(|| panic!("missed at {distance} m, blur {blur} px"));
        let error = worst(&corners, &scene.truth());
        assert!(error < 3.0 * SAME_CORNER_PX, "at {distance} m: {error} px");
    }
}

#[test]
fn an_image_without_the_board_is_no_error() {
    let target = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });
    let dots = TargetSpec::Circles(Grid { columns: 5, rows: 4, square_m: 0.015 });
    let flat = GrayImage::from_pixel(320, 240, Luma([128]));
    assert_eq!(detect(&flat, &target), Ok(None));
    assert_eq!(detect(&flat, &dots), Ok(None));
    // A board with one row less, and one that leaves the image.
    assert_eq!(detect(&scene(10, 6, [0.2, 0.7, 0.3]).render(1), &target), Ok(None));
    let mut cut = scene(10, 7, [0.2, 0.7, 0.3]);
    cut.camera_from_target = looking_at(&cut.grid(), &cut.camera, 0.42, [0.2, 0.7, 0.3], Vector2::new(260.0, 0.0));
    assert_eq!(detect(&cut.render(1), &target), Ok(None));
}

#[test]
fn a_cancelled_search_says_so_and_not_that_there_is_no_target() {
    let cancel = CancelToken::default();
    cancel.cancel();
    let grid = Grid { columns: 5, rows: 4, square_m: 0.015 };
    let image = GrayImage::from_pixel(320, 240, Luma([128]));
    for target in [TargetSpec::Chessboard(grid), TargetSpec::Circles(grid), TargetSpec::AsymmetricCircles(grid)] {
        let options = DetectOptions::thorough().cancelled_by(&cancel);
        assert_eq!(detect_with(&image, &target, &options), Err(VisionError::Cancelled));
    }
}

#[test]
fn targets_and_images_that_cannot_be_searched_are_refused() {
    let image = GrayImage::new(64, 64);
    let target = |columns, rows| TargetSpec::Chessboard(Grid { columns, rows, square_m: 0.01 });
    assert_eq!(detect(&image, &target(2, 7)), Err(VisionError::TargetTooSmall { columns: 2, rows: 7 }));
    assert_eq!(detect(&image, &target(0, 0)), Err(VisionError::TargetTooSmall { columns: 0, rows: 0 }));
    assert_eq!(detect(&image, &target(usize::MAX, 7)), Ok(None));
    let nothing = GrayImage::new(0, 10);
    assert_eq!(detect(&nothing, &target(10, 7)), Err(VisionError::BadImage { width: 0, height: 10 }));
    assert_eq!(detect(&GrayImage::new(1, 1), &target(10, 7)), Ok(None));
}

/// Dots of radius 0.3 of a step seen straight from the front, the one at the origin half as wide again.
fn dots(columns: usize, rows: usize, turn: f64, larger: bool) -> (GrayImage, Vec<Vector2<f64>>) {
    const STEP: f64 = 30.0;
    const SAMPLES: i32 = 8;
    let (sin, cos) = turn.sin_cos();
    let centre = Vector2::new(320.3, 240.2);
    let place = |c: f64, r: f64| {
        let (x, y) = (STEP * (c - (columns as f64 - 1.0) / 2.0), STEP * (r - (rows as f64 - 1.0) / 2.0));
        centre + Vector2::new(cos * x - sin * y, sin * x + cos * y)
    };
    let truth: Vec<_> = (0..columns * rows).map(|i| place((i % columns) as f64, (i / columns) as f64)).collect();
    let image = GrayImage::from_fn(640, 480, |u, v| {
        let mut dark = 0.0;
        for (index, dot) in truth.iter().enumerate() {
            let radius = STEP * if larger && index == 0 { 0.45 } else { 0.28 };
            let offset = Vector2::new(f64::from(u), f64::from(v)) - dot;
            if offset.norm() > radius + 1.0 {
                continue;
            }
            for k in 0..SAMPLES * SAMPLES {
                let part = |i: i32| (f64::from(i) + 0.5) / f64::from(SAMPLES) - 0.5;
                let p = offset + Vector2::new(part(k % SAMPLES), part(k / SAMPLES));
                dark += if p.norm() < radius { 1.0 / f64::from(SAMPLES * SAMPLES) } else { 0.0 };
            }
        }
        Luma([(210.0 - 160.0 * dark) as u8])
    });
    (image, truth)
}

#[test]
fn a_grid_of_dots_begins_at_the_larger_one_through_any_turn() {
    for (columns, rows) in [(7, 5), (6, 6)] {
        let target = TargetSpec::Circles(Grid { columns, rows, square_m: 0.02 });
        for step in 0..8 {
            let (image, truth) = dots(columns, rows, f64::from(step) * 45f64.to_radians() + 0.05, true);
            let corners = detect(&image, &target).expect("searches").expect("found");
            let error = worst(&corners, &truth);
            assert!(error < SAME_CORNER_PX, "{columns}×{rows} turned by {}°: {error} px", step * 45);
        }
    }
}

#[test]
fn a_plain_grid_of_dots_begins_where_its_x_axis_points_most_to_the_right() {
    let target = TargetSpec::Circles(Grid { columns: 7, rows: 5, square_m: 0.02 });
    let (image, truth) = dots(7, 5, 0.4, false);
    let corners = detect(&image, &target).expect("searches").expect("found");
    assert!(worst(&corners, &truth) < SAME_CORNER_PX);
    let (image, mut truth) = dots(7, 5, 0.4 + std::f64::consts::PI, false);
    truth.reverse();
    let corners = detect(&image, &target).expect("searches").expect("found");
    assert!(worst(&corners, &truth) < SAME_CORNER_PX);
}

mod slow {
    use super::*;

    #[test]
    fn the_order_of_corners_follows_the_board_through_any_turn() {
        for (columns, rows) in [(10, 7), (7, 10), (9, 6)] {
            for step in 0..24 {
                // 180° and the quarter turns are among them.
                let scene = scene(columns, rows, [0.3, 0.7, f64::from(step) * 15f64.to_radians()]);
                let error = worst(&found(&scene), &scene.truth());
                assert!(error < SAME_CORNER_PX, "{columns}×{rows} turned by {}°: {error} px", step * 15);
            }
        }
    }

    #[test]
    fn a_symmetric_board_begins_where_its_x_axis_points_most_to_the_right() {
        for (columns, rows) in [(9, 7), (8, 8)] {
            for roll_deg in [-40.0, -20.0, 0.0, 20.0, 40.0f64] {
                for first_dark in [true, false] {
                    for half_turn in [0.0, 180.0] {
                        let mut scene = scene(columns, rows, [0.3, 0.7, (roll_deg + half_turn).to_radians()]);
                        scene.first_dark = first_dark;
                        let mut truth = scene.truth();
                        if half_turn > 0.0 {
                            truth.reverse();
                        }
                        let error = worst(&found(&scene), &truth);
                        assert!(error < SAME_CORNER_PX, "{columns}×{rows} at {roll_deg}° + {half_turn}°: {error} px");
                    }
                }
            }
        }
    }
}
