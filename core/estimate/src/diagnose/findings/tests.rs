use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3, Vector6};

use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::Noise;
use crate::{CameraKnowledge, Method, Options, fit, fit_with};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};
use handeye_wording::Text;

fn solve(observations: &Observations) -> Calibration {
    Calibration::as_modelled(fit(observations, Method::Joint, &CancelToken::default()).expect("solves"))
}

fn of_trial(t: &Session, free: bool, options: &FindingOptions) -> Vec<Finding> {
    let observations = t.observations(free);
    findings(&observations, Some(&solve(&observations)), options)
}

/// The findings for a user who keeps views that do not fit.
fn of_all_views(t: &Session) -> Vec<Finding> {
    let observations = t.observations(false);
    let keep = Options { keep_outliers: true, ..Options::default() };
    let fit = fit_with(&observations, Method::Joint, keep, &CancelToken::default()).expect("solves");
    let calibration = Calibration::as_modelled(fit);
    findings(&observations, Some(&calibration), &FindingOptions::default())
}

fn find(found: &[Finding], code: FindingCode) -> Option<&Finding> {
    found.iter().find(|f| f.code == code)
}

fn set(views: usize, seed: u64) -> Session {
    trial(Mode::EyeInHand, views, &REALISTIC, camera(), seed)
}

/// Robot poses turned about one axis of the tip by up to `about` and about another by up to `across`, in degrees.
fn turned(mut t: Session, about: &Vector3<f64>, about_deg: f64, across: &Vector3<f64>, across_deg: f64) -> Session {
    let first = *t.views[0].base_from_tip.isometry();
    let n = t.views.len() as f64;
    for (i, view) in t.views.iter_mut().enumerate() {
        let part = 2.0 * i as f64 / (n - 1.0) - 1.0;
        let wave = (7.0 * part).sin();
        let turn = UnitQuaternion::from_scaled_axis(about * (about_deg * part).to_radians())
            * UnitQuaternion::from_scaled_axis(across * (across_deg * wave).to_radians());
        view.base_from_tip = Pose::from_isometry(first * Isometry3::from_parts(Translation3::identity(), turn));
    }
    t
}

#[test]
fn a_good_session_has_no_warning_and_says_when_the_goal_is_reached() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let t = trial(mode, 30, &REALISTIC, camera(), 81);
        let found = of_trial(&t, false, &FindingOptions::with_goal_mm(Some(1.0)));
        let bad: Vec<_> = found.iter().filter(|f| f.severity > Severity::Advice).collect();
        assert!(bad.is_empty(), "{mode:?}: {bad:?}");
        let reached = find(&found, FindingCode::GoalReached).expect("below a millimetre");
        assert!(reached.to_string().contains("Good enough"));
        assert!(reached.value("expected_error_95").expect("stated") < 1.0);
    }
}

#[test]
fn the_views_that_a_goal_takes_are_those_that_reach_it() {
    // The error over 1.95 takes 3.8 times the ten views, so 28 or 29 more.
    let t = set(10, 82);
    let observations = t.observations(false);
    let calibration = solve(&observations);
    let goal_mm = calibration.tip_error_95_m().expect("joint") * 1e3 / 1.95;
    let found = findings(&observations, Some(&calibration), &FindingOptions::with_goal_mm(Some(goal_mm)));
    let finding = find(&found, FindingCode::GoalNotReached).expect("above");
    let more = finding.value("more_views").expect("within reach");
    assert!((28.0..=29.0).contains(&more), "{more}");
    let found = findings(&observations, Some(&calibration), &FindingOptions::with_goal_mm(Some(goal_mm / 10.0)));
    let finding = find(&found, FindingCode::GoalNotReached).expect("above");
    assert_eq!(finding.value("more_views"), None, "four hundred times the views are no advice: {finding}");
    let found = findings(&observations, Some(&calibration), &FindingOptions::default());
    assert!(!found.iter().any(|f| matches!(f.code, FindingCode::GoalReached | FindingCode::GoalNotReached)));
}

#[test]
fn too_few_views_are_a_problem_below_three_and_advice_below_ten() {
    let mut observations = set(12, 83).observations(false);
    assert!(find(&findings(&observations, None, &FindingOptions::default()), FindingCode::TooFewViews).is_none());
    for view in &mut observations.views[9..] {
        view.in_fit = false;
    }
    let found = findings(&observations, None, &FindingOptions::default());
    let finding = find(&found, FindingCode::TooFewViews).expect("nine");
    assert_eq!((finding.severity, finding.value("views")), (Severity::Advice, Some(9.0)));
    for view in &mut observations.views[..7] {
        view.corners = None;
    }
    let found = findings(&observations, None, &FindingOptions::default());
    assert_eq!(found[0].code, FindingCode::TooFewViews, "problems come first");
    assert_eq!((found[0].severity, found[0].value("needed")), (Severity::Problem, Some(3.0)));
    let missing = find(&found, FindingCode::TargetNotFound).expect("seven");
    assert_eq!(missing.views, ["000", "001", "002", "003", "004", "005", "006"]);
    assert!(missing.to_string().contains("000, 001, 002, 003 and 3 more"), "{missing}");
}

#[test]
fn no_views_at_all_is_a_finding_and_no_panic() {
    let mut observations = set(3, 84).observations(true);
    observations.views.clear();
    let found = findings(&observations, None, &FindingOptions::with_goal_mm(Some(f64::NAN)));
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].code, FindingCode::TooFewViews);
}

#[test]
fn turns_about_one_axis_are_named_in_tip_axes_in_both_set_ups() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let t = turned(trial(mode, 12, &REALISTIC, camera(), 85), &Vector3::y(), 40.0, &Vector3::x(), 0.0);
        let found = findings(&t.observations(false), None, &FindingOptions::default());
        let finding = find(&found, FindingCode::OneRotationAxis).expect("one axis");
        assert_eq!(finding.severity, Severity::Problem);
        assert!(finding.to_string().contains("the tip, y,"), "{finding}");
        assert!((finding.value("tip_axis_y").expect("named") - 1.0).abs() < 1e-9);
    }
}

#[test]
fn the_axis_with_the_smallest_turns_is_called_weak() {
    let t = turned(set(12, 86), &Vector3::z(), 60.0, &Vector3::x(), 8.0);
    let found = findings(&t.observations(false), None, &FindingOptions::default());
    let finding = find(&found, FindingCode::WeakRotation).expect("8° about x and none about y");
    assert_eq!(finding.severity, Severity::Warning);
    let (second, weakest) = (finding.value("turn_about_second"), finding.value("turn_about_weakest"));
    assert!(second > weakest && second < Some(10.0), "{finding:?}");
    let strong = turned(set(12, 86), &Vector3::z(), 60.0, &Vector3::x(), 40.0);
    let found = findings(&strong.observations(false), None, &FindingOptions::default());
    assert!(find(&found, FindingCode::WeakRotation).is_none());
}

#[test]
fn views_that_are_all_alike_are_told() {
    for (degrees, severity) in [(6.0, Severity::Warning), (0.1, Severity::Problem)] {
        let t = turned(set(12, 87), &Vector3::z(), degrees, &Vector3::x(), degrees);
        let found = findings(&t.observations(false), None, &FindingOptions::default());
        let finding = find(&found, FindingCode::ViewsAlike).expect("alike");
        assert_eq!(finding.severity, severity);
        assert!(finding.value("largest_turn").expect("stated") < 20.0);
    }
}

#[test]
fn the_part_of_the_image_that_no_board_was_in_is_named() {
    let mut observations = set(12, 88).observations(true);
    for corner in observations.views.iter_mut().flat_map(|v| v.corners.iter_mut().flatten()) {
        // Everything into the left third.
        corner.px.x *= 0.3;
    }
    let found = findings(&observations, None, &FindingOptions::default());
    let finding = find(&found, FindingCode::PoorCoverage).expect("a third");
    assert_eq!(finding.severity, Severity::Advice, "the lens is estimated");
    assert!(finding.to_string().contains("top right") && !finding.to_string().contains("top left"), "{finding}");
    assert!(finding.value("covered").expect("stated") <= 100.0 / 3.0 + 13.0);
}

#[test]
fn one_wrong_robot_pose_is_named_by_correction_and_influence() {
    let mut t = set(20, 89);
    t.views[7].base_from_tip =
        t.views[7].base_from_tip.perturbed(&Vector6::new(0.005, 0.0, 0.0, 0.0, 0.5f64.to_radians(), 0.0));
    let found = of_all_views(&t);
    for code in [FindingCode::LargeCorrection, FindingCode::InfluentialView] {
        let finding = find(&found, code).unwrap_or_else(|| panic!("{code:?} in {found:?}"));
        assert_eq!(finding.views, ["007"]);
    }
    assert!(find(&found, FindingCode::LargeResidual).is_none(), "its corners are as good as the others'");
    let found = of_trial(&t, false, &FindingOptions::default());
    let rejected = find(&found, FindingCode::OutlierView).expect("outlier");
    assert_eq!(rejected.views, ["007"]);
    // PnP knows the tilt of one view to a tenth of a degree.
    assert!((rejected.value("angle").expect("stated") - 0.5).abs() < 0.3, "{rejected}");
    assert!(find(&found, FindingCode::LargeCorrection).is_none(), "the answer is without it");
}

#[test]
fn one_blurred_image_is_named_by_its_residual() {
    let mut t = set(20, 90);
    for (i, corner) in t.views[4].corners.iter_mut().enumerate() {
        // A pixel to every side, in a pattern that no pose follows.
        corner.px.x += [1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0][i % 7];
        corner.px.y += [-1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0][i % 7];
    }
    let found = of_all_views(&t);
    let finding = find(&found, FindingCode::LargeResidual).expect("ten times the noise");
    assert_eq!(finding.views, ["004"]);
    assert!(finding.value("rms") > finding.value("median_rms").map(|m| 5.0 * m));
}

#[test]
fn a_robot_worse_than_the_corners_is_said_to_limit_the_answer_and_an_exact_one_is_not() {
    let noisy = Noise { corner_px: 0.1, robot_m: 5e-4, robot_rad: 0.1f64.to_radians(), ..Noise::EXACT };
    let found = of_trial(&trial(Mode::EyeInHand, 20, &noisy, camera(), 91), false, &FindingOptions::default());
    let finding = find(&found, FindingCode::RobotNoise).expect("limits");
    let effect = finding.value("robot_effect").expect("stated");
    // 0.1° about two axes over half a metre at 581 px, and half a millimetre: about 1.6 px, more with the lever of the roll.
    assert!((1.0..4.0).contains(&effect), "{effect}");
    let exact = Noise { corner_px: 0.1, robot_m: 0.0, robot_rad: 0.0, ..Noise::EXACT };
    let found = of_trial(&trial(Mode::EyeInHand, 20, &exact, camera(), 92), false, &FindingOptions::default());
    assert!(find(&found, FindingCode::RobotNoise).is_none());
}

#[test]
fn a_prediction_within_the_noise_is_no_finding_and_one_twice_as_bad_is() {
    // With views of the same kind a held-out error within the noise is the rule.
    for seed in 93..98 {
        let found = of_trial(&set(20, seed), false, &FindingOptions::default());
        assert!(find(&found, FindingCode::PoorPrediction).is_none(), "{found:?}");
    }
    let observations = set(20, 93).observations(false);
    let mut calibration = solve(&observations);
    let joint = calibration.joint.as_mut().expect("a joint estimate");
    joint.heldout_rms_px = Some(2.0 * joint.expected_heldout_rms_px);
    let found = findings(&observations, Some(&calibration), &FindingOptions::default());
    let finding = find(&found, FindingCode::PoorPrediction).expect("twice what the noise explains");
    assert_eq!(finding.severity, Severity::Warning);
}

#[test]
fn closed_forms_that_differ_are_listed_with_their_distance() {
    let observations = set(20, 99).observations(false);
    let mut calibration = solve(&observations);
    for method in &mut calibration.methods {
        if let (true, Ok(solution)) = (method.name == "li", &mut method.outcome) {
            let off = Vector6::new(0.02, 0.0, 0.0, 0.0, 0.0, 0.0);
            solution.mount_from_camera = solution.mount_from_camera.perturbed(&off);
        }
    }
    let found = findings(&observations, Some(&calibration), &FindingOptions::default());
    let finding = find(&found, FindingCode::ClosedFormsDisagree).expect("li");
    assert_eq!(finding.severity, Severity::Info, "the others agree");
    // 20 mm from its own answer, which is off by some millimetres itself.
    assert!((10.0..30.0).contains(&finding.value("li").expect("listed")), "{finding}");
}

#[test]
fn a_board_that_is_never_tilted_leaves_the_focal_length_weak() {
    let t = set(15, 100);
    let observations = t.observations(true);
    let mut calibration = solve(&observations);
    let found = findings(&observations, Some(&calibration), &FindingOptions::default());
    assert!(find(&found, FindingCode::LittleTilt).is_none());
    for (i, view) in calibration.views.iter_mut().enumerate() {
        let tilt = Vector3::new((i as f64).sin(), (i as f64).cos(), 0.0) * 10f64.to_radians();
        view.camera_from_target = Some(Pose::from_isometry(Isometry3::new(Vector3::z() * 0.5, tilt)));
    }
    let found = findings(&observations, Some(&calibration), &FindingOptions::default());
    let finding = find(&found, FindingCode::LittleTilt).expect("10°");
    assert!((finding.value("largest_tilt").expect("stated") - 10.0).abs() < 1e-6);
    calibration.camera.as_mut().expect("estimated").fixed = true;
    let found = findings(&observations, Some(&calibration), &FindingOptions::default());
    assert!(find(&found, FindingCode::LittleTilt).is_none(), "a camera that is given needs no tilt");
}

#[test]
fn codes_are_snake_case_in_json() {
    let finding = Finding::new(FindingCode::TooFewViews, Severity::Advice, Text::default());
    let json = serde_json::to_value(&finding).expect("JSON");
    assert_eq!((json["code"].as_str(), json["severity"].as_str()), (Some("too_few_views"), Some("advice")));
}

#[test]
fn a_lens_that_folds_back_is_named_beyond_the_target_and_refused_within_it() {
    // It turns back at r = 1 / √(3 · 0.35), where it has two thirds of it: 378 px of the 400 that the image has.
    let barrel = Intrinsics { distortion: Distortion::BrownConrady([-0.35, 0.0, 0.0, 0.0, 0.0]), ..camera() };
    let t = trial(Mode::EyeInHand, 10, &REALISTIC, barrel, 87);
    let found = of_trial(&t, false, &FindingOptions::default());
    let finding = find(&found, FindingCode::LensFolds).expect("it folds");
    assert!((finding.value("fold_radius").expect("a radius") - 378.0).abs() < 3.0, "{finding}");
    assert!(find(&of_trial(&set(10, 87), false, &FindingOptions::default()), FindingCode::LensFolds).is_none());

    // With −4 it turns back at 112 px, and the target was seen farther out.
    let mut observations = set(10, 87).observations(false);
    let folding = Intrinsics { distortion: Distortion::BrownConrady([-4.0, 0.0, 0.0, 0.0, 0.0]), ..camera() };
    observations.camera = CameraKnowledge::Fixed(folding);
    let outcome = fit(&observations, Method::Joint, &CancelToken::default());
    let Err(error) = outcome.map(drop) else { panic!("that is no lens") };
    let error = error.to_string();
    for part in ["the known camera", "[-4.0", "folds back 112 px", "the target was seen as far as"] {
        assert!(error.contains(part), "{part}: {error}");
    }
}
