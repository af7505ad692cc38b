//! The official Python client of CoppeliaSim with `handeye cell`, unmodified, with each of the CBOR libraries that it
//! may find.

use std::process::Command;

use handeye_geometry::testing::python;
use handeye_result::CalibrationResult;
use handeye_tests::{CellProcess, handeye_binary, workspace_root};

fn run(python: &std::path::Path, script: &str, arguments: &[&str], cbor: &str) -> String {
    let output = Command::new(python)
        .arg(workspace_root().join("tests/python").join(script))
        .args(arguments)
        .env("HANDEYE_CBOR", cbor)
        .output()
        .expect("python runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{script} with {cbor}:\n{text}{}", String::from_utf8_lossy(&output.stderr));
    text
}

/// Scenarios that need no joint or pixel exactly where it was set: joints that a controller moves lag, and their arm
/// does not see the board at its start.
const WITH_DYNAMIC_JOINTS: [&str; 12] = [
    "test_first_contact",
    "test_paths",
    "test_errors",
    "test_poses",
    "test_parts_and_forms_of_images",
    "test_move_to_config_by_position",
    "test_stepping",
    "test_states",
    "test_images_while_another_client_moves",
    "test_several_requests_at_once",
    "test_settings_and_signals",
    "test_killed_clients_do_not_freeze_time",
];

#[test]
fn the_official_client_drives_the_cell_with_either_cbor_library() {
    let Some(python) = python() else { return };
    let scene = workspace_root().join("assets/scenes/coppeliasim.toml").display().to_string();
    let coppeliasim = ["--scene", &scene];
    let nothing: &[&str] = &[];
    let runs = [
        ("cbor", nothing, nothing),
        ("cbor2", nothing, nothing),
        ("cbor2", &coppeliasim[..], &WITH_DYNAMIC_JOINTS[..]),
    ];
    // All at once: each waits for the simulated time of its cell.
    std::thread::scope(|scope| {
        for (cbor, cell, scenarios) in runs {
            let python = &python;
            scope.spawn(move || {
                let cell = CellProcess::start(cell);
                let port = cell.port().to_string();
                println!("{}", run(python, "official_client.py", &[&[&*port], scenarios].concat(), cbor));
            });
        }
    });
}

#[test]
fn a_script_with_opencv_and_handeye_find_the_same_calibration() {
    let Some(python) = python() else { return };
    let poses = workspace_root().join("assets/poses/seed10.toml");
    let cell = CellProcess::start(&["--fast"]);
    let port = cell.port().to_string();
    let text = run(&python, "calibrate_with_cv2.py", &[&port, poses.to_str().expect("UTF-8")], "cbor2");
    let theirs: serde_json::Value =
        serde_json::from_str(text.lines().last().expect("a line")).expect("the script prints JSON");
    let folder = tempfile::tempdir().expect("a folder");
    let address = format!("tcp://127.0.0.1:{port}");
    let output = Command::new(handeye_binary())
        .args(["auto", "--quiet", "--connect", &address, "--out"])
        .arg(folder.path().join("session"))
        .output()
        .expect("the binary is built");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let ours = CalibrationResult::read(&folder.path().join("session/result.json")).expect("a result");
    let ours_mm = ours.hand_eye.as_ref().expect("hand-eye").translation_m.map(|v| v * 1e3);
    let off: f64 = (0..3)
        .map(|i| (theirs["translation_m"][i].as_f64().expect("a number") * 1e3 - ours_mm[i]).powi(2))
        .sum::<f64>()
        .sqrt();
    println!("OpenCV's Tsai and the joint estimate differ by {off:.3} mm; OpenCV's fit has {} px", theirs["rms_px"]);
    // A closed form on these ten poses is good to about two millimetres at the corner noise of `cornerSubPix`: that was
    // the error of the script that this replaces.
    assert!(off < 3.0, "{off} mm: {theirs} against {ours_mm:?}");
    assert!((theirs["fx"].as_f64().expect("a number") / ours.intrinsics.expect("a camera").fx - 1.0).abs() < 0.01);
}
