//! The main task with one command, compared with the truth of the cell.

use std::path::Path;
use std::process::{Command, Output};

use handeye_dataset::Dataset;
use handeye_geometry::testing::python;
use handeye_result::{CalibrationResult, ViewRecordStatus};
use handeye_session::Session;
use handeye_tests::{CellProcess, handeye_binary, workspace_root};

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

/// Errors relative to the truth: mm, degrees, percent.
fn errors(result: &CalibrationResult) -> (f64, f64, f64) {
    let truth = result.truth.expect("the cell publishes its truth");
    (
        truth.translation_error_mm.expect("known"),
        truth.rotation_error_deg.expect("known"),
        truth.focal_error_percent.expect("known"),
    )
}

/// Seven joints, from the scene to the data set, and then the arm follows the board with the calibration that it gave.
#[test]
fn a_panda_is_calibrated_within_what_it_states_keeps_seven_joints_and_follows_the_board() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = workspace_root().join("assets/scenes/panda.toml");
    let scene = scene.to_str().expect("UTF-8");
    let result = auto(folder.path(), &["--poses", "auto", "--scene", scene]);
    let (mm, deg, percent) = errors(&result);
    println!("Panda, planned poses: {mm:.4} mm, {deg:.4}°, focal length {percent:.4} %");
    let covariance = result.hand_eye.as_ref().and_then(|link| link.covariance).expect("stated");
    let sigma = |from: usize| (from..from + 3).map(|i| covariance[i][i]).sum::<f64>().sqrt();
    // Three standard deviations of each: the remaining error in an exact cell is rounding to grey levels.
    assert!(mm <= 3.0 * sigma(0) * 1e3, "{mm} mm, stated {} mm", sigma(0) * 1e3);
    assert!(deg <= 3.0 * sigma(3).to_degrees(), "{deg}°, stated {}°", sigma(3).to_degrees());
    assert_eq!(result.views.len(), 20);

    let session = folder.path().join("session");
    let document = Session::open(&session).expect("a session").document;
    assert_eq!(document.captures.len(), 20);
    assert!(
        document.captures.iter().all(|capture| capture.joints_rad.as_ref().is_some_and(|joints| joints.len() == 7))
    );
    let data = Dataset::read(&session).expect("the session is a data set");
    for (entry, capture) in data.entries.iter().zip(&document.captures) {
        assert_eq!(entry.joints_rad, capture.joints_rad, "every digit");
    }

    let json = folder.path().join("track.json");
    let (calibration, json) = (session.to_str().expect("UTF-8"), json.to_str().expect("UTF-8"));
    let output = handeye(&[
        "track",
        "--quiet",
        "--follow",
        "--calibration",
        calibration,
        "--scene",
        scene,
        "--board-path",
        "circle",
        "--board-speed",
        "0.03",
        "--frames",
        "120",
        "--json",
        json,
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(json).expect("written");
    let tracked: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    println!("{}", tracked["summary"]);
    assert!(tracked["summary"]["follow_ended"].is_null(), "{}", tracked["summary"]);
}

/// A foreign scene: the arm is a Panda with that name.
#[test]
fn an_arm_of_another_name_is_calibrated_once_the_objects_of_its_scene_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let shipped = workspace_root().join("assets/scenes");
    let scene = std::fs::read_to_string(shipped.join("panda.toml")).expect("it is there");
    let arms = shipped.with_file_name("arms");
    let named = scene.replace("../arms", arms.to_str().expect("UTF-8")).replacen(
        "[robot]\n",
        "[robot]\nname = \"Franka\"\n",
        1,
    );
    assert!(named.contains("Franka"));
    let file = folder.path().join("franka.toml");
    std::fs::write(&file, named).expect("written");
    let cell = CellProcess::start(&["--fast", "--scene", file.to_str().expect("UTF-8")]);
    let address = format!("tcp://127.0.0.1:{}", cell.port());
    let connected = ["--connect", &address, "--poses", "guided", "--goal", "0.3"];
    let lost = handeye(&[&["auto", "--quiet"][..], &connected].concat());
    let reported = String::from_utf8_lossy(&lost.stderr).into_owned();
    assert_eq!(lost.status.code(), Some(1), "{reported}");
    assert!(
        reported.contains("/UR5/Tip") && reported.contains("/Target, /Tip") && reported.contains("--object"),
        "{reported}"
    );
    let wrong = handeye(&["auto", "--object", "flange=/Franka"]);
    assert_eq!(wrong.status.code(), Some(2), "{}", String::from_utf8_lossy(&wrong.stderr));

    let objects = ["arm=/Franka", "tip=/Franka/Tip", "camera=/Franka/3D_camera", "depth=/Franka/3D_camera/depth"];
    let objects: Vec<&str> = objects.into_iter().flat_map(|object| ["--object", object]).collect();
    let result = auto(folder.path(), &[&connected[..], &objects].concat());
    let (mm, deg, _) = errors(&result);
    println!("Panda called Franka: {mm:.4} mm, {deg:.4}°");
    let reached = result.findings.iter().find(|finding| finding.code == "goal_reached").expect("it is");
    assert!(reached.text.contains("goal of 0.300 mm"), "{}", reached.text);
    let stated_mm = result.quality.tip_error_95_mm.expect("stated");
    assert!(mm < 3.0 * stated_mm, "{mm} mm, stated {stated_mm} mm");
}

/// A cable that a rotation of the hand would tear, modelled by the limits of a URDF file.
#[test]
fn poses_are_chosen_by_the_chain_that_was_named_with_its_ranges() {
    let folder = tempfile::tempdir().expect("a folder");
    let urdf = std::fs::read_to_string(workspace_root().join("assets/arms/panda.urdf")).expect("it is shipped");
    let range = r#"lower="-2.8973" upper="2.8973""#;
    let (before, after) = urdf.rsplit_once(range).expect("of the last joint");
    let narrow = folder.path().join("narrow.urdf");
    std::fs::write(&narrow, format!(r#"{before}lower="0.3" upper="1.2"{after}"#)).expect("written");
    let turns = |name: &str, more: &[&str]| -> Vec<f64> {
        let out = folder.path().join(name);
        let poses = ["auto", "--quiet", "--rerun", "off", "--scene", "panda", "--poses", "guided", "--max-poses", "8"];
        let output = handeye(&[&poses[..], &["--out", out.to_str().expect("UTF-8")], more].concat());
        let document = Session::open(&out).unwrap_or_else(|_| panic!("{output:?}")).document;
        document.captures.iter().filter_map(|capture| capture.joints_rad.as_ref()?.last().copied()).collect()
    };
    let is_within = |angle: &f64| (0.3..=1.2).contains(angle);
    let free = turns("free", &[]);
    assert!(!free.iter().all(is_within), "the hand is turned where nothing forbids it: {free:?}");
    let kept = turns("kept", &["--arm", narrow.to_str().expect("UTF-8")]);
    assert!(kept.len() > 3 && kept.iter().all(is_within), "{kept:?}");
}

/// Over a connection no scene is given: the views are of the board of the connected cell, with its arm.
#[test]
fn views_are_planned_for_the_arm_and_the_board_of_a_cell_that_is_connected_to() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = workspace_root().join("assets/scenes/panda.toml");
    for only in [&[][..], &["--coppeliasim-only"]] {
        let cell = CellProcess::start(&[&["--fast", "--scene", scene.to_str().expect("UTF-8")], only].concat());
        let address = format!("tcp://127.0.0.1:{}", cell.port());
        let result = auto(folder.path(), &["--poses", "auto", "--connect", &address]);
        assert!(
            result.views.iter().filter(|view| view.status == ViewRecordStatus::Used).count() >= 15,
            "{:?}",
            result.views
        );
    }
}

#[test]
fn the_ten_reference_poses_calibrate_the_exact_cell() {
    let folder = tempfile::tempdir().expect("a folder");
    let json = folder.path().join("copy.json");
    let result = auto(folder.path(), &["--poses", "seed10", "--json", json.to_str().expect("UTF-8")]);
    let (mm, deg, percent) = errors(&result);
    println!("reference scene, ten poses: {mm:.3} mm, {deg:.4}°, focal length {percent:.4} %");
    // The cell is exact and its images have no noise: the remaining error is rounding to grey levels.
    assert!(mm <= 0.03 && deg <= 0.03 && percent <= 0.2, "{mm} mm {deg}° {percent} %");
    assert_eq!(result.views.len(), 10);
    assert_eq!(CalibrationResult::read(&json).expect("the copy"), result);

    // Its own statement has to hold too: the bound for these poses at its own corner noise.
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
    let Some(python) = python() else { return };
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
    for seed in ["1", "2"] {
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
        // The scene's robot repeats to 0.05 mm and 0.01° per axis; twenty poses determine that to about a fifth.
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
    let poses = poses(folder.path(), 4, "");
    auto(folder.path(), &["--poses", &poses]);
    auto(folder.path(), &["--poses", &poses]);
    assert!(folder.path().join("session.earlier-1/session.json").is_file());
    assert!(folder.path().join("session.earlier-1/images/0004.png").is_file());
}

/// A pose file with some of the reference poses, and more.
fn poses(folder: &Path, count: usize, more: &str) -> String {
    let all = std::fs::read_to_string(workspace_root().join("assets/poses/seed10.toml")).expect("poses");
    let file = folder.join("poses.toml");
    let some: Vec<&str> = all.split("[[pose]]").take(count + 1).collect();
    std::fs::write(&file, some.join("[[pose]]") + more).expect("written");
    file.to_str().expect("UTF-8").to_owned()
}

#[test]
fn captures_are_taken_as_the_window_takes_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = workspace_root().join("assets/scenes/realistic.toml");
    let mut digests = Vec::new();
    for run in ["first", "second"] {
        let out = folder.path().join(run);
        let poses = poses(folder.path(), 5, "");
        let scene = scene.to_str().expect("UTF-8");
        let result = auto(&out, &["--scene", scene, "--poses", &poses, "--seed", "3", "--frames", "3"]);
        digests.push(result.provenance.input_sha256.expect("a digest of images and poses"));
        let session = Session::open(&out.join("session")).expect("a session");
        assert_eq!(session.document.captures.len(), 5);
        for capture in &session.document.captures {
            assert_eq!(capture.frames, 3, "averaged: {capture:?}");
            // Three intervals of a pass show that everything is at rest.
            assert!(capture.settled_s.is_some_and(|settled_s| settled_s >= 0.15 - 1e-9), "{capture:?}");
            assert!(capture.corner_noise_px.is_some_and(|noise_px| (1e-3..0.1).contains(&noise_px)), "{capture:?}");
        }
    }
    assert_eq!(digests[0], digests[1], "the same command gives the same images and poses");
}

#[test]
fn a_pose_that_gives_no_capture_is_named_and_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    // The wrist is turned away from the board.
    let away = "\n[[pose]]\nname = \"away\"\njoints_deg = [90.0, 45.0, -60.0, 0.0, -90.0, 0.0]\n";
    let poses = poses(folder.path(), 5, away);
    let out = folder.path().join("session");
    let output = handeye(&["auto", "--out", out.to_str().expect("UTF-8"), "--poses", &poses]);
    let reported = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{reported}");
    assert!(reported.contains(r#"pose "away" is left out: The board was not found"#), "{reported}");
    let session = Session::open(&out).expect("a session");
    let names: Vec<_> = session.document.captures.iter().filter_map(|capture| capture.pose_name.clone()).collect();
    assert_eq!(names, ["P1", "P2", "P3", "P4", "P5"]);
}

#[test]
fn a_camera_out_of_focus_gives_no_session_to_solve_but_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("blurred.toml");
    std::fs::write(&scene, "[image]\nblur_px = 8.0\n").expect("written");
    let poses = poses(folder.path(), 2, "");
    let out = folder.path().join("session");
    let [scene, out] = [&scene, &out].map(|path| path.to_str().expect("UTF-8"));
    let output = handeye(&["auto", "--scene", scene, "--out", out, "--poses", &poses]);
    let reported = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{reported}");
    assert!(reported.contains(r#"pose "P1" is left out: "#), "{reported}");
    assert!(reported.contains("none of the 2 poses gave a capture"), "{reported}");
}
