use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::VisionError;
use super::intrinsics::{IntrinsicsCalibration, calibrate};
use super::rendered::looking_at;
use crate::camera::{Distortion, Intrinsics};
use crate::observation::Corner;
use crate::target::{Grid, TargetSpec};

const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.03 };
const TARGET: TargetSpec = TargetSpec::Chessboard(GRID);
const SIZE: (u32, u32) = (640, 480);
const TRIALS: u64 = 40;

fn camera(distortion: Distortion) -> Intrinsics {
    Intrinsics { distortion, fy: 575.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(640, 480, 581.0) }
}

/// Views tilted by up to `tilt` around directions all around.
fn views(camera: &Intrinsics, count: usize, tilt: (f64, f64), noise_px: f64, seed: u64) -> Vec<Vec<Corner>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, noise_px).expect("a deviation");
    (0..count)
        .map(|i| {
            let angles = [rng.random_range(tilt.0..=tilt.1), i as f64 * 2.4, rng.random_range(-1.0..1.0)];
            let offset = Vector2::new(rng.random_range(-90.0..90.0), rng.random_range(-60.0..60.0));
            let pose = looking_at(&GRID, camera, rng.random_range(0.5..0.8), angles, offset);
            (0..GRID.len())
                .map(|index| {
                    let px = camera.project(&(pose * GRID.point(index))).expect("in front");
                    Corner::new(index, px + Vector2::new(noise.sample(&mut rng), noise.sample(&mut rng)))
                })
                .collect()
        })
        .collect()
}

fn solved(camera: &Intrinsics, noise_px: f64, guess: Option<Intrinsics>, seed: u64) -> IntrinsicsCalibration {
    let views = views(camera, 15, (0.2, 0.7), noise_px, seed);
    calibrate(&views, &TARGET, SIZE, camera.distortion, guess).expect("calibrates")
}

#[test]
fn exact_corners_give_the_camera_back() {
    for distortion in [
        Distortion::None,
        Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
        Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
    ] {
        let truth = camera(distortion);
        for guess in [None, Some(Intrinsics::pinhole(640, 480, 560.0))] {
            let found = solved(&truth, 0.0, guess, 2);
            // Single precision corners: 3e-5 px of noise, which moves fx by about as much.
            for (got, want) in found.intrinsics.parameters().iter().zip(truth.parameters()).take(4) {
                assert!((got - want).abs() < 1e-6, "{distortion:?} {guess:?}: {:?}", found.intrinsics);
            }
            assert!(found.rms_px < 1e-8, "{distortion:?}: {}", found.rms_px);
        }
    }
}

#[test]
fn the_rational_model_explains_its_own_corners() {
    // Its eight coefficients trade against one another, so the fit is judged by where it puts pixels.
    let truth = camera(Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]));
    let found = solved(&truth, 0.0, None, 2);
    assert!(found.rms_px < 2e-3, "{}", found.rms_px);
    assert!((found.intrinsics.fx - truth.fx).abs() < 0.5, "{:?}", found.intrinsics);
}

#[test]
fn the_errors_of_many_calibrations_are_as_large_as_their_sigmas() {
    let truth = camera(Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]));
    let mut sum = [0.0; 4];
    for seed in 0..TRIALS {
        let found = solved(&truth, 0.1, None, seed);
        let sigma = [found.sigma.fx, found.sigma.fy, found.sigma.cx, found.sigma.cy];
        for (i, (got, want)) in found.intrinsics.parameters().iter().zip(truth.parameters()).take(4).enumerate() {
            sum[i] += ((got - want) / sigma[i]).powi(2);
        }
        // 0.1 px per axis is 0.141 px in 2-D, less the share that the unknowns explain (5 %).
        assert!((0.12..0.15).contains(&found.rms_px), "{}", found.rms_px);
    }
    for (i, s) in sum.iter().enumerate() {
        // Chi-squared of 40 degrees of freedom over 40: 1 ± 0.22, at three deviations.
        let ratio = s / TRIALS as f64;
        assert!((0.4..1.7).contains(&ratio), "parameter {i}: {ratio}");
    }
}

#[test]
fn both_figures_of_a_view_follow_from_its_residuals() {
    let truth = camera(Distortion::None);
    let found = solved(&truth, 0.1, None, 1);
    let all: f64 = found.views.iter().map(|v| v.rms_px.powi(2)).sum::<f64>() / found.views.len() as f64;
    assert!((all.sqrt() - found.rms_px).abs() < 1e-12);
    for view in &found.views {
        assert!((view.norm_per_corner_px * 70f64.sqrt() - view.rms_px).abs() < 1e-12);
    }
    assert_eq!(found.camera_from_target.len(), 15);
}

#[test]
fn too_few_views_are_refused() {
    let views = views(&camera(Distortion::None), 2, (0.2, 0.7), 0.0, 1);
    let error = calibrate(&views, &TARGET, SIZE, Distortion::None, None).expect_err("too few");
    assert_eq!(error, VisionError::TooFewViews { got: 2, need: 3 });
}

#[test]
fn views_that_all_look_the_same_way_are_refused() {
    for model in [Distortion::None, Distortion::BrownConrady([0.0; 5]), Distortion::Fisheye([0.0; 4])] {
        let truth = camera(Distortion::None);
        let head_on = views(&truth, 8, (0.0, 0.0), 0.05, 1);
        assert!(
            matches!(calibrate(&head_on, &TARGET, SIZE, model, None), Err(VisionError::ParallelViews { views: 8, .. })),
            "{model:?}"
        );
        let one = views(&truth, 1, (0.5, 0.6), 0.05, 1);
        let same = vec![one[0].clone(); 6];
        assert!(
            matches!(calibrate(&same, &TARGET, SIZE, model, None), Err(VisionError::ParallelViews { views: 6, .. })),
            "{model:?}"
        );
    }
}

#[test]
fn a_faint_tilt_is_not_sold_as_a_calibration() {
    // 2.5° of tilt passes for different orientations, but says next to nothing about the focal length.
    let nearly = views(&camera(Distortion::None), 6, (0.04, 0.045), 0.1, 1);
    match calibrate(&nearly, &TARGET, SIZE, Distortion::BrownConrady([0.0; 5]), None) {
        Err(VisionError::Undetermined { .. } | VisionError::NotACamera { .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_bad_view_is_named() {
    let mut all = views(&camera(Distortion::None), 5, (0.2, 0.7), 0.0, 1);
    all[3].clear();
    let error = calibrate(&all, &TARGET, SIZE, Distortion::None, None).expect_err("an empty view");
    assert_eq!(error, VisionError::TooFewCorners { view: 3, got: 0, need: 4 });
    assert!(error.to_string().contains("view 3"));
}
