//! A camera without a robot: bent boards, corner errors that neighbours share, wrong corners. The study `camera_alone` does
//! it at length.

use handeye_estimate::diagnose::findings::{Finding, FindingCode, FindingOptions, Severity, findings};
use handeye_estimate::diagnose::{Calibration, calibrate};
use handeye_estimate::{CameraKnowledge, Method, Observations, Options, ViewStatus, fit_with};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::bent::BoardShape;
use handeye_result::CalibrationResult;
use handeye_simulate::{BoardViews, SharedErrors};
use nalgebra::{Matrix2, Vector2};

const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.03 };
/// Number of standard deviations that contain 95 % of a Gaussian's errors.
const HELD: f64 = 1.96;

/// 1280×960 with a focal length of 1400 px.
fn camera() -> Intrinsics {
    let distortion = Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]);
    Intrinsics { distortion, fy: 1398.0, cx: 650.0, cy: 470.0, ..Intrinsics::pinhole(1280, 960, 1400.0) }
}

fn views() -> BoardViews {
    BoardViews { offset_px: (180.0, 120.0), distance_m: (0.7, 1.1), ..BoardViews::new(camera(), GRID, 0.1) }
}

fn solved(observations: &Observations) -> Calibration {
    calibrate(observations, Method::Joint, &CancelToken::default()).expect("calibrates")
}

fn found(observations: &Observations, calibration: &Calibration, code: FindingCode) -> Option<Finding> {
    let all = findings(observations, Some(calibration), &FindingOptions::default());
    all.into_iter().find(|finding| finding.code == code)
}

/// Errors of fx, fy, cx, cy and the standard deviations stated for them.
fn errors(calibration: &Calibration) -> [(f64, f64); 4] {
    let camera_found = calibration.camera.expect("a camera");
    let (found, sigma, truth) = (camera_found.intrinsics, camera_found.sigma_px.expect("stated"), camera());
    let errors = [found.fx - truth.fx, found.fy - truth.fy, found.cx - truth.cx, found.cy - truth.cy];
    std::array::from_fn(|i| (errors[i], sigma[i]))
}

#[test]
fn a_bent_board_is_named_with_its_bend_and_leaves_the_focal_length_where_it_is() {
    let warp_m = [0.003, -0.002];
    for seed in 0..4 {
        let bent = BoardViews { shape: BoardShape { warp_m, scale: 1.0 }, ..views() };
        let observations = bent.observations(15, seed);
        let calibration = solved(&observations);
        for (i, (error, sigma)) in errors(&calibration).into_iter().enumerate() {
            // Four seeds and four numbers: four standard deviations are exceeded by chance in one of a thousand runs.
            assert!(error.abs() < 4.0 * sigma, "seed {seed}, {i}: {error} ± {sigma}");
            assert!(sigma < 3.0, "seed {seed}, {i}: a flat model is off by 60 px, ± {sigma} says nothing");
        }
        let finding = found(&observations, &calibration, FindingCode::BoardBent).expect("it is named");
        assert_eq!(finding.severity, Severity::Advice);
        let result = CalibrationResult::of(&calibration, "test", None, [].into());
        result.check().expect("a sound document");
        let board = result.estimate.expect("details").board.expect("the bend");
        let sigma = board.warp_sigma_mm.expect("and its uncertainty");
        for (i, names) in [["warp_x", "warp_x_sigma"], ["warp_y", "warp_y_sigma"]].into_iter().enumerate() {
            assert_eq!(names.map(|name| finding.value(name)), [Some(board.warp_mm[i]), Some(sigma[i])]);
            assert!((board.warp_mm[i] - 1e3 * warp_m[i]).abs() < 4.0 * sigma[i], "{board:?}");
            assert!(sigma[i] < 0.3, "{board:?}");
        }
        assert_eq!((board.scale, board.scale_sigma), (1.0, None), "its size is not seen");
    }
}

#[test]
fn a_flat_board_is_not_called_bent_whatever_its_corners_have_in_common() {
    // With independent corner errors 58 of 100 such sessions would show a bend.
    let shared = Some(SharedErrors { part: 1.0, reach: 3.0 });
    for seed in 0..25 {
        let observations = BoardViews { shared, ..views() }.observations(10, seed);
        let calibration = solved(&observations);
        assert_eq!(found(&observations, &calibration, FindingCode::BoardBent), None, "seed {seed}");
        assert_eq!(calibration.camera_fit.and_then(|fit| fit.shape), None, "seed {seed}");
    }
}

#[test]
fn what_is_stated_holds_when_neighbouring_corners_err_alike() {
    const SESSIONS: u64 = 30;
    let shared = Some(SharedErrors { part: 1.0, reach: 3.0 });
    let mut held = 0;
    for seed in 0..SESSIONS {
        let calibration = solved(&BoardViews { shared, ..views() }.observations(8, 100 + seed));
        held += errors(&calibration).iter().filter(|(error, sigma)| error.abs() <= HELD * sigma).count();
        let fit = calibration.camera_fit.expect("estimated");
        assert!(fit.times > 1.5, "seed {seed}: the scatter of the views shows it, {fit:?}");
    }
    // 120 numbers, of which sixty or so are independent: 95 ± 2.8 %, and three of these; independent errors cover 34 %.
    assert!(held as f64 > 0.865 * 4.0 * SESSIONS as f64, "{held}");
}

#[test]
fn a_few_wrong_corners_are_named_and_change_nothing() {
    let clean = views().observations(12, 7);
    let mut observations = clean.clone();
    let wrong =
        [(3, 0, Vector2::new(300.0, -200.0)), (3, 44, Vector2::new(-6.0, 9.0)), (8, 69, Vector2::new(0.0, 2.0))];
    for (view, index, off) in wrong {
        observations.views[view].corners.as_mut().expect("corners")[index].px += off;
    }
    let mut without = clean;
    for (view, index, _) in wrong {
        without.views[view].corners.as_mut().expect("corners").retain(|corner| corner.index != index);
    }
    let (calibration, expected) = (solved(&observations), solved(&without));
    for (i, view) in calibration.views.iter().enumerate() {
        let named: Vec<usize> = wrong.iter().filter(|(v, ..)| *v == i).map(|(_, index, _)| *index).collect();
        assert_eq!((view.status, &view.rejected_corners), (ViewStatus::Used, &named), "view {i}");
        assert_eq!(view.residuals.len(), GRID.len() - named.len());
    }
    for ((error, sigma), (expected, _)) in errors(&calibration).into_iter().zip(errors(&expected)) {
        // Two descents to one optimum.
        assert!((error - expected).abs() < 1e-3 * sigma, "{error} {expected} ± {sigma}");
    }
    assert!(found(&observations, &calibration, FindingCode::OutlierCorners).is_some());
    let all = Options { keep_outliers: true, ..Options::default() };
    let kept = fit_with(&observations, Method::Joint, all, &CancelToken::default()).expect("calibrates");
    assert!(kept.views.iter().all(|view| view.rejected_corners.is_empty()));
    assert!(kept.rms_px > Some(5.0), "{:?}", kept.rms_px);
}

#[test]
fn corners_count_by_what_their_detector_states() {
    let (mut by_statement, mut alike) = (0.0, 0.0);
    for seed in 0..6 {
        let mut observations = views().observations(8, 40 + seed);
        // Every other corner is ten times as noisy, as shown by the difference to another draw of the same scene.
        let louder = BoardViews { noise_px: 1.0, ..views() }.observations(8, 40 + seed);
        for (view, loud) in observations.views.iter_mut().zip(&louder.views) {
            let corners = view.corners.as_mut().expect("corners").iter_mut();
            for (corner, loud) in corners.zip(loud.corners.as_ref().expect("corners")) {
                let noisy = corner.index % 2 == 0;
                corner.px = if noisy { loud.px } else { corner.px };
                corner.covariance_px2 = Some(Matrix2::identity() * if noisy { 1.0 } else { 0.01 });
            }
        }
        by_statement += errors(&solved(&observations))[0].0.powi(2);
        for corner in observations.views.iter_mut().flat_map(|view| view.corners.as_mut().expect("corners")) {
            corner.covariance_px2 = None;
        }
        alike += errors(&solved(&observations))[0].0.powi(2);
    }
    // The common tenth of the variance leaves a sixth of the noise's square; chance in six sessions the rest.
    assert!(by_statement < 0.5 * alike, "{by_statement} {alike}");
}

#[test]
fn a_lens_that_is_given_says_nothing_of_a_bend() {
    let bent = BoardViews { shape: BoardShape { warp_m: [0.003, -0.002], scale: 1.0 }, ..views() };
    let observations = Observations { camera: CameraKnowledge::Fixed(camera()), ..bent.observations(10, 1) };
    let calibration = solved(&observations);
    assert_eq!(calibration.camera_fit, None);
    assert!(calibration.camera.expect("given").fixed);
}
