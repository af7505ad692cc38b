use super::*;
use handeye_geometry::planar_pose::PoseError;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::observation::Corner;
use handeye_simulate::BoardViews;

const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.03 };
const TARGET: TargetSpec = TargetSpec::Chessboard(GRID);
const SIZE: (u32, u32) = (640, 480);
const TRIALS: u64 = 40;

fn camera(distortion: Distortion) -> Intrinsics {
    Intrinsics { distortion, fy: 575.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(640, 480, 581.0) }
}

/// Views tilted by up to `tilt` around directions all around.
fn views(camera: &Intrinsics, count: usize, tilt: (f64, f64), noise_px: f64, seed: u64) -> Vec<Vec<Corner>> {
    BoardViews { tilt, ..BoardViews::new(*camera, GRID, noise_px) }.corners(count, seed)
}

fn calibrate(views: &[Vec<Corner>], model: Distortion, start: Option<Intrinsics>) -> Result<Found, IntrinsicsError> {
    let seen: Vec<SeenView<'_>> = views.iter().map(|view| SeenView::unweighted(view)).collect();
    solve(&seen, &TARGET, SIZE, &Options { start, ..Options::new(model) }, &CancelToken::default())
}

fn solved(camera: &Intrinsics, noise_px: f64, guess: Option<Intrinsics>, seed: u64) -> Found {
    let views = views(camera, 15, (0.2, 0.7), noise_px, seed);
    calibrate(&views, camera.distortion, guess).expect("calibrates")
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
            assert!(found.total_rms_px() < 1e-8, "{distortion:?}: {}", found.total_rms_px());
        }
    }
}

#[test]
fn the_rational_model_explains_its_own_corners() {
    // Its eight coefficients trade against one another, so the fit is judged by where it puts pixels.
    let truth = camera(Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]));
    let found = solved(&truth, 0.0, None, 2);
    assert!(found.total_rms_px() < 2e-3, "{}", found.total_rms_px());
    assert!((found.intrinsics.fx - truth.fx).abs() < 0.5, "{:?}", found.intrinsics);
}

#[test]
fn the_errors_of_many_calibrations_are_as_large_as_their_sigmas() {
    let truth = camera(Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]));
    let mut sum = [0.0; 4];
    for seed in 0..TRIALS {
        let found = solved(&truth, 0.1, None, seed);
        let sigma = found.stated.pinhole_sigma_px;
        for (i, (got, want)) in found.intrinsics.parameters().iter().zip(truth.parameters()).take(4).enumerate() {
            sum[i] += ((got - want) / sigma[i]).powi(2);
        }
        // 0.1 px per axis is 0.141 px in 2-D, less the share that the unknowns explain (5 %).
        assert!((0.12..0.15).contains(&found.total_rms_px()), "{}", found.total_rms_px());
    }
    for (i, s) in sum.iter().enumerate() {
        // Chi-squared of 40 degrees of freedom over 40: 1 ± 0.22, at three deviations.
        let ratio = s / TRIALS as f64;
        assert!((0.4..1.7).contains(&ratio), "parameter {i}: {ratio}");
    }
}

#[test]
fn the_error_of_all_views_follows_from_those_of_each() {
    let found = solved(&camera(Distortion::None), 0.1, None, 1);
    let all: f64 = found.rms_px.iter().map(|rms| rms.powi(2)).sum::<f64>() / found.rms_px.len() as f64;
    assert!((all.sqrt() - found.total_rms_px()).abs() < 1e-12);
    assert_eq!(found.camera_from_target.len(), 15);
}

#[test]
fn too_few_views_are_refused() {
    let views = views(&camera(Distortion::None), 2, (0.2, 0.7), 0.0, 1);
    let error = calibrate(&views, Distortion::None, None).expect_err("too few");
    assert_eq!(error, IntrinsicsError::TooFewViews { got: 2, need: 3 });
}

#[test]
fn views_that_all_look_the_same_way_are_refused() {
    for model in [Distortion::None, Distortion::BrownConrady([0.0; 5]), Distortion::Fisheye([0.0; 4])] {
        let truth = camera(Distortion::None);
        let head_on = views(&truth, 8, (0.0, 0.0), 0.05, 1);
        assert!(
            matches!(calibrate(&head_on, model, None), Err(IntrinsicsError::ParallelViews { views: 8, .. })),
            "{model:?}"
        );
        let one = views(&truth, 1, (0.5, 0.6), 0.05, 1);
        let same = vec![one[0].clone(); 6];
        assert!(
            matches!(calibrate(&same, model, None), Err(IntrinsicsError::ParallelViews { views: 6, .. })),
            "{model:?}"
        );
    }
}

#[test]
fn a_faint_tilt_is_not_sold_as_a_calibration() {
    // 2.5° of tilt passes for different orientations, but hardly determines the focal length.
    let nearly = views(&camera(Distortion::None), 6, (0.04, 0.045), 0.1, 1);
    match calibrate(&nearly, Distortion::BrownConrady([0.0; 5]), None) {
        Err(IntrinsicsError::Undetermined { .. } | IntrinsicsError::NotACamera { .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_bad_view_is_named() {
    let mut all = views(&camera(Distortion::None), 5, (0.2, 0.7), 0.0, 1);
    all[3].clear();
    let error = calibrate(&all, Distortion::None, None).expect_err("an empty view");
    assert_eq!(error, PoseError::TooFewCorners { view: 3, got: 0, need: 4 }.into());
    assert!(error.to_string().contains("view 3"));
}
