//! The board tracked and followed on the built-in cell over its real socket, compared with where it really is.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use handeye_cell::scene::ShippedScene;
use handeye_coppeliasim::cell::{Arm, CellClient, CellPaths, MotionTolerance, SettleOptions};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint, MotionLimits};
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::python;
use handeye_tests::{CellProcess, handeye_binary, workspace_root};
use nalgebra::Point3;
use serde_json::Value;

const BOARD: TargetSpec = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });

fn handeye(arguments: &[&str]) -> Output {
    let output = Command::new(handeye_binary()).args(arguments).output().expect("handeye runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// A calibration of the cell of a scene, as made by a user.
fn calibrated(folder: &Path, scene: &str) -> PathBuf {
    let session = folder.join("session");
    let (out, scene) = (session.display().to_string(), workspace_root().join(scene).display().to_string());
    handeye(&["auto", "--quiet", "--scene", &scene, "--out", &out]);
    session.join("result.json")
}

fn json(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).expect("a file")).expect("JSON")
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

#[test]
fn a_moving_board_is_tracked_to_a_millimetre_and_a_tenth_of_a_degree() {
    let folder = tempfile::tempdir().expect("a folder");
    let calibration = calibrated(folder.path(), "assets/scenes/realistic.toml").display().to_string();
    let scene = workspace_root().join("assets/scenes/tracking.toml").display().to_string();
    let file = folder.path().join("track.json");
    let out = file.display().to_string();
    let run = handeye(&[
        "track",
        "--quiet",
        "--scene",
        &scene,
        "--calibration",
        &calibration,
        "--board-path",
        "circle",
        "--board-speed",
        "0.1",
        "--frames",
        "300",
        "--json",
        &out,
    ]);
    println!("{}", String::from_utf8_lossy(&run.stdout));
    let track = json(&file);
    let summary = &track["summary"];
    let frames = track["frames"].as_array().expect("frames");
    assert_eq!(frames.len(), 300);
    assert!(number(summary, "tracked") >= 295.0, "{summary}");
    assert!(number(summary, "position_rms_mm") <= 1.0, "{summary}");
    assert!(number(summary, "rotation_rms_deg") <= 0.1, "{summary}");
    // The board did move: the figures are not those of a board at rest.
    let speeds = frames.iter().skip(100).filter_map(|frame| frame["base_from_target"]["velocity_m_s"].as_array());
    let speeds: Vec<f64> =
        speeds.map(|v| v.iter().map(|v| v.as_f64().expect("a number").powi(2)).sum::<f64>().sqrt()).collect();
    let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
    assert!((0.05..0.2).contains(&mean), "{mean} m/s");
}

#[test]
fn our_point_and_the_tip_there_are_those_of_the_program_that_people_write_by_hand() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let calibration = calibrated(folder.path(), "assets/scenes/reference.toml");
    let cell = CellProcess::start(&["--fast"]);
    let endpoint = format!("tcp://127.0.0.1:{}", cell.port());
    let mut arm = at_first_pose(&endpoint);

    let script = workspace_root().join("tests/python/track_board.py");
    let by_hand =
        Command::new(python).arg(script).arg(cell.port().to_string()).arg(&calibration).output().expect("Python runs");
    assert!(by_hand.status.success(), "{}", String::from_utf8_lossy(&by_hand.stderr));
    let by_hand: Value = serde_json::from_slice(&by_hand.stdout).expect("JSON");
    let (point, tip_by_hand) = (place(&by_hand["by_depth_m"]), place(&by_hand["tip_m"]));

    drop(arm);
    arm = at_first_pose(&endpoint);
    let (calibration, file) = (calibration.display().to_string(), folder.path().join("track.json"));
    let out = file.display().to_string();
    let board = handeye(&[
        "track",
        "--quiet",
        "--connect",
        &endpoint,
        "--calibration",
        &calibration,
        "--frames",
        "5",
        "--json",
        &out,
    ]);
    drop(board);
    let track = json(&file);
    let last = track["frames"].as_array().and_then(|frames| frames.last()).expect("a frame").clone();
    let base_from_target = pose(&last["base_from_target"]);
    let ours: Vec<Point3<f64>> = BOARD.points().iter().map(|point| base_from_target.isometry() * point).collect();
    // Which of our corners is OpenCV's first one.
    let nearest = |a: &&usize, b: &&usize| {
        let distance = |index: usize| (ours[index] - point).norm();
        distance(**a).total_cmp(&distance(**b))
    };
    let corners: Vec<usize> = (0..ours.len()).collect();
    let index = *corners.iter().min_by(nearest).expect("corners");
    assert!([0, ours.len() - 1].contains(&index), "OpenCV begins at an end of the board, not at {index}");
    let apart_mm = (ours[index] - point).norm() * 1e3;
    println!("the corner by hand and ours: {apart_mm:.3} mm apart");
    assert!(apart_mm <= 1.0, "{apart_mm} mm");

    let index = index.to_string();
    handeye(&[
        "track",
        "--quiet",
        "--connect",
        &endpoint,
        "--calibration",
        &calibration,
        "--reach",
        &index,
        "--stand-off",
        "0",
    ]);
    let tip = arm.base_from_tip().expect("the tip").translation();
    let apart_mm = (tip - tip_by_hand.coords).norm() * 1e3;
    println!("the tip by hand and ours: {apart_mm:.3} mm apart");
    assert!(apart_mm <= 1.0, "{apart_mm} mm");
}

/// With reported poses the same calibration brings the tip where nominal kinematics puts it.
#[test]
fn an_arm_whose_links_are_off_reaches_a_corner_by_corrected_commands() {
    let folder = tempfile::tempdir().expect("a folder");
    let calibration = calibrated(folder.path(), "assets/scenes/nominal.toml");
    let stated_mm = number(&json(&calibration)["quality"], "reach_error_corrected_95_mm");
    let (calibration, file) = (calibration.display().to_string(), folder.path().join("track.json"));
    let out = file.display().to_string();

    let scene = ShippedScene::Nominal.scene().expect("it is shipped");
    let scene = scene.resolve(scene.seed).expect("valid");
    let cell = CellProcess::start(&["--fast", "--scene", "nominal"]);
    let endpoint = format!("tcp://127.0.0.1:{}", cell.port());
    let to_corner = ["track", "--quiet", "--connect", &endpoint, "--reach", "0", "--stand-off", "0", "--json", &out];
    let [plain_mm, corrected_mm] = [("reported", &["--as-reported"][..]), ("corrected", &[])].map(|(poses, asked)| {
        drop(at_first_pose(&endpoint));
        handeye(&[&to_corner[..], &["--calibration", &calibration], asked].concat());
        assert_eq!(json(&file)["summary"]["tip_poses"], poses);
        let joints = connected(&endpoint).joint_values().expect("the joints");
        let tip = scene.true_tip(&joints, 0).expect("six joints").translation();
        let corner = |index| scene.base_from_target.isometry() * BOARD.point(index);
        // A chessboard of this kind looks the same from two sides.
        [0, BOARD.len() - 1]
            .map(|index| (tip - corner(index).coords).norm() * 1e3)
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    });
    println!(
        "the tip is {plain_mm:.3} mm off the corner, {corrected_mm:.3} mm with corrected commands, stated {stated_mm:.3}"
    );
    assert!(
        corrected_mm < 0.5 * plain_mm && corrected_mm <= stated_mm,
        "{plain_mm} mm, {corrected_mm} mm, {stated_mm} mm"
    );
}

fn connected(endpoint: &str) -> Arm {
    let endpoint: Endpoint = endpoint.parse().expect("an address");
    let cell = CellClient::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("a cell");
    cell.split().0
}

/// Where every program starts: the first reference pose, at rest.
fn at_first_pose(endpoint: &str) -> Arm {
    let mut arm = connected(endpoint);
    arm.sim().start_simulation().expect("started");
    let file = workspace_root().join("assets/poses/seed10.toml");
    let poses = handeye_dataset::taught_poses::TaughtPoses::read(&file).expect("poses");
    let handeye_dataset::taught_poses::Goal::Tip(first) = &poses.poses[0].goal else { panic!("a pose of the tip") };
    let limits = MotionLimits::uniform(4, 0.5, 1.0, 10.0);
    let cancel = CancelToken::default();
    arm.move_to_pose(first, &limits, &MotionTolerance::default(), &cancel).expect("there");
    arm.settle(&SettleOptions::default(), &cancel).expect("at rest");
    arm
}

fn place(value: &Value) -> Point3<f64> {
    let [x, y, z] = numbers(value);
    Point3::new(x, y, z)
}

fn pose(value: &Value) -> Pose<Base, Target> {
    Pose::from_translation_xyzw(numbers(&value["translation_m"]), numbers(&value["rotation_xyzw"]))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let all = value.as_array().unwrap_or_else(|| panic!("numbers in {value}"));
    std::array::from_fn(|i| all[i].as_f64().expect("a number"))
}
