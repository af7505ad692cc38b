//! The command line on a cell that has only what CoppeliaSim has: image and pose of one instant are obtained as there,
//! by having the sensors take their images while the simulation is held.

use std::path::Path;
use std::process::Command;

use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{Arm, CellPaths, MotionTolerance};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint, LinkError, MotionLimits};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_result::CalibrationResult;
use handeye_tests::{CellProcess, handeye_binary, workspace_root};
use nalgebra::Vector3;
use serde_json::Value;

/// Speed of the tip while the board is tracked [m/s].
const SPEED_M_S: f64 = 0.1;

fn handeye(arguments: &[&str]) {
    let output = Command::new(handeye_binary()).args(arguments).output().expect("handeye runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// The ten reference poses, calibrated on the cell at `endpoint`.
fn calibrated(folder: &Path, endpoint: &str) -> CalibrationResult {
    let out = folder.join("session");
    handeye(&["auto", "--quiet", "--rerun", "off", "--connect", endpoint, "--out", out.to_str().expect("UTF-8")]);
    CalibrationResult::read(&out.join("result.json")).expect("a result")
}

fn first_pose() -> Pose<Base, Tip> {
    let poses = TaughtPoses::read(&workspace_root().join("assets/poses/seed10.toml")).expect("poses");
    let Goal::Tip(first) = &poses.poses[0].goal else { panic!("a pose of the tip") };
    *first
}

/// Swings the arm about its base joint until cancelled; returns how far the tip moved \[m\].
fn to_and_fro(arm: &mut Arm, enough: &CancelToken) -> Result<f64, LinkError> {
    let centre = arm.joint_values()?;
    let tip = arm.base_from_tip()?.translation();
    let limits = MotionLimits::uniform(6, SPEED_M_S / tip.xy().norm(), 1.0, 10.0);
    let mut travelled_m = 0.0;
    for side_rad in [0.06, -0.06].into_iter().cycle() {
        let mut goal = centre;
        goal[0] += side_rad;
        let from = arm.base_from_tip()?.translation();
        match arm.move_to_joints(&goal, &limits, enough) {
            Err(LinkError::Cancelled { .. }) => break,
            outcome => outcome?,
        }
        travelled_m += (arm.base_from_tip()?.translation() - from).norm();
    }
    Ok(travelled_m)
}

#[test]
fn ten_poses_calibrate_it_and_a_moving_arm_sees_the_board_where_it_is() {
    let cell = CellProcess::start(&["--coppeliasim-only"]);
    let endpoint = format!("tcp://127.0.0.1:{}", cell.port());
    let folder = tempfile::tempdir().expect("a folder");
    let result = calibrated(folder.path(), &endpoint);
    let truth = result.truth.expect("CoppeliaSim tells where its camera is");
    // As exact as on the cell that reports which pass its images show.
    let (mm, deg) = (truth.translation_error_mm.expect("known"), truth.rotation_error_deg.expect("known"));
    println!("ten poses: {mm:.3} mm, {deg:.4}°");
    assert!(mm <= 0.03 && deg <= 0.03, "{mm} mm {deg}°");

    let address: Endpoint = endpoint.parse().expect("an address");
    let mut arm = Arm::connect(&address, &ConnectionOptions::default(), &CellPaths::default()).expect("the cell");
    arm.sim().start_simulation().expect("started");
    let limits = MotionLimits::uniform(4, 0.5, 1.0, 10.0);
    arm.move_to_pose(&first_pose(), &limits, &MotionTolerance::default(), &CancelToken::default()).expect("there");
    let enough = CancelToken::default();
    let moving = {
        let enough = enough.clone();
        std::thread::spawn(move || to_and_fro(&mut arm, &enough))
    };
    let file = folder.path().join("track.json");
    let calibration = folder.path().join("session/result.json");
    handeye(&[
        "track",
        "--quiet",
        "--connect",
        &endpoint,
        "--calibration",
        calibration.to_str().expect("UTF-8"),
        "--frames",
        "120",
        "--json",
        file.to_str().expect("UTF-8"),
    ]);
    enough.cancel();
    let travelled_m = moving.join().expect("no panic").expect("it moves");
    let track: Value = serde_json::from_slice(&std::fs::read(&file).expect("a file")).expect("JSON");
    let scene = Scene::reference().expect("the scene");
    let board = scene.resolve(scene.seed).expect("valid").base_from_target;
    let errors_m: Vec<f64> = track["frames"]
        .as_array()
        .expect("frames")
        .iter()
        .filter(|frame| !frame["base_from_target"].is_null())
        .map(|frame| (place(&frame["base_from_target"]) - board.translation()).norm())
        .collect();
    let rms_mm = 1e3 * (errors_m.iter().map(|m| m * m).sum::<f64>() / errors_m.len() as f64).sqrt();
    println!("{} images, {travelled_m:.2} m travelled: board off by {rms_mm:.3} mm RMS", errors_m.len());
    assert!(errors_m.len() >= 110 && travelled_m >= 0.05, "{} images, {travelled_m} m", errors_m.len());
    // A joint of this pass with an image of the last one would be 5 mm at this speed.
    assert!(rms_mm <= 1.0, "{rms_mm} mm");
}

fn place(value: &Value) -> Vector3<f64> {
    let numbers: Vec<f64> =
        value["translation_m"].as_array().expect("numbers").iter().filter_map(Value::as_f64).collect();
    Vector3::from_row_slice(&numbers)
}
