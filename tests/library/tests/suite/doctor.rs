//! Small versions of the studies of the doctor; the example `doctor_cases` runs them at length.

#[path = "../../../studies/doctor_cases/cases.rs"]
mod cases;
#[path = "../../../studies/doctor_cases/faults.rs"]
mod faults;

use handeye_estimate::diagnose::doctor::diagnose;
use handeye_estimate::diagnose::findings::{Finding, FindingCode, FindingOptions, Severity};
use handeye_estimate::diagnose::{Calibration, calibrate, calibrate_with, examine};
use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::closed_form;
use handeye_estimate::stated_uncertainty::{Alternative, StatedUncertainty};
use handeye_estimate::{Fit, Method, Observations, Options, TargetSize, ViewStatus, fit};
use handeye_geometry::frames::Pose;
use handeye_geometry::observations::Noise;
use handeye_geometry::planar_pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::testing::GRID;
use handeye_plan::guided::GuidedOptions;
use handeye_plan::testing::guided_cell::{CellArm, CellSetup, GuidedCell, HiddenErrors};
use handeye_result::CalibrationResult;
use handeye_simulate::session::{ArmError, Cone, Fault, Setup, camera, links, observed};
use handeye_wording::Catalogue;

use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::corner_covariance::CornerCovariance;
use handeye_geometry::targets::observation::Corners;
use nalgebra::{DMatrix, SMatrix, Vector2, Vector6};

#[test]
fn every_degenerate_or_hostile_session_gets_its_code_and_none_is_called_healthy() {
    let cases = cases::cases();
    assert!(cases.len() >= 40);
    let wrong: Vec<String> = cases
        .iter()
        .filter_map(|case| Some(format!("{}: {}", case.name, case.verdict(faults::examined_alone).err()?)))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Keeps only the values of every template.
#[derive(Clone, Copy)]
struct ValuesOnly;

impl Catalogue for ValuesOnly {
    fn translation(self, english: &str) -> Option<&'static str> {
        let values = english.split('{').skip(1).filter_map(|part| part.split_once('}'));
        let values = values.filter(|(name, _)| !name.contains('|'));
        let alone: Vec<String> = values.map(|(name, _)| format!("{{{name}}}")).collect();
        Some(alone.join(" ").leak())
    }
}

#[test]
fn healthy_sessions_raise_no_alarm() {
    for seed in 0..8 {
        let diagnosis = faults::examined(&faults::healthy(seed));
        let grave: Vec<_> = diagnosis.findings.iter().filter(|f| f.severity >= Severity::Warning).collect();
        assert!(diagnosis.is_healthy(), "session {seed}: {grave:?} {:?}", diagnosis.untested);
    }
}

/// A session of a simulator: an exact robot, whose poses are written to a micrometre, and corners as from a renderer, to
/// thousandths of a pixel; one image is a little worse, and one corner in it.
fn simulated(mode: Mode, estimated: bool, seed: u64) -> Observations {
    let exact = Setup { noise: Noise::EXACT, estimated, ..Setup::new(mode, 12, seed) };
    let mut session = observed(&exact);
    for (i, view) in session.views.iter_mut().enumerate() {
        let px = if i == 2 { 0.006 } else { 0.0012 };
        for (k, corner) in view.corners.iter_mut().flatten().enumerate() {
            // What a view shares, and what neighbours along a row do.
            let (shared, own) = ((7.3 * i as f64).sin(), (0.9 * (k + 5 * i) as f64).sin());
            corner.px += Vector2::new(0.7 * shared + 0.5 * own, 0.7 * shared - 0.5 * own) * px;
            if (i, k) == (2, 33) {
                corner.px.x += 0.03;
            }
        }
        let rounded = |pose: Pose<_, _>| {
            let mut pose = *pose.isometry();
            pose.translation.vector.apply(|v| *v = (*v * 1e6).round() * 1e-6);
            Pose::from_isometry(pose)
        };
        view.base_from_tip = view.base_from_tip.map(rounded);
    }
    session
}

/// A number with only zeros, with decimals: a value that is too small for its format.
fn printed_zero(text: &str) -> Option<&str> {
    let numbers = text.split(|c: char| !(c.is_ascii_digit() || c == '.'));
    numbers.filter(|word| word.contains('.') && word.len() > 2).find(|word| word.trim_matches(['0', '.']).is_empty())
}

#[test]
fn an_exact_simulation_has_no_outlier_no_finding_and_no_printed_zero() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        for (estimated, seed) in [(false, 1), (false, 2), (true, 3), (true, 4)] {
            let observations = simulated(mode, estimated, 40 + seed);
            let cancel = CancelToken::default();
            let calibration = calibrate(&observations, Method::Joint, &cancel).expect("solves");
            let out = calibration.views.iter().filter(|view| view.status != ViewStatus::Used).count();
            let rejected: usize = calibration.views.iter().map(|view| view.rejected_corners.len()).sum();
            assert_eq!((out, rejected), (0, 0), "{mode:?} {seed}");
            let diagnosis = calibration.diagnosis();
            let of_noise = |finding: &&Finding| {
                use FindingCode as C;
                let geometry =
                    [C::PoorCoverage, C::WeakDirection, C::LittleTilt, C::WeakRotation, C::ClosedFormsDisagree];
                // Nothing states how good a given lens is.
                let of_input = [C::UncertaintyWidened, C::LensTakenAsExact];
                !geometry.contains(&finding.code) && !of_input.contains(&finding.code)
            };
            let found: Vec<_> = diagnosis.findings.iter().filter(of_noise).collect();
            assert!(found.is_empty() && diagnosis.untested.is_none(), "{mode:?} {seed}: {found:?}");
            let accepted: Vec<_> = diagnosis.hypotheses.iter().filter(|h| h.accepted || h.significant).collect();
            assert!(accepted.is_empty(), "{mode:?} {seed}: {accepted:?}");
            for finding in &diagnosis.findings {
                assert_eq!(printed_zero(&finding.to_string()), None, "{finding}");
            }
        }
    }
}

#[test]
fn an_arm_whose_error_depends_on_where_it_stands_raises_no_alarm() {
    // One in fifty sessions like these gets a cause reported; one in eleven without a model of such errors, among them
    // the tenth of these.
    for seed in 20_000..20_012 {
        let (observations, setup) = faults::as_met(seed);
        let findings = faults::examined(&observations).findings;
        let named: Vec<_> = findings.iter().filter(|finding| faults::names_a_cause(finding, &setup)).collect();
        assert!(named.is_empty(), "{setup:?}: {named:?}");
    }
}

#[test]
fn links_of_an_arm_that_are_too_long_are_no_other_size_of_the_target() {
    // Sessions in which the arm moves too far by some tenths of a percent: a field in the axes of the tip alone does not fit
    // that, and reports the target as too small.
    for seed in [30_184, 30_287, 30_424] {
        let (observations, setup) = faults::as_met(20_000 + seed);
        let findings = faults::examined_alone(&observations).findings;
        assert!(findings.iter().all(|finding| finding.code != FindingCode::WrongScale), "{setup:?}: {findings:?}");
    }
}

#[test]
fn each_injected_fault_is_ranked_first() {
    for (fault, name) in faults::FAULTS.iter().enumerate() {
        for seed in 0..2 {
            // Twice as large as their names state: half of the sessions with a fixed camera have a joint that is 0.2° off
            // initially and accepted (docs/studies/diagnosis.md).
            let (observations, code) = faults::faulty(fault, 2.0, seed);
            let diagnosis = faults::examined_alone(&observations);
            let best = diagnosis.hypotheses.first().expect("tested");
            assert!(best.code == code && best.accepted, "{name}, seed {seed}: {best:?}");
        }
    }
}

#[test]
fn the_scale_is_estimated_within_its_uncertainty_with_the_lens_given_estimated_or_absent() {
    // Squared error over squared uncertainty has the mean 1; its spread over 12 sessions is 0.4 for a Gaussian. Poses
    // alone contain nothing about their precision, so all of it is attributed to the robot, and the uncertainty is too
    // large.
    let mean = |errors: Vec<f64>| errors.iter().sum::<f64>() / errors.len() as f64;
    let seeds = || 700..712u64;
    let of_corners = |estimated| mean(seeds().filter_map(|seed| faults::scale_error(estimated, seed)).collect());
    let of_poses = mean(seeds().filter_map(scale_error_of_poses).collect());
    for (kind, mean) in [("given", of_corners(false)), ("estimated", of_corners(true)), ("absent", of_poses)] {
        println!("lens {kind}: mean squared error over uncertainty {mean:.2}");
        assert!((0.1..2.6).contains(&mean), "lens {kind}: {mean}");
    }
}

#[test]
fn a_report_has_one_size_of_the_target_and_on_a_bent_board_it_sets_no_headline() {
    let examined = |observations: &Observations| {
        let cancel = CancelToken::default();
        let calibration = calibrate(observations, Method::Joint, &cancel).expect("solves");
        let diagnosis = calibration.diagnosis().clone();
        (calibration, diagnosis)
    };
    let mut told_of_size = 0;
    for seed in 0..6 {
        let mode = if seed % 2 == 0 { Mode::EyeInHand } else { Mode::EyeToHand };
        let estimated = seed > 2;
        let noise = Noise { corner_px: 0.03, robot_m: 2e-5, robot_rad: 5e-5, ..Noise::EXACT };
        let fine = Setup { noise, estimated, ..Setup::new(mode, 20, 900 + seed) };
        for (warp_m, scale) in [(3e-3, 0.0), (0.0, 0.03)] {
            let (calibration, diagnosis) =
                examined(&observed(&fine.clone().with(Fault { warp_m, scale, ..Fault::default() })));
            let size = calibration.joint.as_ref().and_then(|joint| joint.size.clone()).expect("the robot moved");
            let reported = diagnosis.hypotheses.iter().find(|h| h.code == FindingCode::WrongScale);
            if let Some(estimate) = reported.and_then(|h| h.estimate) {
                told_of_size += 1;
                // Up to the rounding of a difference to one.
                let apart = |a: f64, b: f64| (a - b).abs() / b;
                assert!(apart(estimate.value, size.scale) < 1e-9, "{mode:?} {seed}: {estimate:?} {size:?}");
                assert!(estimate.sigma.is_some_and(|sigma| apart(sigma, size.sigma) < 1e-9), "{mode:?} {seed}");
            }
            let is_accused = diagnosis.findings.iter().any(|finding| finding.code == FindingCode::WrongScale);
            assert_eq!(is_accused, scale > 0.0, "{mode:?} {seed}: {size:?} {reported:?}");
            assert!((size.scale - 1.0 - scale).abs() < 5.0 * size.sigma + 1e-4, "{mode:?} {seed}: {size:?}");
            // For a wrong size that is not in the answer the error includes how far it moves the answer. If the lens is estimated
            // on a bent board something else may be found in addition.
            let is_moved = calibration.moved_m().is_some();
            let right = if estimated { is_moved || scale == 0.0 } else { is_moved == (scale > 0.0) };
            assert!(right, "{mode:?} {seed}: {:?}", calibration.stated_uncertainty());
        }
    }
    assert!(told_of_size >= 6, "nothing is compared: {told_of_size}");
}

#[test]
fn where_the_field_of_the_robot_leaves_the_size_open_the_stated_error_counts_what_it_would_move() {
    // Two centimetres and a degree a metre, with either sign.
    let per_metre = SMatrix::from_fn(|i, j| if (i + 2 * j) % 3 == 0 { 0.02 } else { -0.014 });
    let setup = Setup { arm_error: ArmError::Affine(per_metre), ..Setup::new(Mode::EyeInHand, 20, 950) };
    let observations = observed(&setup);
    let cancel = CancelToken::default();
    let calibrated = fit(&observations, Method::Joint, &cancel).expect("solves");
    let joint = calibrated.joint.as_ref().expect("a joint estimate");
    let size = joint.size.clone().expect("the robot moved");
    assert!(joint.field.is_some() && size.is_determined() && joint.open_size().is_none(), "{size:?}");

    // The same answer for a session that determines the size no better than a ruler does.
    let mut unsure = calibrated.clone();
    let with = Alternative { shift: [0.005, 0.0, 0.0, 0.0, 0.0, 0.0].into(), ..size.with.clone() };
    let open = TargetSize { scale: 1.02, sigma: 0.02, with, ..size };
    unsure.joint.as_mut().expect("a joint estimate").size = Some(open);
    let diagnosed = |fit: Fit| {
        let calibration = examine(&observations, fit, &FindingOptions::default(), &cancel).expect("not cancelled");
        let field = calibration.diagnosis().findings.iter().find(|finding| finding.code == FindingCode::RobotField);
        (calibration.tip_error_95_m().expect("stated"), field.expect("it has a field").to_string())
    };
    let ((sure_m, sure), (open_m, open)) = (diagnosed(calibrated), diagnosed(unsure));
    assert!(open_m >= sure_m + 0.004, "{sure_m} {open_m}");
    assert!(!sure.contains("Another size") && open.contains("1.020 ± 0.020 times"), "{sure}\n{open}");
}

/// The error of the answer is its distance to the explanation, not that between two fits of the linear model, neither of
/// which is the answer.
#[test]
fn the_error_beside_a_lens_that_was_given_wrongly_is_that_of_the_answer() {
    for seed in 1000..1006 {
        let hidden = HiddenErrors { focal: 0.99, ..HiddenErrors::NOTHING };
        let (arm, mode) = (CellArm::ALL[seed as usize % 3], Mode::EyeInHand);
        let setup = CellSetup { hidden, ..CellSetup::new(arm, mode, seed) };
        let options = GuidedOptions { goal_m: 5e-4, candidates: 300, most_views: 18, ..GuidedOptions::default() };
        let run = GuidedCell::new(setup).run(options);
        let (views, stated_m, true_m) = *run.history.last().expect("one cause explains it");
        assert_eq!(views, run.times_s.len(), "{seed}: nothing is stated at the end");
        assert!(true_m > 2e-3, "the lens changes nothing: nothing is asserted");
        assert!((true_m..1.3 * true_m).contains(&stated_m), "{seed}: off by {true_m} m, {stated_m} m stated");
    }
}

/// The same with target poses instead of corners.
fn scale_error_of_poses(seed: u64) -> Option<f64> {
    let setup = Setup::new(Mode::EyeInHand, 20, seed);
    let mut observations = observed(&setup.with(Fault { scale: 0.02, ..Fault::default() }));
    let target = observations.target;
    for view in &mut observations.views {
        let corners = view.corners.take()?;
        view.camera_from_target = planar_pose::camera_from_target(&corners, &target, &camera()).ok();
    }
    let diagnosis = faults::examined_alone(&observations);
    let scale = diagnosis.hypotheses.iter().find(|h| h.code == FindingCode::WrongScale)?.estimate?;
    Some(((scale.value - 1.02) / scale.sigma?).powi(2))
}

#[test]
fn a_view_out_of_the_fit_touches_nothing() {
    let fault = Fault { moving: vec![(5, [0.02, 0.0, 0.0, 0.0, 0.05, 0.0].into())], ..Fault::default() };
    let mut with = observed(&Setup::new(Mode::EyeInHand, 14, 801).with(fault));
    let found = faults::examined_alone(&with);
    assert_eq!(found.hypotheses[0].views, ["005"], "{:?}", found.hypotheses[0]);
    with.views[5].in_fit = false;
    let mut without = with.clone();
    without.views.remove(5);
    let (with, without) = (faults::examined_alone(&with), faults::examined_alone(&without));
    assert!(with.is_healthy(), "{:?}", with.findings);
    assert_eq!(with.hypotheses, without.hypotheses);
}

#[test]
fn what_was_not_tested_is_said_and_never_called_healthy() {
    let observations = observed(&Setup::new(Mode::EyeInHand, 14, 802));
    let cancel = CancelToken::default();
    cancel.cancel();
    let cancelled = diagnose(&observations, &FindingOptions::default(), &cancel);
    assert_eq!(cancelled.untested.as_deref(), Some("cancelled"));
    let mut camera_alone = observations.clone();
    camera_alone.mode = None;
    for view in &mut camera_alone.views {
        view.base_from_tip = None;
    }
    let camera_alone = faults::examined_alone(&camera_alone);
    assert!(!camera_alone.is_healthy() && camera_alone.untested.is_some());
}

#[test]
fn the_weakest_direction_is_named_where_tilts_are_small() {
    // Rotations about the line of sight alone leave the place along it open; a few degrees of tilt leave it weak.
    let cone = Cone { tilt_deg: 3.0, ..Cone::PUBLISHED };
    let setup = Setup { cone, ..Setup::new(Mode::EyeInHand, 20, 803) };
    let findings = faults::examined(&observed(&setup)).findings;
    let weak = findings.iter().find(|f| f.code == FindingCode::WeakDirection).unwrap_or_else(|| panic!("{findings:?}"));
    assert!(weak.value("camera_axis_z").is_some_and(|z| z > 0.95), "{weak}");
    assert!(weak.to_string().contains("about the camera's x and y axes"), "{weak}");
}

/// The calibration as made by the command line, with what may be claimed for it.
fn claimed(observations: &Observations) -> Calibration {
    let cancel = CancelToken::default();
    let goal = FindingOptions::with_goal_mm(Some(1.0));
    calibrate_with(observations, Method::Joint, Options::default(), &goal, &cancel).expect("an answer, right or wrong")
}

#[test]
fn the_stated_error_covers_the_true_one_when_what_was_given_is_wrong() {
    let slip = Vector6::new(8e-3, -5e-3, 0.0, 0.0, 0.0, 0.01);
    let faults: [(&str, Fault); 5] = [
        ("size of the board −4 %", Fault { scale: -0.04, ..Fault::default() }),
        ("focal length +5.9 %", Fault { focal: 0.059, ..Fault::default() }),
        ("focal length −3 %", Fault { focal: -0.03, ..Fault::default() }),
        ("board slipped by 9 mm", Fault { board_moved: Some((11, slip)), ..Fault::default() }),
        ("zero of joint 4 off by 0.5°", Fault { joint: Some((3, 0.5f64.to_radians())), ..Fault::default() }),
    ];
    for (name, fault) in &faults {
        for seed in 0..4 {
            let mode = if seed % 2 == 0 { Mode::EyeInHand } else { Mode::EyeToHand };
            let setup = Setup { joints: true, ..Setup::new(mode, 20, 700 + seed) };
            let calibration = claimed(&observed(&setup.with(fault.clone())));
            let true_mount_from_camera = links(mode).mount_from_camera;
            let found = calibration.hand_eye.expect("a hand-eye").mount_from_camera();
            let point = calibration.joint.as_ref().expect("a joint estimate").reference_point;
            let error_m = (found.isometry() * point - true_mount_from_camera.isometry() * point).norm();
            let stated_m = calibration.tip_error_95_m().expect("stated");
            assert!(error_m < stated_m, "{name}, {seed}: off by {error_m}, stated {stated_m}");
            // Not so wide that it is useless: a slip looks like noise of the robot, too.
            let modelled_m = calibration.modelled_error_95_m().expect("stated");
            // If the field that explains it leaves the size of the board open, the shift by that counts, too, and no more.
            let joint = calibration.joint.as_ref().expect("a joint estimate");
            let by_size_m = joint.open_size().map_or(0.0, |size| {
                let covariance = calibration.hand_eye_covariance().expect("stated");
                let open = StatedUncertainty::Moved(vec![size.with.clone()]);
                open.error_95_m(covariance, joint.small_sample, &point).expect("stated")
            });
            // With an arm, the shift of the camera by all of its errors is in no view, and counts however small it is.
            let by_arm = joint.arm.as_ref().zip(calibration.hand_eye.as_ref()).filter(|_| mode == Mode::EyeToHand);
            let by_arm_m =
                by_arm.map_or(0.0, |(arm, answer)| arm.of_links(answer)[0].error_95_m(arm.small_sample, &point));
            let widest_m = (2.0 * error_m + 1.5 * modelled_m).max(by_size_m).max(by_arm_m);
            assert!(stated_m <= widest_m, "{name}, {seed}: off by {error_m}, stated {stated_m}, at most {widest_m}");
        }
    }
}

#[test]
fn no_error_is_stated_where_the_data_contradict_themselves() {
    for fault in [4, 5] {
        let (observations, code) = faults::faulty(fault, 1.0, 5000);
        let cancel = CancelToken::default();
        let Ok(calibration) = calibrate(&observations, Method::Joint, &cancel) else { continue };
        assert!(calibration.diagnosis().findings.iter().any(|f| f.code == code && f.severity == Severity::Problem));
        assert_eq!(calibration.tip_error_95_m(), None, "{code:?}");
        assert!(calibration.modelled_error_95_m().is_some());
        let json = CalibrationResult::of(&calibration, "", None, std::collections::BTreeMap::new());
        assert_eq!(json.quality.tip_error_95_mm, None, "{code:?}");
    }
}

#[test]
fn the_goal_is_judged_by_the_error_that_is_stated_and_more_views_are_no_advice() {
    let setup = Setup::new(Mode::EyeInHand, 20, 710).with(Fault { scale: -0.04, ..Fault::default() });
    let (observations, cancel) = (observed(&setup), CancelToken::default());
    let fit = fit(&observations, Method::Joint, &cancel).expect("an answer");
    let calibration = examine(&observations, fit.clone(), &FindingOptions::default(), &cancel).expect("not cancelled");
    // The noise alone would reach it.
    let goal_mm = 1.1e3 * calibration.modelled_error_95_m().expect("stated");
    let options = FindingOptions::with_goal_mm(Some(goal_mm));
    let calibration = examine(&observations, fit, &options, &cancel).expect("not cancelled");
    let goal = calibration
        .diagnosis()
        .findings
        .iter()
        .find(|f| f.code == FindingCode::GoalNotReached)
        .expect("it is not reached");
    assert!(goal.to_string().contains("More views do not help"), "{goal}");
    assert!(goal.value("expected_error_95").expect("stated") > 15.0, "{goal:?}");
}

/// Radians that are read as degrees leave an arm that hardly turns, and a target in another unit a robot of another size.
#[test]
fn a_unit_that_was_stated_wrongly_is_named() {
    use nalgebra::{Isometry3, UnitQuaternion};
    let setup = Setup { estimated: false, ..Setup::new(Mode::EyeInHand, 16, 721) };
    let healthy = observed(&setup);
    let changed = |change: &dyn Fn(Isometry3<f64>) -> Isometry3<f64>| {
        let mut session = healthy.clone();
        for view in &mut session.views {
            view.base_from_tip = view.base_from_tip.map(|pose| Pose::from_isometry(change(*pose.isometry())));
        }
        session
    };
    let vector = |pose: Isometry3<f64>| {
        let turn = UnitQuaternion::from_scaled_axis(pose.rotation.scaled_axis() * 1f64.to_radians());
        Isometry3::from_parts(pose.translation, turn)
    };
    let rpy = |pose: Isometry3<f64>| {
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        let turn = UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians());
        Isometry3::from_parts(pose.translation, turn)
    };
    let inverse = |pose: Isometry3<f64>| vector(pose.inverse()).inverse();
    let cancel = CancelToken::default();
    let found = |session: &Observations| diagnose(session, &FindingOptions::default(), &cancel).findings;
    for change in [&vector as &dyn Fn(Isometry3<f64>) -> Isometry3<f64>, &rpy, &inverse] {
        let findings = found(&changed(change));
        let named = findings.iter().find(|f| f.code == FindingCode::WrongAngleUnit).expect("the unit is named");
        assert!(named.to_string().contains("are in radians where degrees were stated"), "{named}");
    }
    for (times, reported) in [
        (1e3, "in millimetres where metres"),
        (1e-3, "in metres where millimetres"),
        (10.0, "is 0.1 times the true one, a power of ten"),
        (0.01, "is 100 times the true one, a power of ten"),
        (25.4, "is 1/25.4 times the true one, by an inch"),
        (1.0 / 25.4, "is 25.4 times the true one, by an inch"),
    ] {
        let scaled = |mut pose: Isometry3<f64>| {
            pose.translation.vector *= times;
            pose
        };
        let findings = found(&changed(&scaled));
        let named = findings.iter().find(|f| f.code == FindingCode::WrongLengthUnit).expect("the unit is named");
        assert!(named.to_string().contains(reported), "{times}: {named}");
    }
}

#[test]
fn views_numbered_from_the_other_end_mislead_neither_closed_forms_nor_the_doctor() {
    // Circles look the same from both ends.
    let mut observations = observed(&Setup::new(Mode::EyeInHand, 16, 720));
    observations.target = TargetSpec::Circles(GRID);
    for n in [2, 3, 9, 13] {
        let corners = observations.views[n].corners.as_mut().expect("seen");
        handeye_geometry::targets::observation::renumber(corners, &mut None, &TargetSpec::Circles(GRID), 2);
    }
    let cancel = CancelToken::default();
    let true_mount_from_camera = links(Mode::EyeInHand).mount_from_camera;
    for method in [Method::Joint, Method::ClosedForm("park_martin")] {
        let calibration = calibrate(&observations, method, &cancel).expect("an answer");
        let renumbered = calibration.views.iter().filter(|view| view.quarter_turns != 0).count();
        assert_eq!(renumbered, 4, "{method:?}");
        for result in &calibration.methods {
            let found = result.outcome.as_ref().expect("an answer").mount_from_camera;
            let off_m = (found.translation() - true_mount_from_camera.translation()).norm();
            // The least robust of them is off by a centimetre with all views correct.
            assert!(off_m < 0.03, "{method:?}: {} is off by {off_m} m", result.name);
        }
        let alarms: Vec<_> =
            calibration.diagnosis().findings.iter().filter(|f| f.severity >= Severity::Warning).collect();
        assert!(alarms.iter().all(|f| f.code == FindingCode::Renumbered), "{method:?}: {alarms:?}");
    }
}

mod slow {
    use super::*;

    #[test]
    fn an_arm_of_servo_motors_has_no_target_and_no_camera_that_moved_but_one_that_slipped_by_far() {
        let moves = |setup: &Setup| {
            let findings = faults::examined_alone(&observed(setup)).findings;
            findings.into_iter().filter(faults::names_a_move).collect::<Vec<_>>()
        };
        let mut found = 0;
        for seed in 0..10 {
            let setup = faults::servo(seed);
            let named = moves(&setup);
            assert!(named.is_empty(), "{seed}, {setup:?}: {named:?}");
            let slip = [0.018, -0.024, 0.0, 0.0, 0.0, 0.0].into();
            let fault = Fault { board_moved: Some((setup.views / 2, slip)), ..setup.fault.clone() };
            found += usize::from(!moves(&setup.with(fault)).is_empty());
        }
        assert!(found >= 8, "a slip of 30 mm is found in {found} of 10");
    }

    #[test]
    fn whatever_is_found_is_said_in_words_that_can_be_translated() {
        let closed_forms: Vec<&str> = closed_form::all().iter().map(|solver| solver.name()).collect();
        let faulty = (0..faults::FAULTS.len()).map(|fault| faults::faulty(fault, 1.0, 0).0);
        for observations in cases::cases().into_iter().map(|case| case.observations).chain(faulty) {
            let diagnosis = faults::examined(&observations);
            let of_hypotheses = diagnosis.hypotheses.iter().flat_map(|h| [&h.text, &h.advice]);
            for text in diagnosis.findings.iter().map(|finding| &finding.text).chain(of_hypotheses) {
                let values = text.in_language(ValuesOnly);
                let is_prose = |word: &str| word.len() > 3 && !closed_forms.contains(&word);
                let prose: Vec<&str> =
                    values.split(|c: char| !c.is_alphabetic() && c != '_').filter(|word| is_prose(word)).collect();
                assert!(prose.is_empty(), "{prose:?} can be said in English only: {text:?}");
            }
        }
    }
}

/// As with hard edges and a board along the pixels: all of it is shifted, which no residual shows.
#[test]
fn a_view_whose_corners_are_off_together_as_their_detector_says_contradicts_nothing() {
    let observations = observed(&Setup::new(Mode::EyeInHand, 16, 720));
    let accused = |stated: bool| {
        let mut observations = observations.clone();
        for (i, view) in observations.views.iter_mut().enumerate() {
            let mut corners = view.corners.as_ref().expect("seen").to_vec();
            let shared_px2 = if i == 3 { 1.0 } else { 0.0 };
            for corner in corners.iter_mut().filter(|_| i == 3) {
                corner.px.x += 2.0;
            }
            let covariance = DMatrix::from_fn(2 * corners.len(), 2 * corners.len(), |a, b| {
                let own = if a == b { 0.01 } else { 0.0 };
                own + if a % 2 == 0 && b % 2 == 0 { shared_px2 } else { 0.0 }
            });
            for (k, corner) in corners.iter_mut().enumerate().filter(|_| stated) {
                corner.covariance_px2 = Some(covariance.fixed_view::<2, 2>(2 * k, 2 * k).into_owned());
            }
            let together = CornerCovariance::new(&covariance).filter(|_| stated);
            view.corners = Some(Corners::together(corners, together));
        }
        let diagnosis = diagnose(&observations, &FindingOptions::default(), &CancelToken::default());
        diagnosis.findings.into_iter().filter(|finding| finding.severity >= Severity::Warning).collect::<Vec<_>>()
    };
    let alike = accused(false);
    assert!(alike.iter().any(|finding| finding.code == FindingCode::OutlierView), "{alike:?}");
    assert!(accused(true).is_empty(), "{:?}", accused(true));
}
