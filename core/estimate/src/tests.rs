use std::cell::RefCell;

use super::*;
use crate::handeye::joint::PrintErrors;
use handeye_geometry::camera::Distortion;
use handeye_geometry::progress::{CancelToken, Progress};
use handeye_simulate::session::{Cone, REALISTIC, Session, Setup, camera, session, trial};

fn solve(observations: &Observations, method: Method) -> Fit {
    fit(observations, method, &CancelToken::default()).expect("solves")
}

/// Every view counts, however wrong.
fn solve_all(observations: &Observations) -> Fit {
    let keep = Options { keep_outliers: true, ..Options::default() };
    fit_with(observations, Method::Joint, keep, &CancelToken::default()).expect("solves")
}

fn set(views: usize, seed: u64) -> Session {
    trial(Mode::EyeInHand, views, &REALISTIC, camera(), seed)
}

/// Distance in units of the standard deviation, the worst of the twelve numbers of hand-eye and pinhole.
fn off_in_sigmas(a: &Fit, b: &Fit) -> f64 {
    let links = |c: &Fit| c.hand_eye.expect("a robot").mount_from_camera();
    let delta = handeye_geometry::se3::log((links(a).inverse() * links(b)).isometry());
    let covariance = a.hand_eye_covariance().expect("stated");
    let pose = (0..6).map(|i| delta[i].abs() / covariance[(i, i)].sqrt());
    let (ia, ib) = (a.intrinsics().expect("known").parameters(), b.intrinsics().expect("known").parameters());
    let sigma = a.camera.and_then(|camera| camera.sigma_px).unwrap_or([1.0; 4]);
    pose.chain((0..4).map(|i| (ia[i] - ib[i]).abs() / sigma[i])).fold(0.0, f64::max)
}

#[test]
fn a_view_left_out_changes_the_answer_as_if_it_were_not_there() {
    let t = set(12, 51);
    let mut excluded = t.observations(true);
    excluded.views[3].in_fit = false;
    let mut absent = excluded.clone();
    absent.views.remove(3);
    for method in [Method::Joint, Method::ClosedForm("park_martin")] {
        let (a, b) = (solve(&excluded, method), solve(&absent, method));
        assert_eq!(a.hand_eye, b.hand_eye);
        let numbers = |c: &Fit| (c.rms_px, c.joint.as_ref().map(|j| j.heldout_rms_px), c.modelled_error_95_m());
        assert_eq!(numbers(&a), numbers(&b));
        let left_out = &a.views[3];
        assert_eq!((left_out.status, left_out.rms_px, left_out.residuals.len()), (ViewStatus::Excluded, None, 0));
        assert_eq!(a.views[4], b.views[3], "results stay with their views");
    }
}

#[test]
fn residuals_stand_where_corners_were_measured_with_a_lens_beyond_its_model_too() {
    let mut t = set(30, 49);
    t.add_waves(0.2, 300.0);
    let found = solve(&t.observations(true), Method::Joint);
    let shown = found.joint.as_ref().and_then(|joint| joint.residual_distortion.as_ref()).expect("the waves are seen");
    assert!(shown.rms_px > 0.1, "{shown:?}");
    for (view, result) in t.views.iter().zip(&found.views) {
        for (corner, residual) in view.corners.iter().zip(&result.residuals) {
            // The field is taken a little away from the corner, and has a slope of 0.2 px in fifty.
            assert!((corner.px - residual.px).norm() < 5e-3, "{corner:?} {residual:?}");
        }
    }
}

#[test]
fn leaving_out_too_many_views_is_told_apart_from_a_target_that_was_not_found() {
    let mut observations = set(5, 52).observations(false);
    for view in &mut observations.views[..3] {
        view.in_fit = false;
    }
    let error = fit(&observations, Method::Joint, &CancelToken::default()).expect_err("too few");
    assert!(matches!(error, CalibrateError::TooFewLeft { left: 2, excluded: 3, need: 3 }), "{error}");
    for view in &mut observations.views[1..] {
        (view.in_fit, view.corners) = (true, None);
    }
    observations.views[0].in_fit = true;
    let error = fit(&observations, Method::Joint, &CancelToken::default()).expect_err("not found");
    assert!(matches!(error, CalibrateError::TargetNotFound { found: 1, images: 5, .. }), "{error}");
}

#[test]
fn residuals_add_up_to_the_rms_and_point_from_the_prediction_to_the_measurement() {
    let t = set(10, 53);
    let observations = t.observations(false);
    let mut camera_only = observations.clone();
    camera_only.mode = None;
    let closed = Method::ClosedForm("daniilidis");
    for c in [solve(&observations, Method::Joint), solve(&observations, closed), solve(&camera_only, Method::Joint)] {
        for (view, observed) in c.views.iter().zip(&t.views) {
            assert_eq!(view.residuals.len(), observed.corners.len());
            let squares: f64 = view.residuals.iter().map(|r| r.residual_px.norm_squared()).sum();
            let rms = (squares / view.residuals.len() as f64).sqrt();
            assert!((rms - view.rms_px.expect("used")).abs() < 1e-9);
            let pose = view.camera_from_target.expect("fitted");
            for (r, corner) in view.residuals.iter().zip(&observed.corners) {
                assert_eq!((r.index, r.px), (corner.index, corner.px));
                let predicted = t.intrinsics.project(&(pose.isometry() * t.points[r.index])).expect("in front");
                assert!((predicted + r.residual_px - r.px).norm() < 1e-9);
            }
        }
    }
}

#[test]
fn the_correction_of_a_view_is_the_error_that_its_robot_pose_was_given() {
    // Along the line of sight and about it, where no translation looks like a rotation. The twelve shared unknowns take a
    // tenth of the 120 numbers that the robot reports, and about as much of the error of one view.
    let solved_with = |metres: f64, radians: f64| {
        let mut t = set(20, 54);
        let sight = t.mount_from_camera.rotation() * nalgebra::Vector3::z();
        let (along, about) = (sight * metres, sight * radians);
        let wrong = nalgebra::Vector6::new(along.x, along.y, along.z, about.x, about.y, about.z);
        t.views[7].base_from_tip = t.views[7].base_from_tip.perturbed(&wrong);
        let view = solve_all(&t.observations(false)).views[7].clone();
        (view.correction_m.expect("joint"), view.correction_rad.expect("joint").to_degrees())
    };
    let (metres, _) = solved_with(0.01, 0.0);
    assert!((metres - 0.01).abs() < 2e-3, "{metres}");
    let (_, degrees) = solved_with(0.0, 2f64.to_radians());
    assert!((degrees - 2.0).abs() < 0.4, "{degrees}");
    let closed = solve(&set(20, 54).observations(false), Method::ClosedForm("shah"));
    assert!(closed.views.iter().all(|v| v.correction_m.is_none() && v.correction_rad.is_none()));
}

#[test]
fn starting_the_camera_from_a_choice_of_views_leaves_the_joint_answer_where_it_is() {
    // 80 views: the camera starts from thirty of them, and in the second run from thirty others and a focal length given.
    let t = set(80, 55);
    let chosen = t.observations(true);
    let a = solve(&chosen, Method::Joint);
    let mut from_all = chosen.clone();
    let start = Intrinsics { fx: a.intrinsics().expect("known").fx * 1.003, ..camera() };
    from_all.camera = CameraKnowledge::Estimate { model: Distortion::None, start: Some(start) };
    from_all.views.rotate_left(17);
    let b = solve(&from_all, Method::Joint);
    assert!(off_in_sigmas(&a, &b) < 1e-3, "{}", off_in_sigmas(&a, &b));
}

#[test]
fn stages_come_in_order_and_each_begins_with_nothing_done() {
    let observations = set(8, 56).observations(true);
    let seen: RefCell<Vec<Progress>> = RefCell::default();
    let cancel = CancelToken::default();
    let work = Work { cancel: &cancel, progress: &|p| seen.borrow_mut().push(p) };
    fit(&observations, Method::Joint, work).expect("solves");
    let seen = seen.into_inner();
    let mut stages: Vec<Stage> = seen.iter().map(|p| p.stage).collect();
    stages.dedup();
    let expected =
        [Stage::Intrinsics, Stage::TargetPoses, Stage::ClosedForms, Stage::Joint, Stage::HeldOut, Stage::Prediction];
    assert_eq!(stages, expected);
    for stage in stages {
        let of_stage: Vec<_> = seen.iter().filter(|p| p.stage == stage).collect();
        assert_eq!(of_stage[0].done, 0);
        assert!(of_stage.windows(2).all(|w| w[0].done < w[1].done && w[1].done <= w[1].of), "{stage:?}");
    }
}

#[test]
fn every_stage_ends_when_it_is_cancelled() {
    let observations = set(8, 57).observations(true);
    let stages =
        [Stage::Intrinsics, Stage::TargetPoses, Stage::ClosedForms, Stage::Joint, Stage::HeldOut, Stage::Prediction];
    for stage in stages {
        let cancel = CancelToken::default();
        let later = RefCell::new(false);
        let progress = |p: Progress| {
            if p.stage == stage {
                cancel.cancel();
            }
            if p.stage > stage {
                *later.borrow_mut() = true;
            }
        };
        let result = fit(&observations, Method::Joint, Work { cancel: &cancel, progress: &progress });
        assert!(matches!(result, Err(CalibrateError::HandEye(HandEyeError::Cancelled))), "{stage:?}: {result:?}");
        assert!(!later.into_inner(), "{stage:?} went on");
    }
}

#[test]
fn of_many_views_the_closed_forms_see_a_choice_and_the_joint_estimate_all() {
    let mut t = set(160, 58);
    let chosen = subset::spread(160, subset::MOST_VIEWS);
    let other = (0..160).find(|i| !chosen.contains(i)).expect("ten are not chosen");
    let before = solve_all(&t.observations(false));
    t.views[other].base_from_tip = t.views[other].base_from_tip.perturbed(&nalgebra::Vector6::repeat(0.01));
    let after = solve_all(&t.observations(false));
    assert_eq!(before.methods, after.methods);
    assert_ne!(before.hand_eye, after.hand_eye);
    assert!(after.views[other].correction_m > before.views[other].correction_m.map(|m| m + 0.005));
}

#[test]
fn a_wrong_view_is_an_outlier_and_changes_nothing_and_can_be_kept() {
    let healthy = set(12, 60);
    let mut t = set(12, 60);
    t.views[5].base_from_tip = t.views[5].base_from_tip.perturbed(&nalgebra::Vector6::repeat(0.02));
    let c = solve(&t.observations(true), Method::Joint);
    assert_eq!(c.views[5].status, ViewStatus::Outlier);
    let distance = c.views[5].distance.expect("judged");
    assert!(distance.of_limit > 1.0 && distance.metres > 0.01, "{distance:?}");
    assert!(c.views[5].influence_m.is_none() && c.views[5].rms_px > Some(5.0));
    let mut without = healthy.observations(true);
    without.views[5].in_fit = false;
    assert!(off_in_sigmas(&c, &solve(&without, Method::Joint)) < 0.05);
    let kept = solve_all(&t.observations(true));
    assert_eq!(kept.views[5].status, ViewStatus::Used);
    assert!(kept.modelled_error_95_m() > c.modelled_error_95_m().map(|e| 3.0 * e), "its noise is counted");
}

#[test]
fn a_bent_target_is_found_and_the_answer_allows_for_it() {
    // 3 mm over 135 mm, the noise of a good robot. The flat model is off by many times what it states.
    let mut t = set(20, 61);
    let bent = handeye_geometry::targets::bent::BoardShape { warp_m: [0.003, 0.001], scale: 1.0 };
    for (view, pose) in t.views.iter_mut().zip(&t.true_camera_from_target) {
        for corner in &mut view.corners {
            let flat = t.intrinsics.project(&(pose.isometry() * t.points[corner.index])).expect("in front");
            let point = t.board.point(corner.index, &bent);
            corner.px += t.intrinsics.project(&(pose.isometry() * point)).expect("in front") - flat;
        }
    }
    let c = solve(&t.observations(true), Method::Joint);
    let found = c.joint.expect("joint").shape.expect("bent");
    let sigma = found.warp_sigma_m.expect("estimated");
    for ((found_m, bent_m), sigma) in found.shape.warp_m.iter().zip(bent.warp_m).zip(sigma) {
        assert!((found_m - bent_m).abs() < 4.0 * sigma && sigma < 1e-4, "{found:?}");
    }
    let error = c.hand_eye.expect("a robot").mount_from_camera().distance_to(&t.mount_from_camera).0;
    assert!(error < 1e-3, "{error} m");
    let flat = solve(&set(20, 61).observations(true), Method::Joint);
    assert!(flat.joint.expect("joint").shape.is_none(), "a flat target is taken as flat");
}

#[test]
fn a_board_drawn_on_the_pixels_of_a_bitmap_is_no_bent_one_and_no_other_lens() {
    let (mut sessions, pixel_m) = (0, 4e-4);
    for seed in 0..5 {
        let mut t = set(15, 6400 + seed);
        let on_pixel = |m: f64| (m / pixel_m + 0.37 * seed as f64).round() * pixel_m - m;
        let errors: Vec<_> = t.points.iter().map(|p| Vector2::new(on_pixel(p.x), on_pixel(p.y))).collect();
        t.add_print_errors(&errors);
        let joint = solve(&t.observations(true), Method::Joint).joint.expect("joint");
        let print = joint.print.expect("seen");
        // A twelfth of the square of a pixel, except for a shift of all points.
        assert!((print.rms_m() / (pixel_m / 12_f64.sqrt()) - 1.0).abs() < 0.5, "{}", print.rms_m());
        sessions += usize::from(joint.shape.is_some() || joint.residual_distortion.is_some());
    }
    // One flat target in a thousand is found bent by chance, and one lens in a hundred beyond its model.
    assert_eq!(sessions, 0, "sessions with another target or lens");
}

#[test]
fn the_size_of_the_target_is_found_when_it_is_asked_for() {
    let mut t = set(20, 62);
    let large = handeye_geometry::targets::bent::BoardShape {
        scale: 1.02,
        ..handeye_geometry::targets::bent::BoardShape::default()
    };
    for (view, pose) in t.views.iter_mut().zip(&t.true_camera_from_target) {
        for corner in &mut view.corners {
            let stated = t.intrinsics.project(&(pose.isometry() * t.points[corner.index])).expect("in front");
            let point = t.board.point(corner.index, &large);
            corner.px += t.intrinsics.project(&(pose.isometry() * point)).expect("in front") - stated;
        }
    }
    let options = Options { free_scale: true, ..Options::default() };
    let observations = t.observations(false);
    let c = fit_with(&observations, Method::Joint, options, &CancelToken::default()).expect("solves");
    let found = c.joint.expect("joint").shape.expect("estimated");
    let sigma = found.scale_sigma.expect("estimated");
    assert!((found.shape.scale - 1.02).abs() < 4.0 * sigma && sigma < 2e-3, "{found:?}");
}

/// With a target that is always seen the same way, what is smooth over the image is smooth over the target, too.
#[test]
fn what_the_lens_does_beyond_its_model_is_not_taken_for_the_print() {
    for (seed, amplitude_px) in (900..906).flat_map(|seed| [(seed, 0.2), (seed, 0.3)]) {
        let cone = Cone { roll_deg: 10.0, beside_m: 0.01, ..Cone::PUBLISHED };
        let mut truth = session(&Setup { cone, ..Setup::new(Mode::EyeInHand, 8, seed) });
        truth.add_waves(amplitude_px, 500.0);
        let fit = solve(&truth.observations(true), Method::Joint);
        let joint = fit.joint.as_ref().expect("of the joint estimate");
        assert!(joint.print.is_none(), "{seed}, {amplitude_px} px: {:?}", joint.print.as_ref().map(PrintErrors::rms_m));
        assert!(joint.residual_distortion.is_some(), "{seed}, {amplitude_px} px");
    }
}
