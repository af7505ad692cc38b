//! Small versions of the studies of the doctor; the example `doctor_cases` runs them at length.

#[path = "../../studies/doctor_cases/arm.rs"]
mod arm;
#[path = "../../studies/doctor_cases/cases.rs"]
mod cases;
#[path = "../../studies/doctor_cases/faults.rs"]
mod faults;
#[path = "../../studies/doctor_cases/sim.rs"]
mod sim;

use handeye_core::diagnose::doctor::diagnose;
use handeye_core::diagnose::findings::{FindingCode, FindingOptions, Severity};
use handeye_core::estimate::handeye::Mode;
use handeye_core::estimate::handeye::closed_form;
use handeye_core::geometry::planar_pose;
use handeye_core::progress::CancelToken;
use handeye_core::testing::sessions::camera;
use handeye_core::wording::Catalogue;

use sim::{Fault, Setup, session};

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
        let alone: Vec<String> = values.map(|(name, _)| format!("{{{name}}}")).collect();
        Some(alone.join(" ").leak())
    }
}

#[test]
fn whatever_is_found_is_said_in_words_that_can_be_translated() {
    let closed_forms: Vec<&str> = closed_form::all().iter().map(|solver| solver.name()).collect();
    let faulty = (0..faults::FAULTS.len()).map(|fault| faults::faulty(fault, 0).0);
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

#[test]
fn healthy_sessions_raise_no_alarm() {
    for seed in 0..8 {
        let diagnosis = faults::examined(&faults::healthy(seed));
        let grave: Vec<_> = diagnosis.findings.iter().filter(|f| f.severity >= Severity::Warning).collect();
        assert!(diagnosis.is_healthy(), "session {seed}: {grave:?} {:?}", diagnosis.untested);
    }
}

#[test]
fn each_injected_fault_is_ranked_first() {
    for (fault, name) in faults::FAULTS.iter().enumerate() {
        for seed in 0..2 {
            let (observations, code) = faults::faulty(fault, seed);
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
