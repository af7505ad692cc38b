use image::Luma;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::*;
use crate::camera::{Distortion, Intrinsics};
use crate::frames::{Camera, Pose, Target};
use crate::se3;
use crate::target::Grid;

const BOARD: Grid = Grid { columns: 10, rows: 7, square_m: 0.015 };

/// Grey level of the printed board, its margin and what is around it, at a point of its plane.
fn print_at(grid: &Grid, x_m: f64, y_m: f64) -> f64 {
    let (x, y) = (x_m / grid.square_m, y_m / grid.square_m);
    let (columns, rows) = (grid.columns as f64, grid.rows as f64);
    if x < -1.9 || y < -1.9 || x > columns + 0.9 || y > rows + 0.9 {
        90.0
    } else if x < -1.0 || y < -1.0 || x > columns || y > rows {
        200.0
    } else if (x.floor() as i64 + y.floor() as i64) % 2 == 0 {
        40.0
    } else {
        200.0
    }
}

/// A picture of the board: a pixel is the mean of 8×8 rays where its corners differ, then blurred; with noise.
fn picture(
    grid: &Grid,
    camera: &Intrinsics,
    camera_from_target: &Isometry3<f64>,
    blur_px: f64,
    noise: f64,
    seed: u64,
) -> GrayImage {
    const RAYS: u32 = 8;
    let target_from_camera = camera_from_target.inverse();
    let origin = target_from_camera * nalgebra::Point3::origin();
    // The lens bends so little inside a pixel that the place on the board is linear there.
    let place = |u: f64, v: f64| {
        let ray = camera.unproject(&Vector2::new(u, v)).expect("inside the lens model").into_inner();
        let ray = target_from_camera * ray;
        (origin + ray * (-origin.z / ray.z)).coords.xy()
    };
    let (width, height) = (camera.width as usize, camera.height as usize);
    let corners: Vec<Vector2<f64>> = (0..=height)
        .flat_map(|v| (0..=width).map(move |u| (u as f64 - 0.5, v as f64 - 0.5)))
        .map(|(u, v)| place(u, v))
        .collect();
    let mut picture = image::ImageBuffer::<Luma<f32>, Vec<f32>>::new(camera.width, camera.height);
    for (u, v, pixel) in picture.enumerate_pixels_mut() {
        let first = v as usize * (width + 1) + u as usize;
        let (a, b, c) = (corners[first], corners[first + 1], corners[first + width + 1]);
        let levels = [a, b, c, b + c - a].map(|p| print_at(grid, p.x, p.y));
        let mut level = levels[0];
        if levels.iter().any(|l| *l != levels[0]) {
            let share = |k: u32| (f64::from(k) + 0.5) / f64::from(RAYS);
            let sum: f64 = (0..RAYS * RAYS)
                .map(|k| a + (b - a) * share(k % RAYS) + (c - a) * share(k / RAYS))
                .map(|p| print_at(grid, p.x, p.y))
                .sum();
            level = sum / f64::from(RAYS * RAYS);
        }
        pixel.0[0] = level as f32;
    }
    let blurred = if blur_px > 0.0 { image::imageops::blur(&picture, blur_px as f32) } else { picture };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    GrayImage::from_fn(camera.width, camera.height, |u, v| {
        let n: f64 = StandardNormal.sample(&mut rng);
        Luma([(f64::from(blurred.get_pixel(u, v).0[0]) + noise * n).round().clamp(0.0, 255.0) as u8])
    })
}

fn camera() -> Intrinsics {
    Intrinsics {
        distortion: Distortion::BrownConrady([-0.08, 0.05, 4e-4, -3e-4, 0.0]),
        ..Intrinsics::pinhole(640, 480, 589.37)
    }
}

/// Looking at the middle of the board, tilted about an axis in the board and rolled about the line of sight.
fn pose(grid: &Grid, distance: f64, tilt: Vector3<f64>, roll: f64) -> Isometry3<f64> {
    let centre = TargetSpec::Chessboard(*grid).centre();
    let turn = UnitQuaternion::from_scaled_axis(tilt) * UnitQuaternion::from_scaled_axis(Vector3::z() * roll);
    Isometry3::from_parts(Translation3::new(0.0, 0.0, distance), turn)
        * Isometry3::translation(-centre.x, -centre.y, 0.0)
}

fn truth(grid: &Grid, camera: &Intrinsics, pose: &Isometry3<f64>) -> Vec<Vector2<f64>> {
    (0..grid.len()).map(|i| camera.project(&(pose * grid.point(i))).expect("in front")).collect()
}

#[test]
fn the_order_of_corners_stays_with_the_board_at_every_roll() {
    let target = TargetSpec::Chessboard(BOARD);
    for step in 0..12 {
        let pose = pose(&BOARD, 0.4, Vector3::new(0.3, -0.2, 0.0), f64::from(step) * 30f64.to_radians());
        let image = picture(&BOARD, &camera(), &pose, 0.7, 1.0, step as u64);
        for effort in [Effort::Live, Effort::Thorough] {
            let corners = detect(&image, &target, effort).expect("valid").expect("found");
            for (corner, px) in corners.iter().zip(truth(&BOARD, &camera(), &pose)) {
                assert!((corner.px - px).norm() < 0.2, "roll {}°: {corner:?} is not at {px}", step * 30);
            }
        }
    }
}

#[test]
fn corners_are_placed_to_a_few_hundredths_of_a_pixel() {
    let target = TargetSpec::Chessboard(BOARD);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for (blur, noise, limit) in [(0.0, 0.0, 0.03), (0.7, 2.0, 0.03), (1.0, 5.0, 0.06)] {
        let mut bias = Vector2::zeros();
        let mut squares = 0.0;
        let mut worst: f64 = 0.0;
        let mut count = 0.0;
        for view in 0..10 {
            let tilt = Vector3::new(rng.random_range(-0.6..0.6), rng.random_range(-0.6..0.6), 0.0);
            let pose = pose(&BOARD, rng.random_range(0.33..0.55), tilt, rng.random_range(-3.1..3.1));
            let image = picture(&BOARD, &camera(), &pose, blur, noise, view);
            let corners = detect(&image, &target, Effort::Thorough).expect("valid").expect("found");
            for (corner, px) in corners.iter().zip(truth(&BOARD, &camera(), &pose)) {
                let error = corner.px - px;
                bias += error;
                squares += error.norm_squared();
                worst = worst.max(error.norm());
                count += 1.0;
            }
        }
        let rms = f64::sqrt(squares / (2.0 * count));
        let bias = (bias / count).norm();
        println!("blur {blur} px, noise {noise}: rms {rms:.4} px per axis, bias {bias:.4} px, worst {worst:.3} px");
        assert!(rms < limit && bias < 0.01 && worst < 10.0 * limit, "blur {blur}, noise {noise}: {rms} {bias} {worst}");
    }
}

#[test]
fn boards_out_of_view_and_blank_images_are_not_found() {
    let target = TargetSpec::Chessboard(BOARD);
    let blank = GrayImage::from_pixel(320, 240, Luma([128]));
    let tiny = GrayImage::new(2, 2);
    let cut = picture(
        &BOARD,
        &camera(),
        &(Isometry3::translation(0.12, 0.0, 0.0) * pose(&BOARD, 0.3, Vector3::zeros(), 0.0)),
        0.7,
        1.0,
        1,
    );
    for image in [&blank, &tiny, &cut] {
        assert_eq!(detect(image, &target, Effort::Thorough).expect("valid"), None);
    }
}

#[test]
fn symmetric_boards_start_at_the_end_that_points_right() {
    let grid = Grid { columns: 9, rows: 7, square_m: 0.015 };
    let target = TargetSpec::Chessboard(grid);
    for roll in [0.1, std::f64::consts::PI + 0.1] {
        let pose = pose(&grid, 0.4, Vector3::new(0.2, 0.1, 0.0), roll);
        let image = picture(&grid, &camera(), &pose, 0.7, 1.0, 1);
        let corners = detect(&image, &target, Effort::Thorough).expect("valid").expect("found");
        assert!(corners[8].px.x > corners[0].px.x);
    }
}

#[test]
fn pnp_finds_the_pose_with_every_lens_and_names_the_mirrored_one() {
    let target = TargetSpec::Chessboard(BOARD);
    let lenses = [
        Distortion::None,
        Distortion::BrownConrady([-0.2, 0.05, 1e-3, -1e-3, 0.01]),
        Distortion::Rational([0.4, -0.2, 6e-4, -4e-4, 0.03, 0.35, -0.15, 0.02]),
        Distortion::Fisheye([-0.02, 0.004, -0.003, 5e-4]),
    ];
    for distortion in lenses {
        let camera = Intrinsics { distortion, ..camera() };
        for (tilt, roll) in [(Vector3::new(0.5, 0.1, 0.0), 0.3), (Vector3::new(-0.05, 0.02, 0.0), 3.0)] {
            let truth_pose = pose(&BOARD, 0.4, tilt, roll);
            let corners: Vec<Corner> = truth(&BOARD, &camera, &truth_pose)
                .into_iter()
                .enumerate()
                .map(|(index, px)| Corner { index, px })
                .collect();
            let found = pnp::camera_from_target(&corners, &target, &camera).expect("solves");
            let error = se3::log(&(found.camera_from_target.isometry().inverse() * truth_pose));
            assert!(error.norm() < 1e-7 && found.rms_px < 1e-6, "{distortion:?}: {error}");
            assert!(found.ambiguity() < 1e-3);
        }
    }
}

#[test]
fn corners_on_a_line_have_no_pose() {
    let target = TargetSpec::Chessboard(BOARD);
    let pose = pose(&BOARD, 0.4, Vector3::new(0.3, 0.0, 0.0), 0.0);
    let corners: Vec<Corner> = truth(&BOARD, &camera(), &pose)
        .into_iter()
        .enumerate()
        .take(10)
        .map(|(index, px)| Corner { index, px })
        .collect();
    let result = pnp::camera_from_target(&corners, &target, &camera());
    assert!(matches!(result, Err(VisionError::NoPose { .. })), "{result:?}");
    let result = pnp::camera_from_target(&corners[..3], &target, &camera());
    assert!(matches!(result, Err(VisionError::TooFewCorners { got: 3, need: 4 })));
}

/// Corners of the board at several tilts, without noise.
fn views(camera: &Intrinsics, tilts: &[(f64, f64)]) -> (Vec<Vec<Corner>>, Vec<Pose<Camera, Target>>) {
    tilts
        .iter()
        .map(|(a, b)| {
            let pose = pose(&BOARD, 0.35, Vector3::new(*a, *b, 0.0), a + b);
            let corners =
                truth(&BOARD, camera, &pose).into_iter().enumerate().map(|(index, px)| Corner { index, px }).collect();
            (corners, Pose::from_isometry(pose))
        })
        .unzip()
}

#[test]
fn intrinsics_of_every_model_are_recovered_from_exact_corners() {
    let target = TargetSpec::Chessboard(BOARD);
    let tilts = [(0.5, 0.0), (-0.4, 0.3), (0.0, -0.5), (0.3, 0.4), (-0.5, -0.2), (0.1, 0.1)];
    for (distortion, model) in [
        (Distortion::None, Distortion::None),
        (Distortion::BrownConrady([-0.2, 0.05, 1e-3, -1e-3, 0.0]), Distortion::BrownConrady([0.0; 5])),
        (Distortion::Fisheye([-0.02, 0.004, 0.0, 0.0]), Distortion::Fisheye([0.0; 4])),
    ] {
        let camera = Intrinsics { distortion, ..camera() };
        let (corners, poses) = views(&camera, &tilts);
        let corners: Vec<&[Corner]> = corners.iter().map(Vec::as_slice).collect();
        let found = intrinsics::calibrate(&corners, &target, (640, 480), model, None).expect("solves");
        // OpenCV takes corners as single floats: 3e-5 px at 600.
        assert!((found.intrinsics.fx - camera.fx).abs() < 0.05, "{:?}", found.intrinsics);
        assert!((found.intrinsics.cx - camera.cx).abs() < 0.05);
        assert!(found.rms_px < 1e-3);
        let (metres, _) = found.views[0].camera_from_target.distance_to(&poses[0]);
        assert!(metres < 1e-4);
    }
}

#[test]
fn views_that_all_look_alike_are_refused() {
    let target = TargetSpec::Chessboard(BOARD);
    let (corners, _) = views(&camera(), &[(0.3, 0.0), (0.3, 0.0), (0.301, 0.0)]);
    let corners: Vec<&[Corner]> = corners.iter().map(Vec::as_slice).collect();
    let model = Distortion::BrownConrady([0.0; 5]);
    let result = intrinsics::calibrate(&corners, &target, (640, 480), model, None);
    assert!(matches!(result, Err(VisionError::SameTilt { .. })), "{result:?}");
    let result = intrinsics::calibrate(&corners[..2], &target, (640, 480), model, None);
    assert!(matches!(result, Err(VisionError::TooFewViews { got: 2, need: 3 })));
}
