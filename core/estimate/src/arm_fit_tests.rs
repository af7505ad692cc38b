use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::View;
use handeye_simulate::session::{ArmError, Setup, session};

use super::*;
use crate::diagnose::findings::{FindingCode, FindingOptions, Severity, findings};
use crate::diagnose::{Calibration, calibrate};
use crate::handeye::Mode;
use crate::handeye::joint::camera_from_target;
use crate::stated_uncertainty::StatedUncertainty;
use crate::test_sessions::OFF_LINKS;
use crate::{Fit, Method, fit as calibrated};

/// RMS of the residuals of views that were not in the fit, pixels, by reported poses and by corrected ones.
fn predicted(of: &Setup, fitted: usize) -> (ArmFit, [f64; 2]) {
    let all = session(of);
    let mut observations = all.observations(false);
    observations.views.truncate(fitted);
    let fit = calibrated(&observations, Method::Joint, &CancelToken::default()).expect("solves");
    let arm = fit.joint.as_ref().and_then(|joint| joint.arm.clone()).expect("the joints are known");
    let squares = |view: &View, hand_eye: &HandEye, pose| -> f64 {
        let (x, y) = (hand_eye.mount_from_camera(), hand_eye.anchor_from_target());
        let seen = camera_from_target(all.mode, &pose, &x, &y);
        let off = |corner: &handeye_geometry::targets::observation::Corner| {
            let px = all.intrinsics.project(&(seen.isometry() * all.points[corner.index])).expect("in front");
            (px - corner.px).norm_squared()
        };
        view.corners.iter().map(off).sum::<f64>() / view.corners.len() as f64
    };
    let rest = &all.views[fitted..];
    let mean = |of: &dyn Fn(&View) -> f64| (rest.iter().map(of).sum::<f64>() / rest.len() as f64).sqrt();
    let plain = fit.hand_eye.expect("an answer");
    let reported = mean(&|view: &View| squares(view, &plain, view.base_from_tip));
    let corrected = mean(&|view: &View| {
        let tip = arm.errors.of_view(view).reported_from_true;
        squares(view, &arm.hand_eye, Pose::from_isometry(view.base_from_tip.isometry() * tip))
    });
    (arm, [reported, corrected])
}

fn with(mode: Mode, arm_error: ArmError, seed: u64) -> Setup {
    // A robot that repeats well, as industrial ones do.
    let noise = Noise { corner_px: 0.1, robot_m: 2e-5, robot_rad: 1e-4, ..Noise::EXACT };
    Setup { joints: true, arm_error, noise, ..Setup::new(mode, 40, seed) }
}

#[test]
fn corrected_poses_predict_what_reported_ones_do_not() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (arm, [reported, corrected]) = predicted(&with(mode, ArmError::Links(OFF_LINKS), 5), 20);
        println!("{mode:?}: {reported:.3} → {corrected:.3} px, levels {:?}", arm.noise);
        // The noise of corners and robot alone gives 0.15 to 0.2 px.
        assert!(corrected < 0.8 * reported && corrected < 0.3, "{mode:?}: {reported} → {corrected} px");
        let [before, after] = arm.heldout_px.expect("twenty views");
        assert!(after < before && !arm.contradicted, "{mode:?}: {before} → {after} px");
    }
}

#[test]
fn the_error_of_a_camera_on_an_arm_counts_what_the_arm_is_off_and_more_views_are_not_asked_for() {
    let cancel = CancelToken::default();
    let wanted = FindingOptions::with_goal_mm(Some(0.05));
    let of = |arm_error| {
        let observations = session(&with(Mode::EyeInHand, arm_error, 5)).observations(false);
        // Nothing else that was found is counted.
        let calibration = Calibration::as_modelled(calibrated(&observations, Method::Joint, &cancel).expect("solves"));
        let found = findings(&observations, Some(&calibration), &wanted);
        let goal = found.into_iter().find(|finding| finding.code == FindingCode::GoalNotReached);
        (calibration, goal.map(|finding| finding.to_string()).unwrap_or_default())
    };
    let links = OFF_LINKS.map(|row| row.map(|value| 4.0 * value));
    let ((off, stated_off), (exact, stated_exact)) = (of(ArmError::Links(links)), of(ArmError::None));
    let (by_noise, stated) = (off.modelled_error_95_m().expect("joint"), off.tip_error_95_m().expect("joint"));
    let apart = off.moved_by_arm_m().expect("the links are off");
    assert!(stated > apart && stated > by_noise, "{apart} {by_noise} {stated}");
    let covariances = off.link_covariances().expect("joint");
    assert!(covariances.hand_eye.trace() > off.hand_eye_covariance().expect("joint").trace());
    assert!(stated_off.contains("errors of the arm"), "{stated_off}");
    assert_eq!(exact.moved_by_arm_m(), None);
    assert!(!stated_exact.contains("errors of the arm"), "{stated_exact}");
}

#[test]
fn what_changes_with_the_place_and_is_no_error_of_a_link_is_corrected_too() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let exact = with(mode, ArmError::None, 5);
        let noise = Noise { field_m: 1e-3, field_rad: 1e-3, ..exact.noise };
        let (arm, [reported, corrected]) = predicted(&Setup { noise, ..exact }, 20);
        println!("{mode:?}: {reported:.3} → {corrected:.3} px, levels {:?}", arm.noise);
        assert!(arm.errors.field().is_some(), "{mode:?}");
        assert!(corrected < 0.5 * reported && !arm.contradicted, "{mode:?}: {reported} → {corrected} px");
        let (of_links, _) = predicted(&with(mode, ArmError::Links(OFF_LINKS), 5), 20);
        assert!(of_links.errors.field().is_none(), "{mode:?}: links explain all that they do");
    }
}

#[test]
fn an_exact_arm_is_left_as_it_is() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (arm, [reported, corrected]) = predicted(&with(mode, ArmError::None, 6), 20);
        println!("{mode:?}: {reported:.3} → {corrected:.3} px");
        assert!(corrected < 1.1 * reported, "{mode:?}: {reported} → {corrected} px");
        assert!(!arm.contradicted, "{mode:?}");
    }
}

#[test]
fn views_that_do_not_know_their_joints_have_no_arm() {
    let session = session(&Setup::new(Mode::EyeInHand, 12, 7));
    let fit = calibrated(&session.observations(false), Method::Joint, &CancelToken::default()).expect("solves");
    assert!(fit.joint.expect("a joint estimate").arm.is_none());
}

/// What the examination finds in views of an arm whose links are off by some millimetres, taken along rounds as a plan does, with
/// the board slipped in the middle of the session.
fn examined(mode: Mode, slip_m: f64) -> (Vec<FindingCode>, Calibration) {
    let links = OFF_LINKS.map(|row| row.map(|value| 4.0 * value));
    let mut setup = Setup { by_level: true, views: 30, ..with(mode, ArmError::Links(links), 7) };
    if slip_m > 0.0 {
        setup.fault.board_moved = Some((15, [slip_m, 0.0, 0.0, 0.0, 0.0, 0.0].into()));
    }
    let observations = session(&setup).observations(false);
    let calibration = calibrate(&observations, Method::Joint, &CancelToken::default()).expect("solves");
    let warned = calibration.diagnosis().findings.iter().filter(|finding| finding.severity >= Severity::Warning);
    (warned.map(|finding| finding.code).collect(), calibration)
}

#[test]
fn what_the_errors_of_an_arm_explain_is_called_nothing_else_and_a_board_that_slipped_a_millimetre_is_found_beside_them()
{
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (found, calibration) = examined(mode, 0.0);
        assert_eq!(found, [], "{mode:?}");
        let noise = calibration.joint.as_ref().expect("joint").noise;
        let by_poses_m = noise.robot_m.hypot(noise.field_m);
        assert!(by_poses_m > 10.0 * 2e-5, "{mode:?}: what the arm repeats to hides what is off: {noise:?}");
        assert_eq!(*calibration.stated_uncertainty(), StatedUncertainty::AsModelled, "{mode:?}");
        let (found, calibration) = examined(mode, 1e-3);
        assert_eq!(found, [FindingCode::BoardMoved], "{mode:?}");
        // What it moves is part of the stated error; next to the errors of the arm it is less than the slip.
        let (moved_m, error_m) = (calibration.moved_m().expect("it counts on no move"), calibration.tip_error_95_m());
        assert!(error_m.expect("stated") >= moved_m, "{mode:?}: {moved_m} of {error_m:?}");
        let point = calibration.joint.as_ref().expect("joint").reference_point;
        let of_arm_m = calibration.stated_uncertainty().moved_m(&point);
        assert!((1e-5..1e-3).contains(&of_arm_m), "{mode:?}: {of_arm_m}");
    }
}

/// A fit of views of a target that is larger than stated.
fn larger(mode: Mode, by: f64, robot: [f64; 2]) -> Fit {
    let [robot_m, robot_rad] = robot;
    let mut setup = Setup { views: 20, ..with(mode, ArmError::None, 8) };
    setup.noise = Noise { robot_m, robot_rad, ..setup.noise };
    setup.fault.scale = by;
    calibrated(&session(&setup).observations(false), Method::Joint, &CancelToken::default()).expect("solves")
}

#[test]
fn where_another_size_is_not_certain_the_errors_of_the_arm_count_that_it_may_be_the_stated_one() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let of = |fit: &Fit| {
            let arm = fit.arm().expect("the joints are known");
            let shape = arm.shape().filter(|_| arm.others.free.scale).expect("another size is shown");
            ((shape.shape.scale - 1.0).abs(), shape.scale_sigma.expect("estimated"))
        };
        let (off, sigma) = of(&larger(mode, 0.013, [2e-5, 1e-4]));
        assert!(sigma < 0.1 * off, "{mode:?}: {off} ± {sigma}, the board is another one");
        // The scatter of poses that are read in motion.
        let (off, sigma) = of(&larger(mode, 0.03, [1e-3, 7e-3]));
        assert!(sigma > 0.5_f64.sqrt() * off, "{mode:?}: {off} ± {sigma}");
    }
}
