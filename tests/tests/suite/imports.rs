//! `handeye import` on recordings in other tools' formats, compared with an independent reader in Python.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use handeye_dataset::Dataset;
use handeye_geometry::testing::{data_folder, python};
use handeye_tests::workbench::Workbench;
use handeye_tests::workspace_root;
use handeye_workbench::model::{CellSource, Dialog, Model};
use handeye_workbench::text::Language;
use handeye_workbench::{import, session};
use nalgebra::Matrix4;
use serde_json::Value;
use tempfile::TempDir;

use crate::solved::{command, text};

/// A recording, and what is known about it.
struct Sample {
    /// Its name in the reader in Python.
    kind: &'static str,
    /// Files of the reference data; a folder is taken whole.
    files: &'static [&'static str],
    arguments: &'static [&'static str],
    /// Conventions that the first hypothesis has to have.
    first: &'static [(&'static str, &'static str)],
    views: usize,
}

const HAND: &str = "mode=eye_in_hand";

const SAMPLES: [Sample; 8] = [
    Sample {
        kind: "table",
        files: &["importers/table_eye_in_hand"],
        arguments: &["--target", "11x8x20", "--set", HAND],
        first: &[
            ("rotation", "euler_zyx_321"),
            ("pose", "base_from_tip"),
            ("length_unit", "m"),
            ("angle_unit", "rad"),
            ("pairing", "row+0"),
        ],
        views: 20,
    },
    Sample {
        kind: "json_per_pose",
        files: &["importers/json_per_pose_rgbd/Hand-Eye-Data"],
        arguments: &["--target", "kind=charuco,columns=4,rows=6,square=33,marker=20,dictionary=6x6_250", "--set", HAND],
        first: &[("rotation", "rotation_vector"), ("pose", "base_from_tip"), ("length_unit", "m"), ("pairing", "file")],
        views: 24,
    },
    Sample {
        kind: "easy_handeye2_in_hand",
        files: &[
            "importers/easy_handeye2/easy_handeye2_demo_eih.samples",
            "importers/easy_handeye2/easy_handeye2_demo_eih.calib",
        ],
        arguments: &[],
        first: &[("mode", "eye_in_hand"), ("pose", "base_from_tip")],
        views: 0,
    },
    Sample {
        kind: "easy_handeye2_on_base",
        files: &[
            "importers/easy_handeye2/easy_handeye2_demo_eob.samples",
            "importers/easy_handeye2/easy_handeye2_demo_eob.calib",
        ],
        arguments: &[],
        first: &[("mode", "eye_to_hand"), ("pose", "tip_from_base")],
        views: 0,
    },
    Sample {
        kind: "moveit",
        files: &["moveit_pose_samples/pose_samples.json"],
        arguments: &[],
        first: &[("mode", "eye_to_hand"), ("pose", "base_from_tip")],
        views: 50,
    },
    Sample {
        kind: "visp",
        files: &["visp_franka_eye_in_hand"],
        arguments: &[],
        first: &[("mode", "eye_in_hand"), ("pose", "base_from_tip"), ("rotation", "rotation_vector")],
        views: 8,
    },
    // The description of its tag has no number, but the images have one.
    Sample {
        kind: "visp",
        files: &["visp_franka_eye_to_hand"],
        arguments: &[],
        first: &[("mode", "eye_to_hand"), ("pose", "base_from_tip"), ("rotation", "rotation_vector")],
        views: 8,
    },
    Sample {
        kind: "blocks_in_mm",
        files: &["caliban_no_curv/images", "caliban_no_curv/robot_cali.txt"],
        arguments: &["--target", "14x9x12.1", "--set", HAND],
        first: &[("pose", "tip_from_base"), ("length_unit", "mm"), ("pairing", "row+0")],
        views: 20,
    },
];

/// Views that `write_bag.py` records.
const BAG_VIEWS: usize = 8;

/// The sample without what this project has added to it.
fn copied(data: &Path, files: &[&str]) -> (TempDir, PathBuf) {
    let home = tempfile::tempdir().expect("a folder");
    let folder = home.path().join("recording");
    std::fs::create_dir(&folder).expect("made");
    for file in files {
        let from = data.join(file);
        let members: Vec<PathBuf> = if from.is_dir() {
            std::fs::read_dir(&from).expect("listed").map(|entry| entry.expect("entry").path()).collect()
        } else {
            vec![from]
        };
        for member in members.into_iter().filter(|member| member.is_file()) {
            let name = member.file_name().expect("a name").to_string_lossy().into_owned();
            let is_ours =
                ["dataset.toml", "poses.csv", "corners.csv", "points.csv", "views.json", "README.md"].contains(&&*name);
            if !is_ours {
                std::fs::copy(&member, folder.join(name)).expect("copied");
            }
        }
    }
    (home, folder)
}

fn matrices(value: &Value) -> BTreeMap<String, Matrix4<f64>> {
    let entries = value.as_object().expect("an object");
    entries.iter().map(|(key, value)| (key.clone(), matrix(value))).collect()
}

fn matrix(value: &Value) -> Matrix4<f64> {
    let number = |value: &Value| value.as_f64().expect("a number");
    let rows = value.as_array().expect("rows").iter().flat_map(|row| row.as_array().expect("a row").iter().map(number));
    Matrix4::from_row_iterator(rows)
}

/// Seconds that reading may take on a busy machine.
const PATIENCE: &str = "600";
/// Hypotheses that the list shows; the others are counted.
const SHOWN: usize = 12;

#[test]
fn the_list_of_hypotheses_counts_what_it_leaves_out_and_says_nothing_of_more_where_it_shows_all() {
    let Some(data) = data_folder() else { return };
    // If the place of the camera is all that is open, both are offered and the rest is not listed.
    let many = (&["importers/table_eye_in_hand"][..], &["--target", "11x8x20", "--set", "mode=eye_in_hand"][..]);
    let few = (&["moveit_pose_samples/pose_samples.json"][..], &[][..]);
    let counts = [many, few].map(|(files, arguments)| {
        let (home, folder) = copied(&data, files);
        let found = home.path().join("found.json");
        let run = command()
            .args(["import", "--quiet", "--time", PATIENCE])
            .args(arguments)
            .arg("--json")
            .arg(&found)
            .arg(&folder)
            .output();
        let reported = text(&run.expect("it runs").stdout);
        let found: Value = serde_json::from_slice(&std::fs::read(&found).expect("written")).expect("JSON");
        let all = found["judgement"]["hypotheses"].as_array().expect("a list").len();
        let more = reported.lines().find_map(|line| line.trim().strip_prefix("and ")?.strip_suffix(" more"));
        let left_out = more.map(|count| count.parse::<usize>().expect("a number"));
        assert_eq!(left_out, (all > SHOWN).then(|| all - SHOWN), "{all} hypotheses:\n{reported}");
        all
    });
    assert!(counts[0] > SHOWN && counts[1] < SHOWN, "both cases are there: {counts:?}");
}

#[test]
fn recordings_of_others_are_read_as_an_independent_reader_reads_them() {
    let Some(data) = data_folder() else { return };
    let Some(python) = python() else { return };
    for sample in SAMPLES {
        let (home, folder) = copied(&data, sample.files);
        let (out, found) = (home.path().join("set"), home.path().join("found.json"));
        let run = command()
            .args(["import", "--quiet", "--time", PATIENCE, "--take", "best"])
            .args(sample.arguments)
            .arg("--out")
            .arg(&out)
            .arg("--json")
            .arg(&found)
            .arg(&folder)
            .output()
            .expect("it runs");
        let (reported, errors) = (text(&run.stdout), text(&run.stderr));
        let what = format!("{} {:?}\n{reported}\n{errors}", sample.kind, sample.files);
        assert!(run.status.success(), "{what}");
        let found: Value = serde_json::from_slice(&std::fs::read(&found).expect("written")).expect("JSON");
        let first = &found["judgement"]["hypotheses"][0]["conventions"];
        for (key, value) in sample.first {
            assert_eq!(first[key], *value, "{key} of {what}");
        }
        let read = Command::new(&python)
            .arg(workspace_root().join("tests/python/read_recordings.py"))
            .arg(sample.kind)
            .arg(&folder)
            .output()
            .expect("Python runs");
        assert!(read.status.success(), "{}", text(&read.stderr));
        let truth: Value = serde_json::from_slice(&read.stdout).expect("JSON");
        let (robot, target) =
            (matrices(&truth["robot"]), truth["target"].as_object().map(|_| matrices(&truth["target"])));
        let dataset = Dataset::read(&out).unwrap_or_else(|e| panic!("{e}: {what}"));
        assert!(dataset.entries.len() >= sample.views.max(3), "{} views of {what}", dataset.entries.len());
        for (i, entry) in dataset.entries.iter().enumerate() {
            let key = match &entry.image_path {
                Some(path) => path.file_name().expect("a name").to_string_lossy().into_owned(),
                None => i.to_string(),
            };
            let off = (entry.base_from_tip.expect("a pose").matrix() - robot[&key]).amax();
            assert!(off < 1e-9, "{key}: {off} of {what}");
            if let Some(target) = &target {
                let off = (entry.camera_from_target.expect("a pose").matrix() - target[&key]).amax();
                assert!(off < 1e-9, "the target of {key}: {off} of {what}");
            }
        }
        let solved = command().args(["calibrate", "--quiet", "--json", "-"]).arg(&out).output().expect("it runs");
        assert!(solved.status.success(), "{}: {what}", text(&solved.stderr));
    }
}

#[test]
fn what_the_files_leave_open_is_listed_and_nothing_is_written() {
    let Some(data) = data_folder() else { return };
    let (home, folder) = copied(&data, &["importers/easy_handeye2/easy_handeye2_demo_eob.samples"]);
    let out = home.path().join("set");
    let run = command().arg("import").arg(&folder).arg("--out").arg(&out).output().expect("it runs");
    assert_eq!(run.status.code(), Some(1), "{}", text(&run.stderr));
    let reported = text(&run.stdout);
    assert!(reported.contains("mode=eye_in_hand") && reported.contains("mode=eye_to_hand"), "{reported}");
    assert!(text(&run.stderr).contains("--take"), "{}", text(&run.stderr));
    for mode in ["eye_in_hand", "eye_to_hand"] {
        let command = format!("--set mode={mode} --out {}", out.display());
        assert!(text(&run.stderr).contains(&command), "{}", text(&run.stderr));
    }
    assert!(!out.exists(), "nothing is written");
    let known = ["--set", "mode=eye_to_hand"];
    let run = command().arg("import").arg(&folder).arg("--out").arg(&out).args(known).output().expect("it runs");
    assert!(run.status.success(), "{}", text(&run.stderr));
    let described = std::fs::read_to_string(out.join("dataset.toml")).expect("written");
    assert!(described.contains("mode = eye_to_hand") && described.contains("given with --set"), "{described}");
    let again = command().arg("import").arg(&folder).arg("--out").arg(&out).args(known).output().expect("it runs");
    assert_eq!(again.status.code(), Some(2), "a folder with something in it is refused");
}

#[test]
fn squares_counted_for_corners_and_a_target_not_named_are_said_with_what_is_seen() {
    let Some(data) = data_folder() else { return };
    let (home, folder) = copied(&data, &["visp_franka_eye_in_hand"]);
    std::fs::remove_file(folder.join("chessboard-data.txt")).expect("the note of the target goes");
    let out = home.path().join("set");
    for (arguments, code) in [(&[][..], 1), (&["--target", "10x7x23.6"][..], 1)] {
        let run =
            command().arg("import").arg(&folder).arg("--out").arg(&out).args(arguments).output().expect("it runs");
        let reported = text(&run.stderr);
        assert_eq!(run.status.code(), Some(code), "{reported}");
        assert!(reported.contains("9 × 6 inner corners"), "{reported}");
        assert!(!out.exists());
    }
}

/// A bag from a third-party writer, of a robot that moves from view to view, in every file format of that writer.
#[test]
fn a_bag_gives_the_images_where_the_robot_rested_with_its_poses_there() {
    let Some(data) = data_folder() else { return };
    let Some(python) = python() else { return };
    let (home, folder) = copied(&data, &["importers/table_eye_in_hand"]);
    let read = Command::new(&python)
        .arg(workspace_root().join("tests/python/read_recordings.py"))
        .arg("table")
        .arg(&folder)
        .output()
        .expect("Python runs");
    let truth: Value = serde_json::from_slice(&read.stdout).expect("JSON");
    let robot = matrices(&truth["robot"]);
    for kind in [
        "sqlite3",
        "sqlite3 file",
        "sqlite3 message",
        "mcap",
        "mcap file",
        "mcap message",
        "mcap storage",
        "ros1",
        "ros1 bz2",
        "ros1 lz4",
    ] {
        let name = kind.replace(' ', "_");
        let ending = if kind.starts_with("ros1") { ".bag" } else { "" };
        let (bag, out) = (home.path().join(format!("{name}{ending}")), home.path().join(format!("{name}_set")));
        let wrote = Command::new(&python)
            .arg(workspace_root().join("tests/python/write_bag.py"))
            .args([&folder, &bag])
            .args(kind.split(' '))
            .output()
            .expect("Python runs");
        assert!(wrote.status.success(), "{}", text(&wrote.stderr));
        let run = command()
            .args(["import", "--quiet", "--time", PATIENCE, "--target", "11x8x20", "--set", HAND, "--out"])
            .args([&out, &bag])
            .output()
            .expect("it runs");
        let what = format!("{kind}\n{}\n{}", text(&run.stdout), text(&run.stderr));
        assert!(run.status.success(), "{what}");
        let dataset = Dataset::read(&out).expect("a data set");
        assert_eq!(dataset.entries.len(), BAG_VIEWS, "{what}");
        for (i, entry) in dataset.entries.iter().enumerate() {
            let off = (entry.base_from_tip.expect("a pose").matrix() - robot[&format!("images{i}.jpg")]).amax();
            assert!(off < 1e-9, "{i}: {off} of {what}");
        }
    }
}

/// What is dropped on the window and is neither a session nor a data set.
#[test]
fn a_recording_becomes_a_session_in_the_window_once_a_person_has_said_what_the_files_do_not() {
    let Some(data) = data_folder() else { return };
    let (home, folder) = copied(&data, &["importers/table_eye_in_hand"]);
    let sessions = home.path().join("sessions");
    let mut bench = Workbench::start(CellSource::default(), &sessions, None);
    let import = |model: &Model| model.import.clone().filter(|import| import.work.is_none());
    bench.click(session::Command::Open(folder.clone()));
    bench.until("the question for the target", |model| import(model).is_some_and(|import| import.trouble.is_some()));
    assert_eq!(bench.model().dialog, Some(Dialog::Import));
    let why = import(bench.model()).and_then(|import| import.trouble).expect("a reason").in_language(Language::English);
    assert!(why.contains("11 × 8 inner corners"), "what is in sight is said: {why}");
    bench.click(import::Command::SetTarget("11x8x20".to_owned()));
    let hypotheses =
        |model: &Model| import(model).and_then(|import| import.found).map_or(0, |it| it.hypotheses().len());
    bench.until("hypotheses", |model| hypotheses(model) > 0);
    assert_eq!(import(bench.model()).expect("open").chosen, None, "both places of the camera explain it");
    bench.click(import::Command::FixConvention { key: "mode".to_owned(), value: Some("eye_in_hand".to_owned()) });
    bench.until("the one that is left", |model| import(model).is_some_and(|import| import.chosen == Some(0)));
    bench.click(import::Command::ConvertRecording);
    bench.until("the session", |model| model.document().captures.len() == 20 && model.dialog.is_none());
    bench.until("a solution", |model| model.solve.fresh && model.solve.solved.is_some());
    let session = bench.model().session.folder.clone().expect("on the disk");
    assert!(session.starts_with(&sessions), "{}", session.display());
    let reported = std::fs::read_to_string(session.join("imported.toml")).expect("how it was understood");
    assert!(reported.contains("rotation = euler_zyx_321") && reported.contains("given with --set"), "{reported}");
    assert!(bench.model().import.is_none(), "nothing is left open");
}

/// A user with a camera and a board, but no robot: the window finds the same camera as the command line.
#[test]
fn images_alone_become_a_session_that_calibrates_the_camera_as_the_command_line_does() {
    let home = TempDir::new().expect("a folder");
    let (folder, sessions) = (home.path().join("photographs"), home.path().join("sessions"));
    std::fs::create_dir(&folder).expect("made");
    for n in 1..=12 {
        let name = format!("{n:02}.jpg");
        let image = workspace_root().join("assets/samples/ur5/images").join(&name);
        std::fs::copy(image, folder.join(name)).expect("copied");
    }
    let mut bench = Workbench::start(CellSource::default(), &sessions, None);
    let import = |model: &Model| model.import.clone().filter(|import| import.work.is_none());
    bench.click(session::Command::Open(folder.clone()));
    bench.until("what is there", |model| import(model).is_some_and(|import| import.trouble.is_some()));
    let found = import(bench.model()).and_then(|import| import.found).expect("images");
    let notes: Vec<String> =
        found.looked.iter().flat_map(|looked| &looked.notes).map(|note| note.in_language(Language::English)).collect();
    assert!(
        notes.iter().any(|note| note.contains("10 × 7 inner corners in 12")),
        "what is in sight is said: {notes:?}"
    );
    bench.click(import::Command::SetTarget("10x7x15".to_owned()));
    bench.until("the target", |model| import(model).and_then(|it| it.found).is_some_and(|it| it.target().is_some()));
    bench.click(import::Command::ConvertImages);
    bench.until("the session", |model| model.document().captures.len() == 12 && model.dialog.is_none());
    bench.until("a solution", |model| model.solve.fresh && model.solve.solved.is_some());
    let session = bench.model().session.folder.clone().expect("on the disk");
    let solved = bench.model().solve.current().expect("solved");
    assert!(solved.calibration.hand_eye.is_none(), "there is no robot");
    let in_window = solved.calibration.intrinsics().expect("found");
    drop(bench);

    let target = "[target]\nkind = \"chessboard\"\ncolumns = 10\nrows = 7\nsquare_m = 0.015\n";
    std::fs::write(folder.join("dataset.toml"), target).expect("written");
    for (input, what) in [(&folder, "the images"), (&session, "the session")] {
        let run = command().args(["calibrate", "--quiet", "--json", "-"]).arg(input).output().expect("it runs");
        assert!(run.status.success(), "{what}: {}", text(&run.stderr));
        let result: Value = serde_json::from_slice(&run.stdout).expect("JSON");
        for (key, value) in [("fx", in_window.fx), ("fy", in_window.fy), ("cx", in_window.cx), ("cy", in_window.cy)] {
            let off_px = result["intrinsics"][key].as_f64().expect("a number") - value;
            // Recorded images are kept as they are, so the numbers are the same except for their order.
            assert!(off_px.abs() < 1e-6, "{key} of {what} is {off_px} px off");
        }
        assert_eq!(result["hand_eye"], Value::Null, "{what}");
    }
}

/// The images of a robot that never rests, from a camera whose clock is behind by 44 ms: every view has to get the pose of
/// the robot when it was taken, and the calibration the true pose of the camera.
#[test]
fn a_bag_of_a_moving_robot_gives_poses_by_the_clocks_of_both_and_a_calibration() {
    let Some(python) = python() else { return };
    let home = TempDir::new().expect("a folder");
    let (bag, out) = (home.path().join("bag"), home.path().join("set"));
    let wrote = Command::new(&python)
        .arg(workspace_root().join("tests/python/write_moving_bag.py"))
        .arg(&bag)
        .output()
        .expect("Python runs");
    assert!(wrote.status.success(), "{}", text(&wrote.stderr));
    let truth: Value = serde_json::from_slice(&wrote.stdout).expect("JSON");
    let run = command()
        .args(["import", "--quiet", "--time", PATIENCE, "--target", "8x6x25", "--json", "-", "--out"])
        .args([&out, &bag])
        .output()
        .expect("it runs");
    let what = format!("{}\n{}", text(&run.stdout), text(&run.stderr));
    assert!(run.status.success(), "{what}");
    let report: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let clocks = &report["judgement"]["clocks"][0];
    let of = |key: &str| clocks[key].as_f64().expect("a number");
    let off = of("offset_s") - truth["offset_s"].as_f64().expect("a number");
    assert!(off.abs() < 4.0 * of("sigma_s") && of("sigma_s") < 2e-3, "{off} of {clocks}");

    let poses = matrices(&truth["base_from_tip"]);
    let dataset = Dataset::read(&out).expect("a data set");
    assert!(dataset.entries.len() > 40, "{what}");
    for entry in &dataset.entries {
        let name = entry.image_path.as_ref().expect("an image").to_string_lossy().into_owned();
        let (_, true_pose) = poses.iter().find(|(stamp, _)| name.contains(*stamp)).expect("an image of the bag");
        let off = (entry.base_from_tip.expect("a pose").matrix() - true_pose).amax();
        // The robot is at some 0.2 m/s: with unchanged stamps it would be 9 mm off.
        assert!(off < 2e-3, "{name}: {off}");
    }
    let run = command().args(["calibrate", "--quiet", "--json", "-"]).arg(&out).output().expect("it runs");
    let solved: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let place = solved["hand_eye"]["translation_m"].as_array().expect("a place");
    let true_pose = matrix(&truth["tip_from_camera"]);
    let off_m = place.iter().enumerate().map(|(i, value)| value.as_f64().expect("a number") - true_pose[(i, 3)]);
    let off_mm = off_m.map(|off| off * off).sum::<f64>().sqrt() * 1e3;
    assert!(off_mm < 0.1, "{off_mm} mm off: {solved}");
}
