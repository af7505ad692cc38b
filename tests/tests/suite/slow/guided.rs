//! Guided capture: from the board in view to a calibration with the requested accuracy, from the command line and with one
//! click, on the built-in cell over its real socket.

use std::path::Path;
use std::process::{Command as Process, Output};

use handeye_cell::scene::Scene;
use handeye_geometry::planar_pose;
use handeye_geometry::targets::observation::Corner;
use handeye_result::CalibrationResult;
use handeye_result::guided_record::GuidedRecord;
use handeye_server::{CellConfig, CellServer};
use handeye_session::Role;
use handeye_tests::workbench::Workbench;
use handeye_tests::{handeye_binary, hurry, workspace_root};
use handeye_workbench::guided::state::GuidedProgress;
use handeye_workbench::model::{CellSource, JogSettings, Model, Motion, MotionGoal};
use handeye_workbench::text::Text;
use handeye_workbench::{by_hand, connect, guided, motion, taught};
use nalgebra::Point3;

fn auto(folder: &Path, arguments: &[&str]) -> Output {
    let out = folder.join("session");
    let mut all = vec!["auto", "--quiet", "--rerun", "off", "--out", out.to_str().expect("UTF-8")];
    all.extend_from_slice(arguments);
    Process::new(handeye_binary()).args(all).output().expect("the binary is built: cargo build -p handeye_app")
}

fn scene(name: &str) -> String {
    workspace_root().join("assets/scenes").join(name).to_str().expect("UTF-8").to_owned()
}

#[test]
fn a_noisy_cell_and_a_seven_joint_arm_reach_the_goal_and_the_answer_is_checked() {
    for (name, goal) in [("realistic.toml", "0.5"), ("panda.toml", "0.3")] {
        let folder = tempfile::tempdir().expect("a folder");
        let output = auto(folder.path(), &["--poses", "guided", "--goal", goal, "--scene", &scene(name)]);
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let session = folder.path().join("session");
        let result = CalibrationResult::read(&session.join("result.json")).expect("a result");
        let goal_mm: f64 = goal.parse().expect("a number");
        let guided = result.guided.as_ref().expect("its poses were chosen");
        assert_eq!(guided.ending.as_ref().map(|it| it.code.as_str()), Some("goal_reached"), "{name}: {guided:?}");
        let stated_mm = result.quality.tip_error_95_mm.expect("stated");
        assert!(stated_mm <= goal_mm, "{name}: {stated_mm} mm");
        // However the poses were chosen, the truth decides: the error of the camera's translation alone is no larger
        // than that of a point.
        let truth = result.truth.expect("the cell publishes its truth");
        let off_mm = truth.translation_error_mm.expect("known");
        println!("{name}: {} views, stated {stated_mm:.3} mm, camera off by {off_mm:.3} mm", result.views.len());
        assert!(off_mm < 2.0 * goal_mm, "{name}: {off_mm} mm");
        assert!(result.views.len() <= 25, "{name}: {} views", result.views.len());
        assert_eq!(result.verification.as_ref().map(|it| it.captures), Some(3), "{name}");
        // The same in the session, for later study.
        let kept = std::fs::read_to_string(session.join("guided.json")).expect("the record");
        assert_eq!(&serde_json::from_str::<GuidedRecord>(&kept).expect("JSON"), guided);
        let captured = guided.steps.iter().filter(|step| step.outcome == "captured").count();
        // The first view is where the arm was.
        assert_eq!(captured + 1, result.views.len(), "{name}");
        assert!(guided.steps.iter().any(|step| step.promised_mm.is_some() && step.achieved_mm.is_some()));
    }
}

/// Its links have errors, and no transform gives a point in space to better than a millimetre; with corrected commands a tool gets
/// there all the same, and the goal applies to that.
#[test]
fn a_nominal_arm_reaches_the_goal_with_corrected_commands() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = auto(folder.path(), &["--poses", "guided", "--goal", "0.3", "--scene", &scene("nominal.toml")]);
    let reported = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{reported}");
    let result = CalibrationResult::read(&folder.path().join("session/result.json")).expect("a result");
    let ending = result.guided.and_then(|guided| guided.ending).expect("it has ended");
    assert_eq!(ending.code, "goal_reached");
    assert!(ending.text.contains("with corrected commands"), "{}", ending.text);
    let quality = &result.quality;
    let (plain, corrected) = quality.reach_error_95_mm.zip(quality.reach_error_corrected_95_mm).expect("a known arm");
    assert!(corrected <= 0.3 && plain > 0.9, "{plain} mm as it is, {corrected} mm corrected");
    assert!(quality.tip_error_95_mm.is_some_and(|error_mm| error_mm > 0.3), "{quality:?}");
    let goal = result.findings.iter().find(|finding| finding.code == "goal_reached").expect("it is found, too");
    assert!(goal.text.contains("handeye correct"), "{}", goal.text);
    assert!(result.views.len() <= 25, "{} views", result.views.len());
    // The verification captures confirm it.
    let checked = result.verification.expect("three captures");
    let by_arm = checked.corrected.as_ref().expect("their joints are known");
    assert!(by_arm.centre_rms_mm < 0.5 * checked.centre_rms_mm && by_arm.centre_rms_mm < 0.3, "{checked:?}");
    assert_eq!(by_arm.as_stated, Some(true), "{checked:?}");
    assert!(result.arm.is_some_and(|arm| arm.intrinsics.is_some()), "the lens that goes with the arm");
}

#[test]
fn a_goal_out_of_reach_fails_with_the_reason_and_keeps_the_answer() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = ["--poses", "guided", "--goal", "0.001", "--max-poses", "9", "--check-poses", "0"];
    let scene = scene("realistic.toml");
    let output = auto(folder.path(), &[&arguments[..], &["--scene", &scene]].concat());
    assert_eq!(output.status.code(), Some(1));
    let reported = String::from_utf8_lossy(&output.stderr).into_owned();
    // A robot with a repeatability of 0.05 mm gets no tool within a thousandth.
    assert!(reported.contains("the goal is not reached") && reported.contains("does not repeat"), "{reported}");
    let result = CalibrationResult::read(&folder.path().join("session/result.json")).expect("a result all the same");
    assert_eq!(result.views.len(), 9);
    assert!(result.verification.is_none());

    let output = auto(folder.path(), &["--poses", "seed10", "--goal", "0.3"]);
    assert_eq!(output.status.code(), Some(2), "a goal is nobody's but the guide's");
}

/// The built-in cell at a pace of its own, with the board in view.
fn connected(folder: &Path) -> (Workbench, CellServer) {
    let mut scene = Scene::reference().expect("the scene");
    hurry(&mut scene);
    let cell = CellServer::start(CellConfig { real_time: Some(true), ..CellConfig::new(scene) }).expect("a cell");
    let mut bench = Workbench::start(CellSource::Address(cell.endpoint()), folder, None);
    bench.until("a cell", |model| {
        let connected = model.control.is_connected() && model.camera.is_connected() && model.mover.is_connected();
        connected && model.frame.is_some() && model.cell.is_some() && model.robot.is_some()
    });
    bench.click(connect::Command::StartSimulation);
    bench.until("passing time", |model| model.resting_simulation().is_none());
    bench.until("the board", |model| model.board_seen_s.is_some());
    bench.click(motion::Command::SetJog(JogSettings { speed: Some(1.0), ..JogSettings::default() }));
    // Behind an address the arm may be real, and each move waits for the user; the first one always does.
    bench.click(taught::Command::SetConfirmMoves(false));
    (bench, cell)
}

fn count(model: &Model, role: Role) -> usize {
    model.document().captures.iter().filter(|it| it.role == role).count()
}

#[test]
fn one_click_leads_from_the_board_in_view_to_a_checked_answer_below_the_goal() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = connected(folder.path());
    bench.allow(guided::Command::CalibrateForMe);
    bench.until("a choice", |model| {
        model.sequence.as_ref().and_then(|it| it.guided.as_ref()).is_some_and(|guided| guided.why.is_some())
    });
    bench.until("the end", |model| !model.sequence_runs);
    bench.until("the checks", |model| model.solve.current().is_some_and(|solved| solved.verified_captures.len() == 3));
    let model = bench.model();
    let solved = model.solve.current().expect("solved");
    let error_mm = solved.result.quality.tip_error_95_mm.expect("stated");
    assert!(error_mm <= model.view.goal.0 * 1e3, "{error_mm} mm: {}", bench.text());
    assert!((8..=16).contains(&count(model, Role::Calibration)), "{}", count(model, Role::Calibration));
    assert_eq!(count(model, Role::Verification), 3);
    assert!(bench.text().contains("The goal is reached"), "{}", bench.text());
}

#[test]
fn a_stop_ends_it_at_once_and_it_goes_on_from_there_when_wished() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = connected(folder.path());
    bench.allow(guided::Command::CalibrateForMe);
    bench.until("two captures", |model| count(model, Role::Calibration) >= 2);
    bench.click(motion::Command::Stop);
    bench.until("the arm at rest", |model| !model.sequence_runs && !model.stop_pending && model.motion == Motion::Idle);
    let kept = count(bench.model(), Role::Calibration);
    let sim_time = |model: &Model| model.robot.as_ref().map_or(0.0, |robot| robot.sim_time_s);
    let stopped_s = sim_time(bench.model());
    bench.until("two seconds", |model| sim_time(model) > stopped_s + 2.0);
    assert_eq!(count(bench.model(), Role::Calibration), kept, "nothing goes on by itself");
    // Existing captures count.
    bench.allow(taught::Command::ContinueSequence);
    bench.until("the end", |model| !model.sequence_runs && count(model, Role::Verification) == 3);
    assert!(count(bench.model(), Role::Calibration) <= kept + 16);
}

fn guided(model: &Model) -> Option<&GuidedProgress> {
    model.sequence.as_ref().filter(|_| model.sequence_runs)?.guided.as_deref()
}

#[test]
fn step_by_step_each_move_is_let_or_skipped_and_all_of_it_is_kept_in_the_session() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = connected(folder.path());
    bench.click(taught::Command::SetConfirmMoves(true));
    bench.click(guided::Command::CalibrateForMe);
    let waits = |model: &Model| guided(model).is_some() && model.asked.is_some();
    bench.until("a pose that waits", waits);
    let first = guided(bench.model()).expect("it runs").ahead[0].base_from_tip;
    bench.click(taught::Command::SkipMove);
    bench.until("another one", |model| {
        waits(model) && guided(model).is_some_and(|it| it.ahead[0].base_from_tip != first)
    });
    for captures in 2..=4 {
        let before = bench.model().robot.as_ref().expect("connected").joints_rad;
        bench.until("a pose that waits", waits);
        assert_eq!(bench.model().robot.as_ref().expect("connected").joints_rad, before, "it moved by itself");
        bench.click(taught::Command::ConfirmMove);
        bench.until("a capture", |model| count(model, Role::Calibration) == captures);
    }
    bench.until("a pose that waits", waits);
    bench.click(motion::Command::Stop);
    bench.until("the end", |model| !model.sequence_runs);
    let session = bench.model().session.folder.clone().expect("a session");
    // It is written on another thread.
    let outcomes = || -> Option<Vec<String>> {
        let kept = std::fs::read_to_string(session.join("guided.json")).ok()?;
        let record: GuidedRecord = serde_json::from_str(&kept).expect("whole at any time");
        Some(record.steps.into_iter().map(|step| step.outcome).collect())
    };
    bench.until("the record", |_| {
        outcomes().is_some_and(|reported| reported == ["skipped", "captured", "captured", "captured", "pending"])
    });
}

/// The hand is simulated by motions of the arm to where the wanted view would be seen; nothing else moves the arm.
#[test]
fn a_person_who_brings_about_the_views_that_are_asked_for_gets_a_checked_answer() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = connected(folder.path());
    bench.click(by_hand::Command::Guide);
    let wanted = |model: &Model| model.by_hand.as_ref().and_then(|hand| hand.wanted.clone());
    let mut skipped = 0;
    for _ in 0..100 {
        bench.until("a view, or the end", |model| model.by_hand.is_none() || wanted(model).is_some());
        let Some(view) = wanted(bench.model()) else { break };
        let truth = bench.model().cell.as_ref().and_then(|cell| cell.truth.clone()).expect("a simulated cell");
        let base_from_target = truth.base_from_target.expect("it says where its board is");
        // Where the image matches the wanted one, whatever lens that was drawn with.
        let target = bench.model().document().meta.target;
        let corner = |(index, point)| {
            let point: Point3<f64> = view.camera_from_target.isometry() * point;
            Corner { index, px: view.intrinsics().project(&point).expect("before the camera"), covariance_px2: None }
        };
        let alike: Vec<Corner> = target.points().into_iter().enumerate().map(corner).collect();
        let seen_so = planar_pose::camera_from_target(&alike, &target, &truth.intrinsics).expect("a view");
        let tip = base_from_target * seen_so.inverse() * truth.tip_from_camera.inverse();
        bench.click(motion::Command::Move { goal: MotionGoal::Tip(tip), what: Text::verbatim("by hand") });
        bench.until("the arm at rest", |model| model.motion == Motion::Idle);
        let at = bench.model().robot.as_ref().expect("connected").base_from_tip;
        let is_there = |model: &Model| wanted(model).is_none_or(|now| now != view);
        if at.distance_to(&tip).0 > 0.02 {
            bench.click(by_hand::Command::SkipView);
            skipped += 1;
        }
        bench.until("another view", is_there);
    }
    bench.until("the checks", |model| model.solve.current().is_some_and(|solved| solved.verified_captures.len() == 3));
    let model = bench.model();
    let error_mm = model.solve.current().and_then(|solved| solved.result.quality.tip_error_95_mm).expect("stated");
    assert!(error_mm <= model.view.goal.0 * 1e3, "{error_mm} mm: {}", bench.text());
    assert!(count(model, Role::Calibration) >= 8);
    println!("{skipped} views were out of reach");
    assert!(bench.text().contains("The goal is reached"), "{}", bench.text());
}
