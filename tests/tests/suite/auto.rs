//! The main job from one command, against the truth of the cell.

use std::path::Path;
use std::process::{Command, Output};

use handeye_core::result::CalibrationResult;
use handeye_tests::{handeye_binary, python, workspace_root};

fn handeye(arguments: &[&str]) -> Output {
    Command::new(handeye_binary()).args(arguments).output().expect("the binary is built: cargo build -p handeye_app")
}

fn auto(folder: &Path, arguments: &[&str]) -> CalibrationResult {
    let out = folder.join("session");
    let mut all = vec!["auto", "--quiet", "--out", out.to_str().expect("UTF-8")];
    all.extend_from_slice(arguments);
    let output = handeye(&all);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    CalibrationResult::read(&out.join("result.json")).expect("a result")
}

/// Errors against the truth: mm, degrees, percent.
fn errors(result: &CalibrationResult) -> (f64, f64, f64) {
    let truth = result.truth.expect("the cell publishes its truth");
    (
        truth.translation_error_mm.expect("known"),
        truth.rotation_error_deg.expect("known"),
        truth.focal_error_percent.expect("known"),
    )
}

#[test]
fn the_ten_reference_poses_calibrate_the_exact_cell() {
    let folder = tempfile::tempdir().expect("a folder");
    let json = folder.path().join("copy.json");
    let result = auto(folder.path(), &["--poses", "seed10", "--json", json.to_str().expect("UTF-8")]);
    let (mm, deg, percent) = errors(&result);
    println!("reference scene, ten poses: {mm:.3} mm, {deg:.4}°, focal length {percent:.4} %");
    assert!(mm <= 0.5 && deg <= 0.03 && percent <= 0.2, "{mm} mm {deg}° {percent} %");
    assert_eq!(result.views.len(), 10);
    assert_eq!(CalibrationResult::read(&json).expect("the copy"), result);

    // What it says of itself has to hold too: the bound for these poses at its own corner noise.
    let stated = result.quality.tip_error_95_mm.expect("stated");
    assert!(stated < 0.5, "{stated}");

    // The session is a dataset folder, and solves to the same answer to the last bit.
    let session = folder.path().join("session");
    let again = handeye(&["calibrate", "--quiet", session.to_str().expect("UTF-8"), "--json", "-"]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let again = CalibrationResult::from_json(&String::from_utf8_lossy(&again.stdout)).expect("JSON");
    assert_eq!((&again.hand_eye, &again.intrinsics), (&result.hand_eye, &result.intrinsics));

    for name in ["calibration.json", "camera_info.yaml", "opencv.yaml", "my_cell.calib"] {
        assert!(session.join("exports").join(name).is_file(), "{name}");
    }
    read_exports_with_python(&session);
}

fn read_exports_with_python(session: &Path) {
    let Some(python) = python("reading exports with OpenCV and PyYAML") else { return };
    let output = Command::new(python)
        .arg(workspace_root().join("tests/python/read_exports.py"))
        .arg(session.join("exports"))
        .arg(session.join("result.json"))
        .output()
        .expect("python runs");
    assert!(
        output.status.success(),
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn a_realistic_cell_is_calibrated_with_every_seed() {
    let scene = workspace_root().join("assets/scenes/realistic.toml");
    let poses = workspace_root().join("assets/poses/realistic20.toml");
    for seed in ["1", "2", "3", "4"] {
        let folder = tempfile::tempdir().expect("a folder");
        let (scene, poses) = (scene.to_str().expect("UTF-8"), poses.to_str().expect("UTF-8"));
        let result = auto(folder.path(), &["--scene", scene, "--poses", poses, "--seed", seed]);
        let (mm, deg, percent) = errors(&result);
        let q = result.quality;
        let (robot_mm, robot_deg) = (q.robot_sigma_mm.expect("estimated"), q.robot_sigma_deg.expect("estimated"));
        println!(
            "realistic scene, seed {seed}: {mm:.3} mm, {deg:.4}°, {percent:.4} %; robot {robot_mm:.3} mm {robot_deg:.4}°"
        );
        assert!(mm <= 1.0 && deg <= 0.05, "seed {seed}: {mm} mm {deg}°");
        // The scene's robot repeats to 0.05 mm and 0.01° per axis; twenty poses tell that to a fifth or so.
        assert!((0.02..0.1).contains(&robot_mm) && (0.005..0.02).contains(&robot_deg), "{robot_mm} {robot_deg}");
    }
}

#[test]
fn planned_poses_calibrate_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mm, deg, _) = errors(&auto(folder.path(), &["--poses", "auto"]));
    println!("reference scene, planned poses: {mm:.3} mm, {deg:.4}°");
    assert!(mm <= 0.5 && deg <= 0.03, "{mm} mm {deg}°");
}

#[test]
fn an_earlier_session_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let poses = folder.path().join("three.toml");
    let all = std::fs::read_to_string(workspace_root().join("assets/poses/seed10.toml")).expect("poses");
    let first_four: Vec<&str> = all.split("[[pose]]").take(5).collect();
    std::fs::write(&poses, first_four.join("[[pose]]")).expect("written");
    let poses = poses.to_str().expect("UTF-8");
    auto(folder.path(), &["--poses", poses]);
    auto(folder.path(), &["--poses", poses]);
    assert!(folder.path().join("session.earlier-1/session.json").is_file());
    assert!(folder.path().join("session.earlier-1/images/0004.png").is_file());
}
