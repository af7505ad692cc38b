//! `handeye calibrate A B … --share-intrinsics`: several sessions of one camera.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use handeye_estimate::handeye::Mode;
use handeye_geometry::camera::Intrinsics;
use handeye_result::CalibrationResult;
use handeye_simulate::session::{REALISTIC, camera, trial};
use serde_json::Value;

use crate::solved::{handeye, text, utf8};

/// A data set of corners and robot poses, `views` of them, with an unknown lens without distortion.
fn data_set(folder: &Path, mode: Mode, views: usize, intrinsics: Intrinsics, seed: u64) {
    let trial = trial(mode, views, &REALISTIC, intrinsics, seed);
    let mode = if mode == Mode::EyeInHand { "eye_in_hand" } else { "eye_to_hand" };
    let described = format!(
        r#"mode = "{mode}"
[target]
kind = "chessboard"
columns = 10
rows = 7
square_m = 0.015
corners = "corners.csv"
[robot]
poses = "poses.csv"
length_unit = "m"
rotation = "quaternion_xyzw"
pose = "base_from_tip"
[camera]
fixed = false
width = {}
height = {}
model = "none"
"#,
        intrinsics.width, intrinsics.height
    );
    let (mut poses, mut corners) = ("image,x,y,z,qx,qy,qz,qw\n".to_owned(), "image,column,row,u,v\n".to_owned());
    for view in &trial.views {
        let name = format!("{}.png", view.name);
        let (t, q) = (view.base_from_tip.translation(), view.base_from_tip.rotation());
        writeln!(poses, "{name},{},{},{},{},{},{},{}", t.x, t.y, t.z, q.i, q.j, q.k, q.w)
            .expect("a string takes any text");
        for corner in &view.corners {
            let (column, row) = (corner.index % 10, corner.index / 10);
            writeln!(corners, "{name},{column},{row},{},{}", corner.px.x, corner.px.y)
                .expect("a string takes any text");
        }
    }
    fs::create_dir_all(folder).expect("a folder");
    for (name, text) in [("dataset.toml", described), ("poses.csv", poses), ("corners.csv", corners)] {
        fs::write(folder.join(name), text).expect("written");
    }
}

/// Folders `monday`, `tuesday` and `wednesday` of one camera, the second on a stand next to the robot (eye to hand).
fn sessions(home: &Path) -> [PathBuf; 3] {
    let folders = ["monday", "tuesday", "wednesday"].map(|name| home.join(name));
    let modes = [(Mode::EyeInHand, 10), (Mode::EyeToHand, 12), (Mode::EyeInHand, 8)];
    for ((folder, (mode, views)), seed) in folders.iter().zip(modes).zip(71..) {
        data_set(folder, mode, views, camera(), seed);
    }
    folders
}

fn results(json: &str) -> Vec<CalibrationResult> {
    let all: Vec<Value> = serde_json::from_str(json).expect("an array");
    all.iter().map(|one| CalibrationResult::from_json(&one.to_string()).expect("a result")).collect()
}

#[test]
fn sessions_get_a_result_each_as_one_alone_does_and_all_have_one_lens() {
    let home = tempfile::tempdir().expect("a folder");
    let folders = sessions(home.path());
    let [a, b, c] = folders.each_ref().map(|folder| utf8(folder));
    let (out, json) = (home.path().join("out"), home.path().join("all.json"));
    let arguments = ["calibrate", "-q", a, b, c, "--share-intrinsics", "--out", utf8(&out), "--json", utf8(&json)];
    let output = handeye(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    let all = results(&fs::read_to_string(&json).expect("written"));
    assert_eq!(all.len(), 3);
    for ((result, folder), views) in all.iter().zip(&folders).zip([10, 12, 8]) {
        let name = folder.file_name().expect("a name");
        let kept = CalibrationResult::read(&out.join(name).join("calibration.json")).expect("a result");
        assert_eq!(&kept, result, "the same in the folder of {}", name.display());
        assert!(out.join(name).join("camera_info.yaml").is_file());
        assert_eq!(result.views.len(), views);
        assert_eq!(result.intrinsics, all[0].intrinsics, "one lens");
        assert!(printed.contains(utf8(folder)), "{printed}");
        let error_mm = result.quality.tip_error_95_mm.expect("stated");
        assert!(printed.contains(&format!("below {error_mm:.3} mm in 95 %")), "{printed}");

        let alone = handeye(&["calibrate", "-q", utf8(folder), "--json", "-"]);
        let alone = CalibrationResult::from_json(&text(&alone.stdout)).expect("a result");
        let fx = |result: &CalibrationResult| result.intrinsics.as_ref().and_then(|it| it.sigma.fx).expect("estimated");
        assert!(fx(result) < fx(&alone), "{} {}", fx(result), fx(&alone));
        assert_eq!(result.provenance.input_sha256, alone.provenance.input_sha256);
        // The content of a result depends on no flag, except for the note that there were others.
        assert_eq!(result.provenance.options["share_intrinsics"].as_array().map(Vec::len), Some(2));
        let keys = |result: &CalibrationResult| {
            let value = serde_json::to_value(result).expect("JSON");
            value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>()
        };
        assert_eq!(keys(result), keys(&alone));
    }
    let fx = all[0].intrinsics.as_ref().expect("a camera");
    let sigma = fx.sigma.fx.expect("estimated");
    assert!((fx.fx - camera().fx).abs() < 5.0 * sigma, "{} ± {sigma}", fx.fx);
    assert!(printed.contains("one lens by 30 views of 3 sessions"), "{printed}");
    assert!(printed.contains(&format!("fx {:.3} ± {sigma:.3}", fx.fx)), "{printed}");
    assert!(!printed.contains("lenses_differ"), "{printed}");
    let array = handeye(&["calibrate", "-q", a, b, c, "--share-intrinsics", "--json", "-"]);
    assert_eq!(text(&array.stdout), fs::read_to_string(&json).expect("written"), "the array in place of the report");
}

#[test]
fn any_session_that_fails_its_gate_fails_the_run_and_another_lens_is_named() {
    let home = tempfile::tempdir().expect("a folder");
    let folders = sessions(home.path());
    data_set(&folders[2], Mode::EyeInHand, 8, Intrinsics::pinhole(640, 480, 595.0), 73);
    let [a, b, c] = folders.each_ref().map(|folder| utf8(folder));
    let gated = |limit: &str| handeye(&["calibrate", "-q", a, b, c, "--share-intrinsics", "--gate", limit]);
    let passed = gated("rms_px<100");
    assert_eq!(passed.status.code(), Some(0), "{}", text(&passed.stderr));
    let printed = text(&passed.stdout);
    let named = format!("The sessions do not have one lens: {c} (focal length");
    assert_eq!(printed.matches(&named).count(), 3, "with every session: {printed}");
    let failed = gated("tip_error_95_mm<0.001");
    assert_eq!(failed.status.code(), Some(1), "{}", text(&failed.stderr));
    for folder in [a, b, c] {
        assert!(
            text(&failed.stderr).contains(&format!("{folder}: gate tip_error_95_mm<0.001")),
            "{}",
            text(&failed.stderr)
        );
    }
}

#[test]
fn what_cannot_share_a_lens_is_wrong_usage_that_says_what_to_do() {
    let home = tempfile::tempdir().expect("a folder");
    let folders = sessions(home.path());
    let [a, b, c] = folders.each_ref().map(|folder| utf8(folder));
    let refused = |arguments: &[&str], words: &str| {
        let output = handeye(&[&["calibrate", "-q"][..], arguments].concat());
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(2), 1), "{arguments:?}: {message}");
        assert!(message.starts_with("error: ") && message.contains(words), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    };
    refused(&[a, b], "--share-intrinsics");
    refused(&[a, "--share-intrinsics"], "two or more");
    refused(&[a, b, "--share-intrinsics", "--method", "tsai_lenz"], "--method");
    refused(&[a, b, "--share-intrinsics", "--rerun", "web"], "--rerun");
    refused(&[a, b, a, "--share-intrinsics"], "the same captures");
    let change = |from: &str, to: &str| {
        let file = folders[2].join("dataset.toml");
        let described = fs::read_to_string(&file).expect("a description");
        assert!(described.contains(from), "{described}");
        fs::write(&file, described.replace(from, to)).expect("written");
    };
    change("model = \"none\"", "model = \"brown_conrady\"");
    refused(&[a, b, c, "--share-intrinsics"], "the lens of");
    change("width = 640", "width = 648");
    refused(&[a, b, c, "--share-intrinsics"], "648×480 pixels");
    change("fixed = false", "fixed = true\nfx = 581\nfy = 581\ncx = 320\ncy = 240\ndistortion = [0, 0, 0, 0, 0]");
    refused(&[a, b, c, "--share-intrinsics"], "fixed = false");
    let few = handeye(&["calibrate", "-q", a, utf8(&home.path().join("nowhere")), "--share-intrinsics"]);
    assert_eq!(few.status.code(), Some(2));
    // A session without an answer is not wrong usage, and it is named.
    let poses = fs::read_to_string(folders[1].join("poses.csv")).expect("a table");
    let two: Vec<&str> = poses.lines().take(3).collect();
    fs::write(folders[1].join("poses.csv"), two.join("\n") + "\n").expect("written");
    let corners = fs::read_to_string(folders[1].join("corners.csv")).expect("a table");
    let of_two = |line: &&str| ["image,", "000.png,", "001.png,"].iter().any(|start| line.starts_with(start));
    fs::write(folders[1].join("corners.csv"), corners.lines().filter(of_two).collect::<Vec<_>>().join("\n") + "\n")
        .expect("written");
    let few = handeye(&["calibrate", "-q", a, b, "--share-intrinsics"]);
    assert_eq!(few.status.code(), Some(1), "{}", text(&few.stderr));
    assert!(text(&few.stderr).contains(&format!("error: {b}: the target")), "{}", text(&few.stderr));
}
