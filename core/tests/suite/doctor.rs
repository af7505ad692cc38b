//! Small versions of the studies of the doctor; the example `doctor_cases` runs them at length.

#[path = "../../studies/doctor_cases/cases.rs"]
mod cases;
#[path = "../../studies/doctor_cases/faults.rs"]
mod faults;

use handeye_core::diagnose::doctor::diagnose;
use handeye_core::diagnose::findings::{FindingCode, FindingOptions, Severity};
use handeye_core::estimate::handeye::Mode;
use handeye_core::estimate::handeye::closed_form;
use handeye_core::estimate::{Calibration, Method, Observations, calibrate};
use handeye_core::geometry::frames::Pose;
use handeye_core::geometry::planar_pose;
use handeye_core::plan::guided::GuidedOptions;
use handeye_core::progress::CancelToken;
use handeye_core::testing::faulty::{self, Fault, Setup, session};
use handeye_core::testing::guided_cell::{CellArm, CellSetup, GuidedCell, Untold};
use handeye_core::testing::sessions::{GRID, camera};
use handeye_core::wording::Catalogue;

use handeye_core::targets::TargetSpec;
use nalgebra::Vector6;

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

/// Leaves of every template its values alone.
#[derive(Clone, Copy)]
struct Wordless;

impl Catalogue for Wordless {
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

#[test]
fn an_arm_whose_error_depends_on_where_it_stands_raises_no_alarm() {
    // One in fifty sessions like these has a cause named; one in eleven without a model of such errors, among them the
    // tenth of these.
    for seed in 20_000..20_012 {
        let (observations, setup) = faults::as_met(seed);
        let findings = faults::examined(&observations).findings;
        let named: Vec<_> = findings.iter().filter(|finding| faults::names_a_cause(finding, &setup)).collect();
        assert!(named.is_empty(), "{setup}: {named:?}");
    }
}

#[test]
fn links_of_an_arm_that_are_too_long_are_no_other_size_of_the_target() {
    // Sessions in which the arm moves too far by some tenths of a percent: a field in the axes of the tip alone does not follow
    // that, and calls the target too small.
    for seed in [30_184, 30_287, 30_424] {
        let (observations, setup) = faults::as_met(20_000 + seed);
        let findings = faults::examined_alone(&observations).findings;
        assert!(findings.iter().all(|finding| finding.code != FindingCode::WrongScale), "{setup}: {findings:?}");
    }
}

#[test]
fn each_injected_fault_is_ranked_first() {
    for (fault, name) in faults::FAULTS.iter().enumerate() {
        for seed in 0..2 {
            let (observations, code) = faults::faulty(fault, 1.0, seed);
            let diagnosis = faults::examined_alone(&observations);
            let best = diagnosis.hypotheses.first().expect("tested");
            assert!(best.code == code && best.accepted, "{name}, seed {seed}: {best:?}");
        }
    }
}

#[test]
fn the_scale_is_estimated_within_its_uncertainty_with_the_lens_given_estimated_or_absent() {
    // Squared error over squared uncertainty has the mean 1; its spread over 12 sessions is 0.4 for a Gaussian. Poses
    // alone say nothing of their precision, so all of it is taken for the robot's, and the uncertainty is too large.
    let mean = |errors: Vec<f64>| errors.iter().sum::<f64>() / errors.len() as f64;
    let seeds = || 700..712u64;
    let of_corners = |estimated| mean(seeds().filter_map(|seed| faults::scale_error(estimated, seed)).collect());
    let of_poses = mean(seeds().filter_map(scale_error_of_poses).collect());
    for (kind, mean) in [("given", of_corners(false)), ("estimated", of_corners(true)), ("absent", of_poses)] {
        println!("lens {kind}: mean squared error over uncertainty {mean:.2}");
        assert!((0.1..2.6).contains(&mean), "lens {kind}: {mean}");
    }
}

/// What the answer is off by is what lies between it and the explanation, not between two fits of the linear model, of which
/// neither is the answer.
#[test]
fn the_error_beside_a_lens_that_was_given_wrongly_is_that_of_the_answer() {
    for seed in 1000..1006 {
        let untold = Untold { focal: 0.99, ..Untold::NOTHING };
        let (arm, mode) = (CellArm::ALL[seed as usize % 3], Mode::EyeInHand);
        let setup = CellSetup { untold, ..CellSetup::new(arm, mode, seed) };
        let options = GuidedOptions { goal_m: 5e-4, candidates: 300, most_views: 18, ..GuidedOptions::default() };
        let run = GuidedCell::new(setup).run(options);
        let (views, stated_m, true_m) = *run.history.last().expect("one cause explains it");
        assert_eq!(views, run.times_s.len(), "{seed}: nothing is stated at the end");
        assert!(true_m > 2e-3, "the lens changes nothing: nothing is asserted");
        assert!((true_m..1.3 * true_m).contains(&stated_m), "{seed}: off by {true_m} m, {stated_m} m stated");
    }
}

/// The same with target poses in the place of corners.
fn scale_error_of_poses(seed: u64) -> Option<f64> {
    let setup = Setup::new(Mode::EyeInHand, 20, seed);
    let mut observations = session(&setup.with(Fault { scale: 0.02, ..Fault::default() }));
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
    let mut with = session(&Setup::new(Mode::EyeInHand, 14, 801).with(fault));
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
    let observations = session(&Setup::new(Mode::EyeInHand, 14, 802));
    let cancel = CancelToken::default();
    cancel.cancel();
    let cancelled = diagnose(&observations, None, &FindingOptions::default(), &cancel);
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
    // Turns about the line of sight alone leave the place along it open; a few degrees of tilt leave it weak.
    let setup = Setup { tilt_deg: 3.0, roll_deg: 60.0, ..Setup::new(Mode::EyeInHand, 20, 803) };
    let findings = faults::examined(&session(&setup)).findings;
    let weak = findings.iter().find(|f| f.code == FindingCode::WeakDirection).unwrap_or_else(|| panic!("{findings:?}"));
    assert!(weak.value("camera_axis_z").is_some_and(|z| z > 0.95), "{weak}");
    assert!(weak.to_string().contains("about the camera's x and y axes"), "{weak}");
}

/// The calibration as the command line makes it, with what may be claimed for it.
fn claimed(observations: &Observations) -> Calibration {
    let cancel = CancelToken::default();
    let mut calibration = calibrate(observations, Method::Joint, &cancel).expect("an answer, right or wrong");
    diagnose(observations, Some(&mut calibration), &FindingOptions::with_goal_mm(Some(1.0)), &cancel);
    calibration
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
            let calibration = claimed(&session(&setup.with(fault.clone())));
            let (true_mount_from_camera, _) = faulty::links(mode);
            let found = calibration.hand_eye.expect("a hand-eye").mount_from_camera();
            let point = calibration.joint.as_ref().expect("a joint estimate").reference_point;
            let error_m = (found.isometry() * point - true_mount_from_camera.isometry() * point).norm();
            let stated_m = calibration.tip_error_95_m().expect("stated");
            assert!(error_m < stated_m, "{name}, {seed}: off by {error_m}, stated {stated_m}");
            // Not so wide that it says nothing: a slip looks like noise of the robot, too.
            let modelled_m = calibration.modelled_error_95_m().expect("stated");
            assert!(stated_m < 2.0 * error_m + 1.5 * modelled_m, "{name}, {seed}: off by {error_m}, stated {stated_m}");
        }
    }
}

#[test]
fn no_error_is_stated_where_the_data_contradict_themselves() {
    for fault in [4, 5] {
        let (observations, code) = faults::faulty(fault, 1.0, 5000);
        let cancel = CancelToken::default();
        let Ok(mut calibration) = calibrate(&observations, Method::Joint, &cancel) else { continue };
        let diagnosis = diagnose(&observations, Some(&mut calibration), &FindingOptions::default(), &cancel);
        assert!(diagnosis.findings.iter().any(|f| f.code == code && f.severity == Severity::Problem));
        assert_eq!(calibration.tip_error_95_m(), None, "{code:?}");
        assert!(calibration.modelled_error_95_m().is_some());
        let json = calibration.to_result("", None, std::collections::BTreeMap::new());
        assert_eq!(json.quality.tip_error_95_mm, None, "{code:?}");
    }
}

#[test]
fn the_goal_is_judged_by_the_error_that_is_stated_and_more_views_are_no_advice() {
    let setup = Setup::new(Mode::EyeInHand, 20, 710).with(Fault { scale: -0.04, ..Fault::default() });
    let (observations, cancel) = (session(&setup), CancelToken::default());
    let mut calibration = calibrate(&observations, Method::Joint, &cancel).expect("an answer");
    // The noise alone would reach it.
    let goal_mm = 1.1e3 * calibration.modelled_error_95_m().expect("stated");
    let options = FindingOptions::with_goal_mm(Some(goal_mm));
    let found = diagnose(&observations, Some(&mut calibration), &options, &cancel).findings;
    let goal = found.iter().find(|f| f.code == FindingCode::GoalNotReached).expect("it is not reached");
    assert!(goal.to_string().contains("More views do not help"), "{goal}");
    assert!(goal.value("expected_error_95").expect("stated") > 15.0, "{goal:?}");
}

/// Radians that are read as degrees leave an arm that hardly turns, and a target of another unit a robot of another size.
#[test]
fn a_unit_that_was_stated_wrongly_is_named() {
    use nalgebra::{Isometry3, UnitQuaternion};
    let setup = Setup { estimated: false, ..Setup::new(Mode::EyeInHand, 16, 721) };
    let healthy = session(&setup);
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
    let found = |session: &Observations| diagnose(session, None, &FindingOptions::default(), &cancel).findings;
    for change in [&vector as &dyn Fn(Isometry3<f64>) -> Isometry3<f64>, &rpy, &inverse] {
        let findings = found(&changed(change));
        let named = findings.iter().find(|f| f.code == FindingCode::WrongAngleUnit).expect("the unit is named");
        assert!(named.to_string().contains("are in radians where degrees were stated"), "{named}");
    }
    for (times, said) in [
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
        assert!(named.to_string().contains(said), "{times}: {named}");
    }
}

#[test]
fn views_numbered_from_the_other_end_mislead_neither_closed_forms_nor_the_doctor() {
    // Circles look the same from both ends.
    let mut observations = session(&Setup::new(Mode::EyeInHand, 16, 720));
    observations.target = TargetSpec::Circles(GRID);
    for n in [2, 3, 9, 13] {
        let corners = observations.views[n].corners.as_mut().expect("seen");
        handeye_core::targets::observation::renumber(corners, &TargetSpec::Circles(GRID), 2);
    }
    let cancel = CancelToken::default();
    let (true_mount_from_camera, _) = faulty::links(Mode::EyeInHand);
    for method in [Method::Joint, Method::ClosedForm("park_martin")] {
        let mut calibration = calibrate(&observations, method, &cancel).expect("an answer");
        let renumbered = calibration.views.iter().filter(|view| view.quarter_turns != 0).count();
        assert_eq!(renumbered, 4, "{method:?}");
        for result in &calibration.methods {
            let found = result.outcome.as_ref().expect("an answer").mount_from_camera;
            let off_m = (found.translation() - true_mount_from_camera.translation()).norm();
            // The least robust of them is off by a centimetre with all views as they should be.
            assert!(off_m < 0.03, "{method:?}: {} is off by {off_m} m", result.name);
        }
        let diagnosis = diagnose(&observations, Some(&mut calibration), &FindingOptions::default(), &cancel);
        let alarms: Vec<_> = diagnosis.findings.iter().filter(|f| f.severity >= Severity::Warning).collect();
        assert!(alarms.iter().all(|f| f.code == FindingCode::Renumbered), "{method:?}: {alarms:?}");
    }
}

mod slow {
    use super::*;

    #[test]
    fn whatever_is_found_is_said_in_words_that_can_be_translated() {
        let closed_forms: Vec<&str> = closed_form::all().iter().map(|solver| solver.name()).collect();
        let faulty = (0..faults::FAULTS.len()).map(|fault| faults::faulty(fault, 1.0, 0).0);
        for observations in cases::cases().into_iter().map(|case| case.observations).chain(faulty) {
            let diagnosis = faults::examined(&observations);
            let of_hypotheses = diagnosis.hypotheses.iter().flat_map(|h| [&h.text, &h.advice]);
            for text in diagnosis.findings.iter().map(|finding| &finding.text).chain(of_hypotheses) {
                let values = text.say(Wordless);
                let is_prose = |word: &str| word.len() > 3 && !closed_forms.contains(&word);
                let prose: Vec<&str> =
                    values.split(|c: char| !c.is_alphabetic() && c != '_').filter(|word| is_prose(word)).collect();
                assert!(prose.is_empty(), "{prose:?} can be said in English only: {text:?}");
            }
        }
    }
}
