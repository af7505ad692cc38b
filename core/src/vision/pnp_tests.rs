use nalgebra::{Isometry3, Vector2, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::VisionError;
use super::pnp::{camera_from_target, solve};
use super::rendered::looking_at;
use crate::camera::{Distortion, Intrinsics};
use crate::frames::{Camera, Pose, Target};
use crate::observation::Corner;
use crate::target::{Grid, TargetSpec};

const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.015 };
const TARGET: TargetSpec = TargetSpec::Chessboard(GRID);
const TRIALS: usize = 200;
const NOISE_PX: f64 = 0.1;

fn cameras() -> Vec<Intrinsics> {
    [
        Distortion::None,
        Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
        Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
        Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
    ]
    .into_iter()
    .map(|distortion| Intrinsics { distortion, fy: 575.0, cx: 322.4, ..Intrinsics::pinhole(640, 480, 581.0) })
    .collect()
}

fn project(camera: &Intrinsics, pose: &Isometry3<f64>, noise_px: f64, rng: &mut ChaCha8Rng) -> Vec<Corner> {
    let noise = Normal::new(0.0, noise_px).expect("a deviation");
    (0..GRID.len())
        .map(|index| {
            let px = camera.project(&(pose * GRID.point(index))).expect("in front");
            Corner::new(index, px + Vector2::new(noise.sample(rng), noise.sample(rng)))
        })
        .collect()
}

#[test]
fn exact_corners_give_the_exact_pose_through_every_lens() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for camera in cameras() {
        for _ in 0..50 {
            let angles = [rng.random_range(0.0..1.1), rng.random_range(0.0..6.3), rng.random_range(-3.1..3.1)];
            let offset = Vector2::new(rng.random_range(-100.0..100.0), rng.random_range(-80.0..80.0));
            let truth = looking_at(&GRID, &camera, rng.random_range(0.25..0.8), angles, offset);
            let corners = project(&camera, &truth, 0.0, &mut rng);
            let pose = solve(&corners, &TARGET, &camera).expect("a pose");
            let (distance, angle) = pose.best.camera_from_target.distance_to(&truth.into());
            // Limited by rounding: 1e-13 px over a few hundred px, amplified by up to 10⁴ for a board seen head-on.
            assert!(distance < 1e-8 && angle < 1e-8, "{:?}: {distance} m {angle} rad", camera.distortion);
            assert!(pose.best.rms_px < 1e-8);
        }
    }
}

#[test]
fn a_fisheye_pose_uses_corners_beside_the_camera_too() {
    let camera = Intrinsics {
        distortion: Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
        ..Intrinsics::pinhole(640, 480, 120.0)
    };
    // The board's last columns lie behind the plane of the camera.
    let truth = looking_at(&GRID, &camera, 0.05, [0.9, 1.2, 0.3], Vector2::new(20.0, 0.0));
    let depths: Vec<f64> = (0..GRID.len()).map(|i| (truth * GRID.point(i)).z).collect();
    assert!(depths.iter().any(|z| *z < 0.0), "the scene does not test what it should");
    let corners = project(&camera, &truth, 0.0, &mut ChaCha8Rng::seed_from_u64(1));
    let pose = camera_from_target(&corners, &TARGET, &camera).expect("a pose");
    let (distance, angle) = pose.distance_to(&truth.into());
    assert!(distance < 1e-7 && angle < 1e-6, "{distance} m {angle} rad");
}

#[test]
fn the_pose_error_is_that_of_least_squares() {
    // Published for this camera, board and 0.1 px: tilt 0.065°, roll 0.017°, lateral 0.58 mm with the tilt, depth
    // 0.15 mm. Here: the RMS of the errors, whitened by the Jacobian at the truth, is 1 per degree of freedom.
    let camera = Intrinsics::pinhole(640, 480, 581.0);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut sum = 0.0;
    for _ in 0..TRIALS {
        let angles = [rng.random_range(0.2..0.7), rng.random_range(0.0..6.3), rng.random_range(-3.1..3.1)];
        let truth = looking_at(&GRID, &camera, 0.5, angles, Vector2::zeros());
        let corners = project(&camera, &truth, NOISE_PX, &mut rng);
        let estimate = camera_from_target(&corners, &TARGET, &camera).expect("a pose");
        let error: Vector6<f64> = crate::se3::log(&(truth.inverse() * estimate.isometry()));
        let mut moved = 0.0;
        for index in 0..GRID.len() {
            let at = |pose: &Isometry3<f64>| camera.project(&(pose * GRID.point(index))).expect("in front");
            moved += (at(&(truth * crate::se3::exp(&error))) - at(&truth)).norm_squared();
        }
        sum += moved / (6.0 * NOISE_PX * NOISE_PX);
    }
    // Chi-squared over its 6 × 200 degrees of freedom: 1 ± 0.04.
    let ratio = sum / TRIALS as f64;
    assert!((0.88..1.12).contains(&ratio), "{ratio}");
}

#[test]
fn a_distant_board_has_two_poses_and_says_how_alike_they_are() {
    let camera = Intrinsics::pinhole(640, 480, 581.0);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let far = looking_at(&GRID, &camera, 3.0, [0.5, 0.4, 0.2], Vector2::zeros());
    let pose = solve(&project(&camera, &far, 0.1, &mut rng), &TARGET, &camera).expect("a pose");
    let other = pose.alternative.expect("two minima");
    let tilt = |isometry: &Isometry3<f64>| (isometry.rotation * nalgebra::Vector3::z()).z.acos();
    assert!((tilt(other.camera_from_target.isometry()) - 0.5).abs() < 0.15, "the mirror image is tilted as much");
    assert!(pose.best.rms_px <= other.rms_px);
    assert!(pose.ambiguity().expect("two") > 0.5, "{:?}", pose.ambiguity());

    let near = looking_at(&GRID, &camera, 0.4, [0.5, 0.4, 0.2], Vector2::zeros());
    let pose = solve(&project(&camera, &near, 0.1, &mut rng), &TARGET, &camera).expect("a pose");
    assert!(pose.ambiguity().is_none_or(|a| a < 0.2), "{:?}", pose.ambiguity());
}

#[test]
fn unusable_corners_are_named() {
    let camera = Intrinsics::pinhole(640, 480, 581.0);
    let truth = looking_at(&GRID, &camera, 0.4, [0.5, 0.4, 0.2], Vector2::zeros());
    let good = project(&camera, &truth, 0.0, &mut ChaCha8Rng::seed_from_u64(1));
    let error = |corners: &[Corner]| solve(corners, &TARGET, &camera).expect_err("unusable");

    assert_eq!(error(&good[..3]), VisionError::TooFewCorners { view: 0, got: 3, need: 4 });
    assert_eq!(error(&good[..10]), VisionError::CollinearCorners { view: 0 });
    let mut outside = good.clone();
    outside[5].index = 70;
    assert!(matches!(error(&outside), VisionError::BadCorner { index: 70, .. }));
    let mut twice = good.clone();
    twice[5].index = 4;
    assert!(matches!(error(&twice), VisionError::BadCorner { index: 4, .. }));
    let mut nan = good.clone();
    nan[5].px.x = f64::NAN;
    assert!(matches!(error(&nan), VisionError::BadCorner { index: 5, .. }));
    let bad_camera = Intrinsics { fx: 0.0, ..camera };
    assert!(matches!(solve(&good, &TARGET, &bad_camera), Err(VisionError::Camera { .. })));
    let bad_target = TargetSpec::Chessboard(Grid { square_m: f64::NAN, ..GRID });
    assert!(matches!(solve(&good, &bad_target, &camera), Err(VisionError::BadSquare { .. })));
}

#[test]
fn no_small_motion_of_the_pose_lowers_the_error() {
    const STEP: f64 = 1e-5;
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for camera in cameras() {
        let truth = looking_at(&GRID, &camera, 0.4, [0.5, 0.4, 0.2], Vector2::new(40.0, -30.0));
        let corners = project(&camera, &truth, 0.3, &mut rng);
        let pose = solve(&corners, &TARGET, &camera).expect("a pose");
        let squared = |pose: &Pose<Camera, Target>| -> f64 {
            let at = |c: &Corner| camera.project(&(pose.isometry() * GRID.point(c.index))).expect("in front");
            corners.iter().map(|c| (at(c) - c.px).norm_squared()).sum()
        };
        for solution in [Some(pose.best), pose.alternative].into_iter().flatten() {
            let least = squared(&solution.camera_from_target);
            assert!((least / 70.0 - solution.rms_px.powi(2)).abs() < 1e-9);
            for axis in 0..6 {
                for sign in [-1.0, 1.0] {
                    let mut delta = Vector6::zeros();
                    delta[axis] = sign * STEP;
                    let moved = squared(&solution.camera_from_target.perturbed(&delta));
                    assert!(moved > least, "{:?} axis {axis}: {moved} < {least}", camera.distortion);
                }
            }
        }
    }
}
