//! The window with drivers: programs of their own, two clocks, a driver that is killed, a robot whose poses are typed.

use std::path::{Path, PathBuf};
use std::process::Command as Program;

use handeye_cell::scene::{Scene, ShippedScene};
use handeye_coppeliasim::cell::{Arm, CellPaths, MotionTolerance, SettleOptions};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_geometry::frames::{Camera, Pose, Tip};
use handeye_link::limits;
use handeye_plan::guided::CHECKS;
use handeye_server::{CellConfig, CellServer};
use handeye_tests::handeye_binary;
use handeye_tests::workbench::Workbench;
use handeye_workbench::model::{
    CapturePurpose, CellSource, Drivers, JogSettings, LinkState, Model, Motion, SolveStatus,
};
use handeye_workbench::{capture, connect, export, guided, motion, taught};

/// A cell that keeps pace with real time, as drivers of hardware do.
fn cell() -> (CellServer, Endpoint) {
    let scene = Scene::reference().expect("the scene");
    let cell = CellServer::start(CellConfig { real_time: Some(true), ..CellConfig::new(scene) }).expect("a cell");
    let endpoint = cell.endpoint().parse().expect("an address");
    (cell, endpoint)
}

/// The command of a driver of one part of that cell, with its clock ahead by this much.
fn driver(cell: &Endpoint, part: &str, clock_s: f64) -> String {
    format!("'{}' driver fake --connect {cell} --only {part} --clock {clock_s}", handeye_binary().display())
}

fn arm(cell: &Endpoint) -> Arm {
    Arm::connect(cell, &ConnectionOptions::default(), &CellPaths::default()).expect("the cell")
}

fn reference_poses() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/poses/seed10.toml")
}

fn is_connected(model: &Model) -> bool {
    model.control.is_connected() && model.camera.is_connected() && model.frame.is_some() && model.cell.is_some()
}

fn is_solved(model: &Model) -> bool {
    model.solve.status == SolveStatus::Idle && model.solve.fresh
}

/// The error of the answer \[mm\] relative to the truth, which no driver reports.
fn error_mm(bench: &Workbench, truth: &Pose<Tip, Camera>) -> f64 {
    let solved = bench.model().solve.current().expect("solved");
    let found = solved.result.hand_eye.as_ref().expect("a robot").translation_m;
    distance(found, truth.translation().into()) * 1e3
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn bench(robot: Option<String>, camera: Option<String>, sessions: &Path) -> Workbench {
    let mut bench = Workbench::start(CellSource::Drivers(Drivers { robot, camera }), sessions, None);
    bench.until("a cell", is_connected);
    bench
}

#[test]
fn two_drivers_with_clocks_80_ms_apart_calibrate_and_outlive_one_that_is_killed() {
    let (_cell, endpoint) = cell();
    let folder = tempfile::tempdir().expect("a folder");
    let robot = driver(&endpoint, "robot", 500.0);
    let mut bench = bench(Some(robot.clone()), Some(driver(&endpoint, "camera", 500.08)), folder.path());
    bench.until("related clocks", |model| {
        model.frame.as_ref().is_some_and(|frame| frame.info.clocks.is_some() && frame.info.base_from_tip.is_some())
    });
    bench.until("the robot", |model| model.robot.is_some());

    assert!(bench.model().taught().is_empty(), "nobody has taught this arm anything");
    bench.click(taught::Command::Import(reference_poses()));
    bench.until("the poses", |model| model.taught().len() == 10);
    bench.click(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
    bench.until("the refusal", |model| !model.sequence_runs);
    assert!(bench.text().contains("only read"), "nothing moves before somebody allows it: {}", bench.text());
    bench.click(connect::Command::Arm(true));
    bench.until("the permission", Model::is_armed);
    bench.allow(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
    bench.until("five captures", |model| model.document().captures.len() >= 5);

    // Its process only: the camera's continues.
    let robots = format!("driver fake --connect {endpoint} --only robot");
    let killed = Program::new("pkill").args(["-KILL", "-f", "--", &robots]).status();
    assert!(killed.expect("pkill runs").success());
    bench.until("the end of the sequence", |model| !model.sequence_runs && model.capture.is_none());
    bench.until("the robot again, which is only read", |model| {
        is_connected(model) && model.mover.is_connected() && model.robot.is_some() && !model.is_armed()
    });
    bench.click(connect::Command::Arm(true));
    bench.until("the permission", Model::is_armed);
    bench.click(taught::Command::ContinueSequence);
    // The arm may be there already.
    bench.click(taught::Command::ConfirmMove);
    bench.until("the rest of the sequence", |model| !model.sequence_runs && model.motion == Motion::Idle);
    bench.until("a solution", is_solved);
    assert_eq!(bench.model().document().captures.len(), 10, "{}", bench.text());
    let truth = arm(&endpoint).ground_truth().expect("a cell of this project").tip_from_camera;
    let mm = error_mm(&bench, &truth);
    assert!(mm < 0.5, "{mm} mm: a clock off by 80 ms, or an image of another pose, would show here");

    bench.click(export::Command::Export);
    bench.until("the exports", |model| model.export.written.is_some());
}

/// A driver with a cell of its own: its truth is that of the scene.
#[test]
fn the_arm_behind_a_driver_calibrates_itself_once_it_is_allowed_to_move_whatever_arm_it_is() {
    for (scene, joints) in [(ShippedScene::Reference, 6), (ShippedScene::Panda, 7)] {
        let name = scene.name();
        let folder = tempfile::tempdir().expect("a folder");
        let robot = format!("'{}' driver fake --scene {name}", handeye_binary().display());
        let mut bench = bench(Some(robot), None, folder.path());
        bench.until("a chain that fits", |model| model.cell.as_ref().is_some_and(|cell| cell.arm.is_some()));
        bench.until("the board", |model| model.board_seen_s.is_some());
        assert_eq!(bench.model().cell.as_ref().expect("a cell").joints.len(), joints);
        bench.click(connect::Command::Arm(true));
        bench.until("the permission", Model::is_armed);
        bench.click(motion::Command::SetJog(JogSettings { speed: Some(1.0), ..JogSettings::default() }));
        assert!(bench.model().confirms_moves(), "a real arm goes step by step");
        bench.click(guided::Command::CalibrateForMe);
        let waits = |model: &Model| model.asked.is_some();
        bench.until("the first move that waits", |model| waits(model) && model.document().captures.len() == 1);
        bench.click(taught::Command::ConfirmMove);
        bench.until("the second", |model| waits(model) && model.document().captures.len() == 2);
        bench.click(taught::Command::SetConfirmMoves(false));
        bench.until("the end", |model| !model.sequence_runs && model.capture.is_none());
        bench.until("a solution", is_solved);
        let model = bench.model();
        let guided = model.sequence.as_ref().and_then(|sequence| sequence.guided.as_deref()).expect("guided");
        let ending = guided.ending.as_ref().unwrap_or_else(|| panic!("{name}: {}", bench.text()));
        assert!(ending.is_success() && guided.checked == CHECKS, "{name}: {ending:?}, {}", bench.text());
        let truth = scene.scene().and_then(|scene| scene.resolve(0)).expect("it is shipped").tip_from_camera;
        let mm = error_mm(&bench, &truth);
        assert!(mm < model.view.goal.0 * 1e3, "{name}: {mm} mm");
    }
}

#[test]
fn a_robot_that_is_moved_by_hand_is_calibrated_with_poses_that_are_typed() {
    let (_cell, endpoint) = cell();
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = bench(None, Some(driver(&endpoint, "camera", 0.0)), folder.path());
    assert!(bench.model().robot.is_none());
    let taught = TaughtPoses::read(&reference_poses()).expect("they come with it").poses;
    let mut hand = arm(&endpoint);
    let cancel = CancelToken::default();
    for (number, pose) in taught.iter().enumerate().take(8) {
        let Goal::Tip(goal) = &pose.goal else { panic!("the reference poses are poses of the tip") };
        let limits = limits::of_tip(&limits::SEQUENCE, 1.0);
        hand.move_to_pose(goal, &limits, &MotionTolerance::default(), &cancel).expect("it is moved");
        hand.settle(&SettleOptions::default(), &cancel).expect("it stands");
        bench.click(connect::Command::TypePose(hand.base_from_tip().expect("the pendant shows it")));
        bench.until("the typed pose", |model| model.robot.is_some());
        bench.click(capture::Command::Take(CapturePurpose::Calibrate));
        bench.until("the capture", |model| model.document().captures.len() == number + 1);
        bench.until("the question for the next pose", |model| model.robot.is_none());
    }
    bench.until("a solution", is_solved);
    let truth = hand.ground_truth().expect("a cell of this project").tip_from_camera;
    let mm = error_mm(&bench, &truth);
    assert!(mm < 0.5, "{mm} mm");

    // The pose of the last capture must not be used for the next one.
    bench.click(capture::Command::Take(CapturePurpose::Calibrate));
    bench.until("the refusal", |model| model.refused.is_some());
    assert!(bench.text().contains("type the pose that its pendant shows"), "{}", bench.text());
}

#[test]
fn a_driver_that_ends_at_once_is_tried_a_few_times_says_why_and_then_waits_for_a_person() {
    let folder = tempfile::tempdir().expect("a folder");
    let noted = folder.path().join("noted");
    let script = format!("echo started >> {}; echo no camera is plugged in >&2; exit 3", noted.display());
    let starts = || std::fs::read_to_string(&noted).map_or(0, |text| text.lines().count());
    let drivers = Drivers { robot: Some(format!("sh -c '{script}'")), camera: None };
    let mut bench = Workbench::start(CellSource::Drivers(drivers), &folder.path().join("sessions"), None);
    bench.until("the reason", |model| matches!(&model.control, LinkState::Searching { why: Some(_), .. }));
    bench.until("the end of the tries", |model| {
        [&model.control, &model.camera].iter().all(|link| matches!(link, LinkState::Failed { .. }))
    });
    let reported = bench.text();
    assert!(reported.contains("starts in a row failed") && reported.contains("no camera is plugged in"), "{reported}");
    let tried = starts();
    assert!((3..20).contains(&tried), "{tried} starts by three threads");

    bench.click(connect::Command::Reconnect);
    bench.until("another try", |model| matches!(model.control, LinkState::Searching { .. }) && starts() > tried);
    bench.click(connect::Command::StopTrying);
    bench.until("the rest", |model| {
        [&model.control, &model.camera, &model.mover].iter().all(|link| matches!(link, LinkState::Resting { .. }))
    });
}
