use handeye_estimate::diagnose::doctor;
use handeye_estimate::diagnose::findings::{self, FindingCode, FindingOptions};
use handeye_estimate::handeye::screening::Distance;
use handeye_estimate::handeye::{HandEyeError, Mode};
use handeye_estimate::stated_uncertainty::StatedUncertainty;
use handeye_estimate::uncertainty::overdispersion::{Evidence, Overdispersion};
use handeye_estimate::{CameraKnowledge, Observations, ObservedView, ShapeEstimate, ViewStatus};
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::{CancelToken, Stage};
use handeye_geometry::targets::bent::BoardShape;
use handeye_result::TruthComparison;
use std::collections::BTreeSet;
use std::sync::Arc;

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::{Goal, JobId, SolveStatus};
use handeye_workbench::session::{self, start::BOARD};
use handeye_workbench::solve;
use handeye_workbench::testing::sample;
use handeye_workbench::text::{Language, Text};

fn driven(model: Model) -> Driven {
    Driven::new(result_ui, model)
}

#[test]
fn without_an_answer_it_says_what_is_missing() {
    let mut pane = driven(sample::connected());
    assert!(pane.sees("No calibration yet"));
    assert!(pane.sees("Captures so far: 0."));
    assert!(!pane.is_enabled("Solve"));
    *pane.model() = sample::captured();
    pane.steps();
    assert!(pane.sees("Captures so far: 10."));
    assert_eq!(pane.click("Solve"), [Command::Solve(solve::Command::Solve)]);
}

#[test]
fn the_headline_is_the_expected_error_and_not_a_residual() {
    let model = sample::with_answer(|solved| {
        solved.result.quality.tip_error_95_mm = Some(0.213);
        solved.result.quality.rms_px = Some(0.07);
    });
    let mut pane = driven(model);
    assert!(pane.sees("0.213 mm"));
    assert!(pane.sees("Expected error (95 %)"));
    assert!(pane.sees("The goal is reached"));
    assert!(pane.sees("Residuals (not accuracy)"));
    assert!(pane.sees("Fit, RMS: 0.070 px"));
    pane.model().view.goal = Goal(0.1e-3);
    pane.steps();
    assert!(pane.sees("The goal is not reached yet"));
}

#[test]
fn what_a_tool_arrives_within_is_said_and_that_the_arm_is_the_limit_where_it_is() {
    let with = |as_it_is, corrected| {
        driven(sample::with_answer(|solved| {
            solved.result.quality.tip_error_95_mm = Some(1.234);
            solved.result.quality.reach_error_95_mm = as_it_is;
            solved.result.quality.reach_error_corrected_95_mm = corrected;
        }))
    };
    let mut pane = with(Some(2.91), Some(0.25));
    pane.model().view.goal = Goal(0.3e-3);
    pane.steps();
    assert!(pane.sees("A tool arrives within (95 %)") && pane.sees("2.91 mm") && pane.sees("0.25 mm"));
    assert!(pane.sees("a tool of 100 mm"));
    assert!(pane.sees("The goal is reached with corrected commands: the arm is the limit"));
    assert!(pane.sees("Expected error of a measured point: 1.234 mm (95 %)"));
    pane.model().view.goal = Goal(0.22e-3);
    pane.steps();
    assert!(pane.sees("The goal is not reached yet"), "corrected commands do not reach it either");
    pane.model().view.goal = Goal(3e-3);
    pane.steps();
    assert!(pane.sees("The goal is reached") && !pane.sees("The arm is the limit"), "commands as they are do");
    let pane = with(Some(2.91), None);
    assert!(pane.sees("2.91 mm") && !pane.sees("with corrected commands"), "its controller has another chain");
    let pane = with(None, None);
    assert!(!pane.sees("A tool arrives") && pane.sees("1.234 mm"), "an arm that is not known promises nothing");
}

#[test]
fn the_accuracy_of_a_robot_is_asked_for_where_its_arm_is_not_known() {
    const FIELD: &str = "Accuracy of the robot";
    let mut pane = driven(sample::with_answer(|solved| solved.result.quality.tip_error_95_mm = Some(0.2)));
    assert!(pane.sees("How near a tool arrives is not known") && pane.sees(FIELD));
    pane.type_into(FIELD, "0.5 mm");
    let sent = pane.press(egui::Key::Enter);
    let wanted = session::Command::SetRobotAccuracy(Some(0.5));
    assert_eq!(sent.last(), Some(&Command::Session(wanted)));
    let by_accuracy = |mm: Option<f64>| {
        let mut model = sample::with_answer(|solved| {
            solved.result.quality.reach_error_95_mm = Some(1.8);
            solved.result.quality.robot_accuracy_mm = mm;
        });
        Arc::make_mut(&mut model.session.document).meta.robot_accuracy_mm = mm;
        driven(model)
    };
    let mut pane = by_accuracy(Some(0.5));
    assert!(pane.sees("1.80 mm") && pane.sees(FIELD), "what it follows from can be changed");
    pane.type_into(FIELD, "0");
    let sent = pane.press(egui::Key::Enter);
    assert_eq!(sent.last(), Some(&Command::Session(session::Command::SetRobotAccuracy(None))), "nothing is not known");
    assert!(!by_accuracy(None).sees(FIELD), "the errors of its arm say more");
}

#[test]
fn a_camera_without_a_robot_has_no_error_of_a_tip() {
    let pane = driven(sample::with_answer(|solved| {
        solved.calibration.hand_eye = None;
        solved.result.quality.tip_error_95_mm = None;
    }));
    assert!(pane.sees("There are no robot poses, so only the camera itself is calibrated."));
    for of_robot in ["Expected error (95 %)", "Not known", "Robot position"] {
        assert!(!pane.sees(of_robot), "{of_robot}");
    }
}

#[test]
fn images_without_a_robot_are_not_asked_for_poses() {
    let mut images = sample::images_alone();
    Arc::make_mut(&mut images.session.document).captures.truncate(2);
    let pane = driven(images);
    assert!(pane.sees("at least three images of the board in use, now 2"));
    assert!(!pane.is_enabled("Solve") && !pane.sees("poses"));
}

#[test]
fn the_goal_is_typed_in_millimetres_and_sent_in_metres() {
    let mut pane = driven(sample::solved());
    pane.type_into("Goal", "0.25");
    let sent = pane.press(egui::Key::Enter);
    let last = sent.last().expect("a command");
    assert!(
        matches!(last, Command::Solve(solve::Command::SetGoal(metres)) if (metres - 0.25e-3).abs() < 1e-12),
        "{sent:?}"
    );
}

#[test]
fn the_camera_in_the_tip_is_in_millimetres_with_its_uncertainty() {
    let model = sample::with_answer(|solved| {
        solved.result.truth = Some(TruthComparison {
            translation_error_mm: Some(0.0415),
            rotation_error_deg: Some(0.0123),
            focal_error_percent: Some(0.05),
        });
    });
    let pane = driven(model);
    assert!(pane.sees("Camera in tip"));
    // The sample's camera is 50 mm along x and turned by 90° about z.
    assert!(pane.sees("x y z [mm]: 50.0") || pane.sees("x y z [mm]: 49.9"));
    assert!(pane.sees("± 95 % [mm]"));
    assert!(pane.sees("± 95 % [°]"));
    assert!(pane.sees("Position off by: 0.042 mm") || pane.sees("Position off by: 0.041 mm"));
    assert!(pane.sees("Rotation off by: 0.0123°"));
    assert!(pane.sees("Focal length off by: 0.050 %"));
    assert!(pane.sees("Within the stated 95 %"));
    assert!(pane.nothing_is_cut_off());
}

#[test]
fn with_something_found_no_uncertainty_is_stated_for_an_axis_and_the_reason_is_not_the_method() {
    let pane = driven(sample::with_answer(|solved| {
        solved.calibration = solved.calibration.clone().claiming(StatedUncertainty::Moved(Vec::new()));
    }));
    assert!(pane.sees("With what was found below no ± can be stated for each axis."));
    assert!(!pane.sees("A closed form states no uncertainty.") && !pane.sees("± 95 % [mm]"));
}

#[test]
fn a_solve_shows_its_stage_and_can_be_cancelled() {
    let mut model = sample::captured();
    model.solve.status = SolveStatus::Running { job: JobId(2), stage: Stage::HeldOut, part: 0.4, since_s: 97.0 };
    let mut pane = driven(model);
    assert!(pane.sees("Solving for 3 s: predicting held-out views"));
    assert!(pane.nothing_is_cut_off());
    assert_eq!(pane.click("Cancel solving"), [Command::Solve(solve::Command::Cancel)]);
}

#[test]
fn a_failed_solve_says_why_and_can_be_tried_again() {
    let mut model = sample::captured();
    model.solve.status = SolveStatus::Failed { why: Text::verbatim("Turn the tip by 30° or more.") };
    let mut pane = driven(model);
    assert!(pane.sees("Turn the tip by 30° or more."));
    assert_eq!(pane.click("Solve again"), [Command::Solve(solve::Command::Solve)]);
}

#[test]
fn an_answer_of_earlier_captures_is_marked() {
    let mut model = sample::solved();
    model.solve.fresh = false;
    let mut pane = driven(model);
    assert!(pane.sees("Out of date"));
    assert_eq!(pane.click("Solve again"), [Command::Solve(solve::Command::Solve)]);
}

#[test]
fn another_method_is_chosen_from_the_comparison() {
    let model = sample::with_answer(|solved| {
        let failed = solved.calibration.methods.iter_mut().find(|method| method.name == "andreff");
        failed.expect("andreff").outcome =
            Err(HandEyeError::NoSolution { method: "andreff", views: 10, reason: "a test says so" });
    });
    let mut pane = driven(model);
    assert!(pane.sees("no answer"));
    assert_eq!(pane.click("Park & Martin"), [Command::Solve(solve::Command::SetMethod("park_martin".to_owned()))]);
    assert!(pane.click("Joint estimate").is_empty(), "it is chosen already");
}

#[test]
fn keeping_all_views_is_one_click() {
    let mut pane = driven(sample::with_an_outlier());
    assert!(pane.sees("Outlier views: 1 of 10"));
    assert_eq!(pane.click("Keep all views"), [Command::Solve(solve::Command::SetKeepOutliers(true))]);
    pane.model().keep_outliers = true;
    pane.steps();
    assert_eq!(pane.click("Keep all views"), [Command::Solve(solve::Command::SetKeepOutliers(false))]);
}

/// The findings of the estimate, all of them.
fn with_everything_found(calibration: &mut handeye_estimate::diagnose::Calibration) {
    for view in calibration.views.iter_mut().take(2) {
        view.status = ViewStatus::Outlier;
        view.distance = Some(Distance { of_limit: 4.0, metres: 8e-3, radians: 0.02 });
    }
    calibration.views[3].rejected_corners = vec![1, 2];
    calibration.views[4].quarter_turns = 2;
    let joint = calibration.joint.as_mut().expect("a joint estimate");
    joint.shape = Some(ShapeEstimate {
        shape: BoardShape { warp_m: [4e-4, -1e-4], scale: 1.0 },
        warp_sigma_m: Some([3e-5, 2e-5]),
        scale_sigma: None,
    });
    joint.widening = Overdispersion { factor: 4.0, by: Some(Evidence::Neighbours), lens: 1.0, checks: Vec::new() };
    joint.small_sample.level_sigma = [0.1, 0.8, 0.9];
    joint.noise.view_px = 0.12;
    // What a robot shows: less is below what can be resolved, and is not reported.
    (joint.noise.robot_m, joint.noise.robot_rad) = (2e-4, 5e-4);
    (joint.small_sample.level_range[1], joint.small_sample.level_range[2]) = ([5e-5, 4e-4], [1e-4, 1e-3]);
    joint.robot_effect_px = 10.0;
    // The camera's place along its own x axis is known worst.
    let mut covariance = nalgebra::Matrix6::identity() * 1e-12;
    covariance[(0, 0)] = 1e-6;
    calibration.link_covariances.as_mut().expect("stated").hand_eye = covariance;
}

#[test]
fn what_the_estimate_found_out_is_stated_with_units() {
    let pane = driven(sample::with_answer(|solved| with_everything_found(&mut solved.calibration)));
    for line in [
        "Outlier views: 2 of 10",
        "Outlier corners: 2, in 1 of 10 views",
        "Bend of the board: x 0.400 ± 0.030 mm, y -0.100 ± 0.020 mm",
        "Noise of views: 0.120 px",
        "Uncertainty widened: 2.0 times",
        "the robot is off in the same direction in neighbouring poses",
        "degrees of freedom",
    ] {
        assert!(pane.sees(line), "{line}");
    }
    assert!(pane.nothing_is_cut_off());
    let plain = driven(sample::with_answer(|solved| {
        solved.calibration.joint = None;
    }));
    assert!(!plain.sees("What the estimate found out"), "there is nothing to say");
}

#[test]
fn a_camera_beside_the_robot_is_shown_in_the_base() {
    let model = sample::with_answer(|solved| {
        let hand_eye = solved.calibration.hand_eye.expect("a hand-eye");
        solved.calibration.hand_eye = Some(handeye_estimate::handeye::HandEye::new(
            Mode::EyeToHand,
            hand_eye.mount_from_camera(),
            hand_eye.anchor_from_target(),
        ));
    });
    assert!(driven(model).sees("Camera in base"));
}

/// What the sample was calibrated from.
fn observations(model: &Model) -> Observations {
    let views = model.document().in_use().map(|record| {
        let corners = model.observed(record.id).and_then(|observed| observed.corners.clone());
        ObservedView::new(&record.image, record.base_from_tip, corners)
    });
    Observations {
        mode: Some(Mode::EyeInHand),
        target: BOARD,
        image_size: (640, 480),
        camera: CameraKnowledge::NOTHING,
        views: views.collect(),
    }
}

/// Findings of every code, from the core itself.
fn every_finding() -> Vec<findings::Finding> {
    let model = sample::solved();
    let good = observations(&model);
    let calibration = model.solve.current().expect("solved").calibration.clone();
    let mut found = Vec::new();
    let mut judge = |observations: &Observations,
                     change: &dyn Fn(&mut handeye_estimate::diagnose::Calibration),
                     goal| {
        let mut calibration = calibration.clone();
        change(&mut calibration);
        found.extend(findings::findings(observations, Some(&calibration), &FindingOptions::with_goal_mm(Some(goal))));
    };
    let turned = |views: usize, axes: &dyn Fn(usize) -> [f64; 3]| {
        let mut observations = good.clone();
        observations.views.truncate(views);
        for (n, view) in observations.views.iter_mut().enumerate() {
            let turn = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::from(axes(n)));
            view.base_from_tip =
                Some(Pose::from_isometry(nalgebra::Isometry3::from_parts(nalgebra::Translation3::identity(), turn)));
        }
        observations
    };
    judge(&good, &|_| (), 1000.0);
    judge(&good, &|_| (), 1e-9);
    judge(&good, &|_| (), 0.95 * 1e3 * calibration.tip_error_95_m().expect("stated"));
    for views in [1, 2, 5] {
        judge(&turned(views, &|n| [0.0, 0.0, 0.3 * n as f64]), &|_| (), 1000.0);
    }
    judge(&turned(10, &|n| [0.001 * n as f64, 0.0, 0.0]), &|_| (), 1000.0);
    judge(&turned(10, &|n| [0.5 * (n % 3) as f64, 0.1 * (n % 4) as f64, 0.05 * (n % 5) as f64]), &|_| (), 1000.0);
    let mut lost = good.clone();
    lost.views.iter_mut().skip(3).for_each(|view| view.corners = None);
    judge(&lost, &|_| (), 1000.0);
    let mut one_lost = good.clone();
    one_lost.views[0].corners = None;
    judge(&one_lost, &|_| (), 1000.0);
    let mut given = good.clone();
    given.camera = CameraKnowledge::Fixed(sample::intrinsics());
    given.image_size = (6400, 4800);
    judge(&given, &|_| (), 1000.0);
    judge(&Observations { image_size: (6400, 4800), ..good.clone() }, &|_| (), 1000.0);
    judge(
        &good,
        &|c| {
            for (n, view) in c.views.iter_mut().filter(|view| view.status == ViewStatus::Used).enumerate() {
                let times = if n == 0 { 100.0 } else { 1.0 };
                view.influence_m = Some(1e-5 * times);
                view.rms_px = Some(0.1 * times);
                view.correction_m = Some(1e-4 * times);
                view.correction_rad = Some(1e-4 * times);
                view.camera_from_target = Some(Pose::from_translation_xyzw([0.0, 0.0, 0.4], [0.0, 0.0, 0.0, 1.0]));
            }
            // A tenth of a millimetre.
            let small = (1e-4 / c.tip_error_95_m().expect("stated")).powi(2);
            c.link_covariances.as_mut().expect("a joint estimate").hand_eye *= small;
            let joint = c.joint.as_mut().expect("a joint estimate");
            joint.heldout_rms_px = Some(3.0);
            joint.expected_heldout_rms_px = 1.0;
            joint.robot_effect_px = 10.0;
            let shift = Pose::from_translation_xyzw([0.0, 0.0, 0.02], [0.0, 0.0, 0.0, 1.0]);
            for method in c.methods.iter_mut().take(1) {
                if let Ok(solution) = &mut method.outcome {
                    solution.mount_from_camera = solution.mount_from_camera * shift;
                }
            }
        },
        1000.0,
    );
    judge(&good, &with_everything_found, 1000.0);
    judge(
        &good,
        &|c| {
            for (n, method) in c.methods.iter_mut().enumerate() {
                let shift = Pose::from_translation_xyzw([0.0, 0.02 * n as f64, 0.0], [0.0, 0.0, 0.0, 1.0]);
                if let Ok(solution) = &mut method.outcome {
                    solution.mount_from_camera = solution.mount_from_camera * shift;
                }
            }
        },
        1000.0,
    );
    found
}

#[test]
fn every_finding_is_said_in_both_languages_with_its_numbers() {
    let found = every_finding();
    let codes: BTreeSet<FindingCode> = found.iter().map(|finding| finding.code).collect();
    assert_eq!(codes.len(), 22, "{codes:?}");
    found.iter().for_each(is_translated_in_both_languages);
}

fn is_translated_in_both_languages(finding: &findings::Finding) {
    assert_eq!(finding.text.in_language(Language::English), finding.to_record().text);
    let chinese = finding.text.in_language(Language::Chinese);
    // Latin words that remain are names of files, methods, frames, units and axes.
    let kept =
        "images png tsai lenz park martin horaud andreff daniilidis shah li base from tip mm m px x y z w e ChArUco";
    let kept: BTreeSet<&str> = kept.split(' ').chain([""]).collect();
    let latin = chinese.split(|c: char| !c.is_ascii_alphabetic());
    let left: Vec<&str> = latin.filter(|word| !kept.contains(word)).collect();
    assert!(left.is_empty(), "{left:?} in {chinese}");
    assert_ne!(chinese, finding.to_string(), "not translated");
}

#[test]
fn what_the_doctor_says_of_a_session_is_said_in_both_languages() {
    let good = observations(&sample::solved());
    let mut found = Vec::new();
    let mut examine = |change: &dyn Fn(usize, &mut nalgebra::Isometry3<f64>)| {
        let mut observations = good.clone();
        for (n, view) in observations.views.iter_mut().enumerate() {
            let mut pose = *view.base_from_tip.expect("a robot pose").isometry();
            change(n, &mut pose);
            view.base_from_tip = Some(Pose::from_isometry(pose));
        }
        let diagnosis = doctor::diagnose(&observations, &FindingOptions::default(), &CancelToken::default());
        found.extend(diagnosis.findings);
    };
    examine(&|_, pose| *pose = pose.inverse());
    examine(&|_, pose| pose.translation.vector *= 1e3);
    examine(&|n, pose| pose.translation.vector.x += if n < 5 { 0.0 } else { 0.02 });
    examine(&|n, pose| pose.translation.vector.y += if n == 3 { 0.03 } else { 0.0 });
    examine(&|n, pose| pose.translation.vector.z += if n == 3 { f64::NAN } else { 0.0 });
    let codes: BTreeSet<FindingCode> = found.iter().map(|finding| finding.code).collect();
    assert!(codes.contains(&FindingCode::InvertedPoses) || codes.contains(&FindingCode::WrongMode), "{codes:?}");
    assert!(codes.contains(&FindingCode::WrongLengthUnit) && codes.contains(&FindingCode::NotFinite), "{codes:?}");
    found.iter().for_each(is_translated_in_both_languages);
}

#[test]
fn the_pane_is_there_in_chinese() {
    let mut model = sample::solved();
    model.view.language = Language::Chinese;
    let pane = driven(model);
    assert!(pane.sees("预期误差"));
    assert!(!pane.sees("Expected error"));
}
