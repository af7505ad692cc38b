//! The workflow of a user who opens the workbench for the first time, with a real mouse and keyboard on a screen of its
//! own.
//!
//! Screenshots go to `$HANDEYE_SCREENSHOTS`, or else next to the build.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use handeye_tests::desktop::{self, Desktop};
use handeye_tests::hurried;

#[test]
fn a_first_user_gets_from_the_start_to_exported_files_with_few_clicks() {
    if !desktop::is_possible() {
        return;
    }
    let shots = std::env::var_os("HANDEYE_SCREENSHOTS")
        .filter(|folder| !folder.is_empty())
        .map_or_else(|| PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("first_user"), PathBuf::from);
    let mut desktop = Desktop::start((1440, 900), &shots, &[], &[]);
    let began = Instant::now();
    desktop.until_seen("Connected to the built-in cell");
    desktop.until_seen("Board in view");
    desktop.photograph("1-connected");

    desktop.click("Run the 10 taught poses");
    desktop.until_seen("4 of 10 poses");
    desktop.photograph("2-capturing");
    desktop.until_seen("10 poses");
    desktop.until_seen("Sequence ended");
    desktop.click("4 Solve");
    desktop.until_seen("Expected error");
    desktop.photograph("3-solved");

    // Somewhere between the poses, for a verification capture.
    desktop.click("Jog");
    desktop.click("Step 50 mm");
    let before = desktop.label("Tip in base, x y z [mm]:");
    desktop.click("Move +Z");
    desktop.until_other("Tip in base, x y z [mm]:", &before);
    desktop.until_seen("The arm is at rest");
    desktop.click("5 Verify");
    desktop.click("Capture for verification");
    desktop.until_seen("Middle of the board");
    desktop.photograph("4-verified");

    desktop.click("6 Export");
    desktop.click("Export 4 formats");
    desktop.until_seen("read back and compared");
    desktop.photograph("5-exported");
    let took = began.elapsed();
    println!("first user: {} clicks, {:.0} s on the clock", desktop.clicks(), took.as_secs_f64());
    assert!(desktop.clicks() <= 15, "{} clicks", desktop.clicks());
    // The built-in cell keeps pace with real time, so the clock is at least the simulated time.
    assert!(took < Duration::from_mins(3) || cfg!(debug_assertions), "{took:?}");
    let sessions = desktop.home().join("handeye-sessions");
    let session = std::fs::read_dir(&sessions).expect("the sessions").flatten().next().expect("a session").path();
    for file in ["result.json", "exports/calibration.json", "exports/opencv.yaml"] {
        assert!(session.join(file).is_file(), "{file}");
    }

    // The same session again, in Chinese and with the light theme; nothing had to be saved.
    let session = session.to_string_lossy().into_owned();
    let copy = tempfile::tempdir().expect("a folder");
    let kept = copy.path().join("标定");
    let copied = std::process::Command::new("cp").arg("-r").arg(&session).arg(&kept).status();
    assert!(copied.is_ok_and(|status| status.success()));
    drop(desktop);
    let environment = [("HANDEYE_LANGUAGE", "zh-CN"), ("HANDEYE_THEME", "light")];
    let arguments = ["--session", kept.to_str().expect("a name")];
    let mut desktop = Desktop::start((1440, 900), &shots, &arguments, &environment);
    desktop.until_seen("已看到标定板");
    desktop.click("4 求解");
    desktop.until_seen("预期误差（95 %）");
    desktop.photograph("zh-solved");
}

#[test]
fn a_first_user_has_the_poses_chosen_and_gets_to_exported_files_with_three_clicks() {
    guided("first_user_guided", "reference");
}

/// Seven joints, and a board that lies flat in front of the camera.
#[test]
fn a_first_user_of_a_panda_has_the_poses_chosen_and_gets_to_exported_files_with_three_clicks() {
    guided("first_user_panda", "panda");
}

fn guided(name: &str, scene: &str) {
    if !desktop::is_possible() {
        return;
    }
    let shots = std::env::var_os("HANDEYE_SCREENSHOTS").filter(|folder| !folder.is_empty()).map_or_else(
        || PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name),
        |folder| PathBuf::from(folder).join(name),
    );
    let folder = tempfile::tempdir().expect("a folder");
    // What takes two minutes in a release build takes many without optimization.
    let hurries = cfg!(debug_assertions);
    let scene = if hurries { hurried(scene, folder.path()).display().to_string() } else { scene.to_owned() };
    let mut desktop = Desktop::start((1440, 900), &shots, &["--scene", &scene], &[]);
    let began = Instant::now();
    desktop.until_seen("Board in view");
    desktop.click("Calibrate for me");
    desktop.until_seen("Lowers the expected error");
    desktop.photograph("guided");
    desktop.until_seen("The goal is reached");
    desktop.until_seen("3 captures");
    desktop.photograph("reached");
    desktop.click("6 Export");
    desktop.click("Export 4 formats");
    desktop.until_seen("read back and compared");
    desktop.photograph("exported");
    let took = began.elapsed();
    println!("{name}: {} clicks, {:.0} s on the clock", desktop.clicks(), took.as_secs_f64());
    assert!(desktop.clicks() <= 5, "{} clicks", desktop.clicks());
    assert!(took < Duration::from_mins(2) || hurries, "{took:?}");
    let sessions = desktop.home().join("handeye-sessions");
    let session = std::fs::read_dir(&sessions).expect("the sessions").flatten().next().expect("a session").path();
    assert!(session.join("exports/calibration.json").is_file());
}
