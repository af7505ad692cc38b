use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::{JointSolution, estimate};
use crate::test_sessions::Estimated as _;
use crate::uncertainty::quality;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

fn solve(t: &Session, free_intrinsics: bool) -> JointSolution {
    estimate(&t.problem(free_intrinsics, None), &t.start(), &CancelToken::default()).expect("solves")
}

#[test]
fn with_all_views_the_curve_ends_at_the_stated_error() {
    for (mode, free) in [(Mode::EyeInHand, false), (Mode::EyeInHand, true), (Mode::EyeToHand, true)] {
        let t = trial(mode, 12, &REALISTIC, camera(), 31);
        let solution = solve(&t, free);
        let curve = error_by_views(&t.problem(free, None), &solution, &CancelToken::default()).expect("predicts");
        let stated = quality::tip_error_95_m(&solution);
        let (views, error) = curve.now().expect("known");
        assert_eq!(views, 12);
        // The tolerance is for another order of summation, and a bisection that ends at a millionth.
        assert!((error / stated - 1.0).abs() < 1e-5, "{mode:?} {free}: {error} {stated}");
    }
}

#[test]
fn with_the_first_views_the_curve_says_what_a_solve_of_them_alone_says() {
    // The same noise levels on both sides. The Jacobians are at the estimate from all views on one and from the first on
    // the other: they differ by the error of the estimate over the distance of the board, below a hundredth.
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let t = trial(mode, 20, &REALISTIC, camera(), 32);
        let known = t.problem(false, Some(REALISTIC));
        let solution = estimate(&known, &t.start(), &CancelToken::default()).expect("solves");
        let curve = error_by_views(&known, &solution, &CancelToken::default()).expect("predicts");
        for k in [4, 6, 10, 15] {
            let first = JointProblem { views: &t.views[..k], ..known };
            let alone = estimate(&first, &t.start(), &CancelToken::default()).expect("solves");
            // Stated at the reference point of the whole, as the curve is.
            let covariance = point_error::covariance(&alone.hand_eye_covariance(), &solution.reference_point);
            let stated = point_error::radius_95(&covariance);
            let point = curve.gathered.iter().find(|p| p.views == k).expect("every number of views");
            let predicted = point.tip_error_95_m.expect("determined");
            assert!((predicted / stated - 1.0).abs() < 0.02, "{mode:?} {k}: {predicted} {stated}");
        }
    }
}

#[test]
fn the_extrapolation_is_near_what_more_views_of_the_same_kind_give() {
    // Half of the views predict the error with all. A set is not the average of its first half: over ten sets the mean
    // ratio scatters by a few percent, and a single one by 15 %.
    let mut mean = 0.0;
    for seed in 0..10 {
        let t = trial(Mode::EyeInHand, 40, &REALISTIC, camera(), 400 + seed);
        let known = t.problem(false, Some(REALISTIC));
        let half = JointProblem { views: &t.views[..20], ..known };
        let of_half = estimate(&half, &t.start(), &CancelToken::default()).expect("solves");
        let curve = error_by_views(&half, &of_half, &CancelToken::default()).expect("predicts");
        let predicted = curve.further.last().copied().expect("extrapolates");
        assert_eq!(predicted.views, 40);
        let all = estimate(&known, &t.start(), &CancelToken::default()).expect("solves");
        mean += predicted.tip_error_95_m.expect("known") / quality::tip_error_95_m(&all) / 10.0;
        assert_eq!(curve.views_for(curve.now().expect("known").1 / 2.0), Some(80), "half the error takes four times");
    }
    assert!((mean - 1.0).abs() < 0.1, "{mean}");
}

#[test]
fn two_motions_about_one_axis_leave_the_error_open() {
    let mut t = trial(Mode::EyeInHand, 8, &REALISTIC, camera(), 33);
    let repeated = t.views[0].clone();
    t.views[1] = repeated.clone();
    t.views[2] = repeated;
    let problem = t.problem(false, Some(REALISTIC));
    let solution = estimate(&problem, &t.start(), &CancelToken::default()).expect("solves");
    let curve = error_by_views(&problem, &solution, &CancelToken::default()).expect("predicts");
    let errors: Vec<_> = curve.gathered.iter().map(|p| p.tip_error_95_m).collect();
    assert_eq!(errors[0], None, "three times the same view");
    assert_eq!(errors[1], None, "one motion");
    assert!(errors[2].is_some(), "two motions: {errors:?}");
}

#[test]
fn the_error_of_prediction_is_as_large_as_expected() {
    // Views of the same kind that no fit has seen. 200 predictions share one calibration and have 6 numbers of robot noise
    // each: the ratio of RMS scatters by about 4 %.
    let t = trial(Mode::EyeInHand, 240, &REALISTIC, camera(), 34);
    let known = JointProblem { views: &t.views[..40], ..t.problem(false, Some(REALISTIC)) };
    let solution = estimate(&known, &t.start(), &CancelToken::default()).expect("solves");
    let expected = expected_residuals(&known, &solution, &CancelToken::default()).expect("expects");
    let (mut squares, mut corners) = (0.0, 0usize);
    for view in &t.views[40..] {
        let links = &solution.hand_eye;
        let chain = super::super::camera_from_target(
            Mode::EyeInHand,
            &view.base_from_tip,
            &links.mount_from_camera(),
            &links.anchor_from_target(),
        );
        for corner in &view.corners {
            let px = t.intrinsics.project(&(chain.isometry() * t.points[corner.index])).expect("in front");
            squares += (px - corner.px).norm_squared();
            corners += 1;
        }
    }
    let measured = f64::sqrt(squares / corners as f64);
    println!(
        "prediction {measured:.4} px, expected {:.4} px, robot {:.4} px",
        expected.prediction_px, expected.robot_px
    );
    assert!((measured / expected.prediction_px - 1.0).abs() < 0.12, "{measured} {expected:?}");
    assert!(expected.robot_px < expected.prediction_px);
}

#[test]
fn points_of_a_long_curve_are_spaced_and_end_at_the_last_view() {
    let views = spaced(3, 1000);
    assert_eq!((views.len(), views[0], views[views.len() - 1]), (MOST_POINTS, 3, 1000));
    assert!(views.windows(2).all(|w| w[0] < w[1]));
    assert_eq!(spaced(3, 5), [3, 4, 5]);
    assert_eq!(spaced(3, 3), [3]);
    assert_eq!(spaced(4, 3), [0usize; 0]);
}

#[test]
fn a_solution_of_other_views_is_refused() {
    let t = trial(Mode::EyeInHand, 8, &REALISTIC, camera(), 35);
    let solution = solve(&t, false);
    let other = JointProblem { views: &t.views[..5], ..t.problem(false, None) };
    assert!(matches!(
        error_by_views(&other, &solution, &CancelToken::default()),
        Err(HandEyeError::NoSolution { views: 5, .. })
    ));
}
