//! `auto` and `track` with drivers: programs of their own, two clocks, and a robot that moves only as the command line allows.

use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Output};

use handeye_cell::scene::{Scene, ShippedScene};
use handeye_coppeliasim::cell::{Arm, CellPaths, SettleOptions};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint};
use handeye_geometry::frames::{Camera, Pose, Tip};
use handeye_result::CalibrationResult;
use handeye_server::{CellConfig, CellServer};
use handeye_session::Session;
use handeye_tests::handeye_binary;
use handeye_tests::process::{end_of, signal, start, until_message};
use serde_json::Value;

/// A cell that keeps pace with real time, as drivers of hardware do; with another client that observes it.
struct Cell {
    _server: CellServer,
    endpoint: Endpoint,
    watch: Arm,
}

impl Cell {
    fn start() -> Self {
        let scene = Scene::reference().expect("the scene");
        let server = CellServer::start(CellConfig { real_time: Some(true), ..CellConfig::new(scene) }).expect("a cell");
        let endpoint: Endpoint = server.endpoint().parse().expect("an address");
        let watch = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("the cell");
        Self { _server: server, endpoint, watch }
    }

    /// The command of a driver of one part of it, with its clock ahead by this much.
    fn driver(&self, part: &str, clock_s: f64) -> String {
        let endpoint = &self.endpoint;
        format!("'{}' driver fake --connect {endpoint} --only {part} --clock {clock_s}", handeye_binary().display())
    }

    fn joints(&mut self) -> Vec<f64> {
        self.watch.joint_values().expect("a call").to_vec()
    }
}

fn handeye(arguments: &[&str]) -> Output {
    Command::new(handeye_binary()).args(arguments).output().expect("the binary is built: cargo build -p handeye_app")
}

fn reported(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The error of the answer of a session \[mm\] relative to the truth, which no driver reports.
fn error_mm(session: &Path, truth: &Pose<Tip, Camera>) -> f64 {
    let result = CalibrationResult::read(&session.join("result.json")).expect("a result");
    assert!(result.truth.is_none(), "nobody reports it");
    let found = result.hand_eye.expect("a robot").translation_m;
    (nalgebra::Vector3::from(found) - truth.translation()).norm() * 1e3
}

#[test]
fn a_real_cell_is_calibrated_and_tracked_from_the_command_line_once_it_may_move() {
    let mut cell = Cell::start();
    let folder = tempfile::tempdir().expect("a folder");
    let session = folder.path().join("session");
    let out = session.to_str().expect("UTF-8");
    let (robot, camera) = (cell.driver("robot", 500.0), cell.driver("camera", 500.08));
    let drivers = ["--driver", &robot, "--camera-driver", &camera, "--rerun", "off"];
    let auto = [&["auto", "--poses", "seed10", "--out", out, "--speed", "100"][..], &drivers].concat();

    let no_board = handeye(&auto);
    assert_eq!(no_board.status.code(), Some(2), "{}", reported(&no_board));
    assert!(reported(&no_board).contains("--target 10x7x15"), "a board is never guessed: {}", reported(&no_board));
    let auto = [&auto[..], &["--target", "10x7x15"]].concat();

    let before = cell.joints();
    let refused = handeye(&auto);
    assert_eq!(refused.status.code(), Some(2), "{}", reported(&refused));
    assert!(reported(&refused).contains("--allow-motion"), "{}", reported(&refused));
    let planned = handeye(&[&auto[..], &["--dry-run"]].concat());
    assert!(planned.status.success(), "{}", reported(&planned));
    let plan = String::from_utf8_lossy(&planned.stdout).into_owned();
    assert!(plan.contains("to the start: joints") && plan.ends_with("nothing was moved\n"), "{plan}");
    assert_eq!(plan.matches(" mm, turned about ").count(), 10, "{plan}");
    assert!(!session.exists(), "nothing was captured");
    assert_eq!(cell.joints(), before, "nothing moves that nobody allowed");

    let done = handeye(&[&auto[..], &["--allow-motion"]].concat());
    assert!(done.status.success(), "{}", reported(&done));
    for number in 1..=11 {
        assert!(
            reported(&done).contains(&format!("motion {number}: arrived")),
            "every motion is logged: {}",
            reported(&done)
        );
    }
    let truth = cell.watch.ground_truth().expect("a cell of this project").tip_from_camera;
    let mm = error_mm(&session, &truth);
    assert!(mm < 0.5, "{mm} mm: a clock off by 80 ms, or an image of another pose, would show here");

    // The same cell is tracked, and the tip moves to a corner of the board once.
    let (result, track) = (session.join("result.json"), folder.path().join("track.json"));
    let track_file = track.to_str().expect("UTF-8");
    let tracking = ["track", "--calibration", result.to_str().expect("UTF-8"), "--json", track_file];
    let tracking = [&tracking[..], &drivers].concat();
    let watched = handeye(&[&tracking[..], &["--frames", "20"]].concat());
    assert!(watched.status.success(), "{}", reported(&watched));
    let read = |file: &Path| -> Value {
        serde_json::from_str(&std::fs::read_to_string(file).expect("it is written")).expect("JSON")
    };
    assert_eq!(read(&track)["summary"]["frames"], 20);
    assert!(read(&track)["summary"]["tracked"].as_u64().is_some_and(|frames| frames >= 15), "{}", read(&track));

    let reach = [&tracking[..], &["--reach", "0", "--stand-off", "150"]].concat();
    let before = cell.joints();
    let refused = handeye(&reach);
    assert_eq!(refused.status.code(), Some(2), "{}", reported(&refused));
    let planned = handeye(&[&reach[..], &["--dry-run"]].concat());
    assert!(String::from_utf8_lossy(&planned.stdout).contains("to corner 0: tip at"), "{}", reported(&planned));
    assert_eq!(cell.joints(), before, "nothing moves that nobody allowed");
    let reached = handeye(&[&reach[..], &["--allow-motion", "--speed", "100"]].concat());
    assert!(reached.status.success(), "{}", reported(&reached));
    cell.watch.settle(&SettleOptions::default(), &CancelToken::default()).expect("it stands");
    let truth = cell.watch.ground_truth().expect("a cell of this project");
    let board = truth.base_from_target.expect("published");
    let tip = cell.watch.base_from_tip().expect("a call").translation();
    let from_board = board.inverse().isometry() * nalgebra::Point3::from(tip);
    // Corner 0 is the origin of the board, whose z axis points away from the camera.
    let off_mm = (from_board.coords - nalgebra::Vector3::new(0.0, 0.0, -0.15)).norm() * 1e3;
    assert!(off_mm < 1.5, "the tip is {off_mm} mm from where it was to be: {from_board}");

    let follows = handeye(&[&tracking[..], &["--follow", "--allow-motion"]].concat());
    assert_eq!(follows.status.code(), Some(2), "{}", reported(&follows));
}

#[test]
fn ctrl_c_stops_the_robot_says_whether_it_stands_and_keeps_what_was_captured() {
    let mut cell = Cell::start();
    let folder = tempfile::tempdir().expect("a folder");
    let session = folder.path().join("session");
    let (robot, camera) = (cell.driver("robot", 0.0), cell.driver("camera", 0.0));
    let out = session.to_str().expect("UTF-8");
    let arguments = [
        "auto",
        "--driver",
        &robot,
        "--camera-driver",
        &camera,
        "--target",
        "10x7x15",
        "--poses",
        "seed10",
        "--out",
        out,
        "--rerun",
        "off",
        "--allow-motion",
        "--speed",
        "40",
    ];
    let (mut command, mut messages) = start(&arguments);
    until_message(&mut messages, "pose 1 of 10 captured");
    until_message(&mut messages, "motion 3, to");
    let stood = cell.joints();
    while cell.joints() == stood {
        std::thread::yield_now();
    }
    signal(&command, "INT");
    let mut rest = String::new();
    messages.read_to_string(&mut rest).expect("text");
    assert_eq!(end_of(&mut command).code(), Some(1), "{rest}");
    assert!(rest.contains("motion 3: stopped") && rest.contains("was told to stop, and stands"), "{rest}");
    let stands = cell.joints();
    let moved = stands.iter().zip(cell.joints()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 1e-4, "it still moves: {moved} rad");
    assert_eq!(Session::open(&session).expect("a session").document.captures.len(), 1, "nothing captured is lost");
}

#[test]
fn guided_capture_over_a_driver_reaches_the_goal_from_the_command_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let session = folder.path().join("session");
    // A driver with a cell of its own: its truth is that of the scene.
    let robot = format!("'{}' driver fake", handeye_binary().display());
    let arguments = [
        "auto",
        "--driver",
        &robot,
        "--target",
        "10x7x15",
        "--poses",
        "guided",
        "--goal",
        "0.3",
        "--rerun",
        "off",
        "--speed",
        "100",
        "--out",
        session.to_str().expect("UTF-8"),
    ];
    let planned = handeye(&[&arguments[..], &["--dry-run"]].concat());
    let plan = String::from_utf8_lossy(&planned.stdout).into_owned();
    assert!(planned.status.success() && plan.contains("where it stands"), "{plan}{}", reported(&planned));
    let done = handeye(&[&arguments[..], &["--allow-motion"]].concat());
    assert!(done.status.success(), "{}", reported(&done));
    let truth =
        ShippedScene::Reference.scene().and_then(|scene| scene.resolve(0)).expect("it is shipped").tip_from_camera;
    let mm = error_mm(&session, &truth);
    assert!(mm < 0.3, "{mm} mm");
}
