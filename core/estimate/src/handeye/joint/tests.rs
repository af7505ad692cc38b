use nalgebra::{Isometry3, Vector3};

use super::*;
use crate::handeye::Mode;
use crate::test_sessions::Estimated as _;
use handeye_geometry::camera::Distortion;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

#[test]
fn exact_data_gives_the_exact_answer_in_both_set_ups() {
    let tiny = Noise { corner_px: 1e-9, robot_m: 0.0, robot_rad: 0.0, ..Noise::EXACT };
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let intrinsics =
            Intrinsics { distortion: Distortion::BrownConrady([-0.1, 0.05, 1e-3, -5e-4, 0.0]), ..camera() };
        let t = trial(mode, 12, &tiny, intrinsics, 5);
        let mut start = t.start();
        start.intrinsics.fx *= 1.01;
        start.intrinsics.distortion = Distortion::BrownConrady([0.0; 5]);
        let solution = estimate(&t.problem(true, None), &start, &CancelToken::default()).expect("solves");
        assert!(t.hand_eye_error(&solution).norm() < 1e-7, "{mode:?}: {}", t.hand_eye_error(&solution));
        assert!((solution.intrinsics.fx - 581.0).abs() < 1e-4);
    }
}

#[test]
fn error_reaches_the_bound_and_the_stated_covariance_is_true() {
    // Mean of eᵀ C⁻¹ e is 6 when the covariance is true; its own spread over 60 trials is sqrt(12 / 60) = 0.45.
    for (mode, seed) in [(Mode::EyeInHand, 100), (Mode::EyeToHand, 200)] {
        let trials = 60;
        let mut mahalanobis = 0.0;
        for k in 0..trials {
            let t = trial(mode, 20, &REALISTIC, camera(), seed + k);
            let solution = estimate(&t.problem(false, None), &t.start(), &CancelToken::default()).expect("solves");
            let e = t.hand_eye_error(&solution);
            let inverse = solution.hand_eye_covariance().try_inverse().expect("regular");
            mahalanobis += (e.transpose() * inverse * e)[0] / trials as f64;
        }
        println!("{mode:?}: mean squared Mahalanobis distance {mahalanobis:.2} of 6");
        assert!((4.65..8.0).contains(&mahalanobis), "{mode:?}: {mahalanobis}");
    }
}

#[test]
fn noise_levels_are_recovered_where_the_data_can_tell_them() {
    // Half a millimetre and a tenth of a degree are well above the effect of 0.1 px of corner noise on a pose. Spread of
    // a standard deviation from 120 numbers, averaged over 20 trials: 1.4 %; three of those, and the loss to the
    // unknowns.
    let noise = Noise { corner_px: 0.1, robot_m: 5e-4, robot_rad: 0.1f64.to_radians(), ..Noise::EXACT };
    let trials = 20;
    let mut mean = Vector3::zeros();
    for k in 0..trials {
        let t = trial(Mode::EyeInHand, 40, &noise, camera(), 300 + k);
        let found = estimate(&t.problem(false, None), &t.start(), &CancelToken::default()).expect("solves").noise;
        mean += Vector3::new(
            found.corner_px / noise.corner_px,
            found.robot_m / noise.robot_m,
            found.robot_rad / noise.robot_rad,
        ) / trials as f64;
    }
    println!("estimated over true noise: {:.3} {:.3} {:.3}", mean.x, mean.y, mean.z);
    assert!((mean.x - 1.0).abs() < 0.01 && (mean.y - 1.0).abs() < 0.06 && (mean.z - 1.0).abs() < 0.06, "{mean}");
}

#[test]
fn estimated_noise_costs_little_against_known_noise() {
    let mut with_known = 0.0;
    let mut with_estimated = 0.0;
    for k in 0..40 {
        let t = trial(Mode::EyeInHand, 10, &REALISTIC, camera(), 900 + k);
        let translation = |noise| {
            let s = estimate(&t.problem(false, noise), &t.start(), &CancelToken::default()).expect("solves");
            t.hand_eye_error(&s).fixed_rows::<3>(0).norm_squared()
        };
        with_known += translation(Some(REALISTIC));
        with_estimated += translation(None);
    }
    let ratio = f64::sqrt(with_estimated / with_known);
    println!("estimated against known noise: {ratio:.3}");
    assert!(ratio < 1.10, "{ratio}");
}

#[test]
fn an_exact_robot_is_recognised() {
    let exact = Noise { corner_px: 0.1, robot_m: 0.0, robot_rad: 0.0, ..Noise::EXACT };
    let t = trial(Mode::EyeInHand, 20, &exact, camera(), 42);
    let solution = estimate(&t.problem(false, None), &t.start(), &CancelToken::default()).expect("solves");
    // The bound of an exact robot at 20 views and 0.1 px is 0.037 mm; with a robot of 0.1 mm it would be 0.21 mm.
    assert!(t.hand_eye_error(&solution).fixed_rows::<3>(0).norm() < 1.5e-4);
    assert!(solution.noise.robot_m < 3e-5, "{:?}", solution.noise);
}

/// A robot taken as exact gives every view the accuracy of its corners: the stated error is then too small.
#[test]
fn a_level_that_vanished_on_the_way_is_found_again() {
    let t = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 3);
    let cancel = CancelToken::default();
    let usual = fit(&t.problem(false, None), &t.start(), &cancel).expect("solves");
    assert!((0.3..3.0).contains(&(usual.noise.robot_m / REALISTIC.robot_m)), "{:?}", usual.noise);
    let vanished = Noise { robot_m: 1e-9, ..usual.noise };
    let found = fit(&t.problem(false, None), &JointStart { noise: Some(vanished), ..t.start() }, &cancel);
    let noise = found.expect("solves").noise;
    // Rounds end when a level changes by a thousandth.
    for (a, b) in [(noise.robot_m, usual.noise.robot_m), (noise.robot_rad, usual.noise.robot_rad)] {
        assert!((a / b - 1.0).abs() < 5e-3, "{noise:?} {:?}", usual.noise);
    }
}

#[test]
fn the_answer_does_not_depend_on_the_order_of_views() {
    let t = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 7);
    let mut reversed = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 7);
    reversed.views.reverse();
    let solve = |t: &Session| estimate(&t.problem(true, None), &t.start(), &CancelToken::default()).expect("solves");
    let (a, b) = (solve(&t), solve(&reversed));
    let (metres, radians) = a.hand_eye.mount_from_camera().distance_to(&b.hand_eye.mount_from_camera());
    // Noise levels converge to a thousandth; the difference from that is far below a micrometre.
    assert!(metres < 1e-6 && radians < 1e-6, "{metres} {radians}");
}

#[test]
fn influence_is_what_leaving_the_view_out_does() {
    let t = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 11);
    let full = estimate(&t.problem(false, Some(REALISTIC)), &t.start(), &CancelToken::default()).expect("solves");
    for left_out in [0, 5, 11] {
        let mut views = t.views.clone();
        views.remove(left_out);
        let problem = JointProblem { views: &views, ..t.problem(false, Some(REALISTIC)) };
        let without = estimate(&problem, &t.start(), &CancelToken::default()).expect("solves");
        let tip = |s: &JointSolution| s.hand_eye.mount_from_camera().isometry() * full.reference_point;
        let moved = (tip(&without) - tip(&full)).norm();
        let stated = full.views[left_out].influence_m.expect("determined");
        assert!((moved - stated).abs() < 0.05 * moved + 1e-6, "view {left_out}: {stated} stated, {moved} measured");
    }
}

#[test]
fn noise_that_views_share_is_none_or_one_that_counts() {
    // A level of zero that rounding left positive would be one more to integrate out.
    for seed in 0..12 {
        let t = trial(Mode::EyeToHand, 8, &REALISTIC, camera(), seed);
        let noise = fit(&t.problem(false, None), &t.start(), &CancelToken::default()).expect("solves").noise;
        assert!(noise.view_px == 0.0 || noise.view_px > NO_VIEW_NOISE * noise.corner_px, "{seed}: {noise:?}");
    }
}

#[test]
fn too_few_views_and_cancelling_are_typed_errors() {
    let t = trial(Mode::EyeInHand, 2, &REALISTIC, camera(), 1);
    let result = estimate(&t.problem(false, None), &t.start(), &CancelToken::default());
    assert!(matches!(result, Err(HandEyeError::TooFewViews { got: 2, need: 3 })));
    let t = trial(Mode::EyeInHand, 5, &REALISTIC, camera(), 1);
    let cancel = CancelToken::default();
    cancel.cancel();
    assert!(matches!(estimate(&t.problem(false, None), &t.start(), &cancel), Err(HandEyeError::Cancelled)));
}

#[test]
fn a_robot_that_only_translates_is_singular_not_a_wrong_answer() {
    let mut t = trial(Mode::EyeInHand, 8, &REALISTIC, camera(), 3);
    let first = *t.views[0].base_from_tip.isometry();
    for (i, view) in t.views.iter_mut().enumerate() {
        let shift = Isometry3::translation(0.004 * i as f64, -0.003 * i as f64, 0.002 * (i % 3) as f64);
        view.base_from_tip = Pose::from_isometry(shift * first);
        let chain =
            camera_from_target(Mode::EyeInHand, &view.base_from_tip, &t.mount_from_camera, &t.anchor_from_target);
        for corner in &mut view.corners {
            corner.px = t.intrinsics.project(&(chain.isometry() * t.points[corner.index])).expect("in front");
        }
    }
    let result = estimate(&t.problem(false, Some(REALISTIC)), &t.start(), &CancelToken::default());
    assert!(matches!(result, Err(HandEyeError::NoSolution { .. })), "{result:?}");
}
