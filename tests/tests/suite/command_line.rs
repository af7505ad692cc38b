//! The contract of the command line: exit codes, streams, one-line errors.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use handeye_result::CalibrationResult;
use handeye_tests::handeye_binary;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use serde_json::Value;

use crate::solved::{copy_of_session, handeye, text, utf8};

/// A dataset folder of corners only: four views of a board on a robot whose poses are given.
fn dataset(folder: &Path, poses: &str) {
    std::fs::write(
        folder.join("dataset.toml"),
        r#"
mode = "eye_in_hand"
[target]
kind = "chessboard"
columns = 4
rows = 3
square_m = 0.03
corners = "corners.csv"
[robot]
poses = "poses.csv"
length_unit = "m"
rotation = "rotation_vector"
angle_unit = "rad"
pose = "base_from_tip"
[camera]
fixed = true
width = 640
height = 480
fx = 600
fy = 600
cx = 320
cy = 240
model = "none"
distortion = []
"#,
    )
    .expect("written");
    std::fs::write(folder.join("poses.csv"), poses).expect("written");
    let mut corners = String::from("image,column,row,u,v\n");
    for image in poses.lines().skip(1).filter_map(|l| l.split(',').next()) {
        for row in 0..3 {
            for column in 0..4 {
                let (u, v) = (250 + 40 * column, 200 + 40 * row);
                writeln!(corners, "{image},{column},{row},{u},{v}").expect("a string takes any text");
            }
        }
    }
    std::fs::write(folder.join("corners.csv"), corners).expect("written");
}

/// Packages are for Ubuntu 22.04 and what is newer.
#[test]
fn the_program_needs_no_newer_system_than_packages_are_for() {
    const MOST: [(&str, &[u32]); 2] = [("GLIBC_", &[2, 35]), ("GLIBCXX_", &[3, 4, 30])];
    let listed =
        Command::new("objdump").arg("-T").arg(handeye_binary()).output().expect("binutils, as for the compiler");
    let listed = String::from_utf8_lossy(&listed.stdout);
    for (name, most) in MOST {
        let needed =
            listed.split(|c: char| c.is_whitespace() || "()".contains(c)).filter_map(|word| word.strip_prefix(name));
        let numbers = |version: &str| version.split('.').map_while(|part| part.parse().ok()).collect::<Vec<u32>>();
        let newest = needed.map(numbers).max().expect("it is linked to it");
        assert!(newest.as_slice() <= most, "{name}{newest:?}");
    }
}

#[test]
fn a_target_is_printed_and_described_for_a_data_set() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("board.pdf");
    let path = file.to_str().expect("UTF-8");
    let board = ["target", "--kind", "charuco", "--columns", "6", "--rows", "8", "--square", "22", "--pdf", path];
    let refused = handeye(&board);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("--marker"), "{}", text(&refused.stderr));
    let output = handeye(&[&board[..], &["--marker", "16", "--dictionary", "5x5_100"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).starts_with("[target]\nkind = \"charuco\"\ncolumns = 6\n"));
    assert!(std::fs::read(&file).expect("written").starts_with(b"%PDF-"));
    let large =
        handeye(&["target", "--kind", "circles", "--columns", "9", "--rows", "9", "--square", "90", "--pdf", path]);
    assert_eq!(large.status.code(), Some(2));
    assert!(text(&large.stderr).contains("fit"), "{}", text(&large.stderr));
}

#[test]
fn wrong_usage_and_unreadable_input_exit_with_2_and_one_line() {
    assert_eq!(handeye(&["calibrate"]).status.code(), Some(2));
    assert_eq!(handeye(&["no-such-command"]).status.code(), Some(2));
    assert_eq!(handeye(&["calibrate", "x", "--method", "no-such-method"]).status.code(), Some(2));
    assert_eq!(handeye(&["doctor"]).status.code(), Some(2));
    assert_eq!(handeye(&["doctor", "x", "--goal", "small"]).status.code(), Some(2));
    assert_eq!(handeye(&["track"]).status.code(), Some(2));
    assert_eq!(handeye(&["track", "--calibration", "x", "--follow", "--reach", "0"]).status.code(), Some(2));
    assert_eq!(handeye(&["track", "--calibration", "x", "--corner", "0"]).status.code(), Some(2));
    let folder = tempfile::tempdir().expect("a folder");
    dataset(folder.path(), "image,x,y,z,rx,ry,rz\na.png,0,0,0,0,0,0\na.png,0,0,nan,0,0,0\n");
    let path = folder.path().to_str().expect("UTF-8");
    for arguments in [
        &["calibrate", "/no/such/folder"][..],
        &["calibrate", path],
        &["doctor", "/no/such/folder"],
        &["doctor", path],
        &["track", "--calibration", "/no/such/result.json"],
        &["track", "--calibration", path],
        &["export", path, "--format", "json", "--out", path],
        &["auto", "--poses", "/no/such/poses.toml"],
        &["cell", "--scene", "/no/such/scene.toml"],
    ] {
        let output = handeye(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", text(&output.stderr));
        let message = text(&output.stderr);
        assert_eq!(message.trim_end().lines().count(), 1, "{arguments:?}: {message}");
        assert!(message.starts_with("error: "), "{message}");
        assert!(output.stdout.is_empty());
    }
    let message = text(&handeye(&["calibrate", path]).stderr);
    assert!(message.contains("poses.csv") && message.contains("row 3"), "{message}");
}

#[test]
fn sets_without_an_answer_exit_with_1_and_say_what_to_do() {
    let one = "image,x,y,z,rx,ry,rz\na.png,0,0,0,0,0,0\n";
    let identical =
        "image,x,y,z,rx,ry,rz\na.png,0,0,0,0,0,0\nb.png,0,0,0,0,0,0\nc.png,0,0,0,0,0,0\nd.png,0,0,0,0,0,0\n";
    let parallel = "image,x,y,z,rx,ry,rz\na.png,0,0,0,0,0,0\nb.png,0.1,0,0,0,0,0.3\nc.png,0,0.1,0,0,0,0.7\nd.png,0,0,0.1,0,0,1.1\n";
    for (poses, words) in [(one, "at least 3"), (identical, "turned by no more than"), (parallel, "same axis")] {
        let folder = tempfile::tempdir().expect("a folder");
        dataset(folder.path(), poses);
        let output = handeye(&["calibrate", folder.path().to_str().expect("UTF-8"), "--quiet"]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(words), "{message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    }
}

#[test]
fn squares_counted_for_inner_corners_are_named_with_the_grid_that_is_there() {
    let (_home, session) = copy_of_session();
    let folder = tempfile::tempdir().expect("a folder");
    for image in std::fs::read_dir(session.join("images")).expect("images") {
        let image = image.expect("an image").path();
        std::fs::copy(&image, folder.path().join(image.file_name().expect("a name"))).expect("copied");
    }
    // The board has 11 × 8 squares.
    let described = "[target]\nkind = \"chessboard\"\ncolumns = 11\nrows = 8\nsquare_m = 0.015\n";
    std::fs::write(folder.path().join("dataset.toml"), described).expect("written");
    for command in ["calibrate", "doctor"] {
        let output = handeye(&[command, utf8(folder.path()), "--quiet"]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("a chessboard of 10 × 7 inner corners"), "{message}");
        assert!(message.contains("one fewer than squares"), "{message}");
    }
}

#[test]
fn the_doctor_answers_for_a_healthy_session_and_for_one_without_an_answer() {
    let (_home, session) = copy_of_session();
    let report = handeye(&["doctor", utf8(&session)]);
    assert_eq!(report.status.code(), Some(0), "{}", text(&report.stderr));
    let file = session.join("diagnosis.json");
    let again = handeye(&["doctor", utf8(&session), "--json", utf8(&file)]);
    assert_eq!(again.stdout, report.stdout, "the report is the same with and without a file");
    let diagnosis: Value = serde_json::from_slice(&std::fs::read(&file).expect("written")).expect("JSON");
    assert_eq!(diagnosis["untested"], Value::Null);
    let spoils = |finding: &&Value| finding["severity"] == "problem";
    let findings = diagnosis["findings"].as_array().expect("findings");
    assert_eq!(findings.iter().filter(spoils).count(), 0, "{diagnosis:#}");
    for finding in findings {
        let reported = finding["text"].as_str().expect("a text");
        assert!(text(&report.stdout).contains(reported), "{reported:?} is not in the report");
    }

    // A missing calibration is the subject of the diagnosis.
    let folder = tempfile::tempdir().expect("a folder");
    dataset(folder.path(), "image,x,y,z,rx,ry,rz\na.png,0,0,0,0,0,0\n");
    let ill = handeye(&["doctor", utf8(folder.path())]);
    assert_eq!(ill.status.code(), Some(0), "{}", text(&ill.stderr));
    assert!(text(&ill.stderr).contains("no calibration: ") && !ill.stdout.is_empty());
}

#[test]
fn a_track_has_a_pose_for_every_image_and_needs_a_hand_eye_transform() {
    let (_home, session) = copy_of_session();
    let result = session.join("result.json");
    let file = session.join("track.json");
    // From the session and from its result: the board is known from both.
    for calibration in [&session, &result] {
        // A board that moves may leave the view between two images on a busy machine.
        let run = ["track", "-q", "--calibration", utf8(calibration), "--frames", "5", "--board-path", "still"];
        let output = handeye(&[&run[..], &["--json", utf8(&file)]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stdout).starts_with("tracked in "), "{}", text(&output.stdout));
        let track: Value = serde_json::from_slice(&std::fs::read(&file).expect("written")).expect("JSON");
        assert_eq!(track["format"], "handeye-track");
        let frames = track["frames"].as_array().expect("images");
        assert_eq!((frames.len(), track["summary"]["frames"].as_u64()), (5, Some(5)));
        assert!(frames.iter().all(|frame| frame["base_from_target"]["translation_m"].is_array()), "{track:#}");
    }
    let unusable = |arguments: &[&str], words: &str| {
        let output = handeye(&[&["track", "-q", "--calibration", utf8(&result)][..], arguments].concat());
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(2), 1), "{arguments:?}: {message}");
        assert!(message.contains(words), "{arguments:?}: {message}");
    };
    unusable(&["--reach", "70"], "corners 0 to 69");
    unusable(&["--reach", "0", "--stand-off=-1"], "-1 mm is not a distance");
    unusable(&["--target", "10x7"], "is not a chessboard");
    unusable(&["--connect", "not an address"], "not an address");
    unusable(&["--json", "/no/such/folder/track.json"], "cannot be written");
    let mut without = CalibrationResult::read(&result).expect("a result");
    (without.mode, without.hand_eye, without.target) = (None, None, None);
    without.write(&result).expect("written");
    unusable(&[], "has no hand-eye transform");
}

#[test]
fn a_folder_without_a_description_is_answered_with_one_to_fill_in() {
    let folder = tempfile::tempdir().expect("a folder");
    dataset(folder.path(), "image,x,y,z,rx,ry,rz\na.png,0,0,0,0,0,0\nb.png,0,0,1.5,0,0,0\n");
    std::fs::remove_file(folder.path().join("dataset.toml")).expect("removed");
    for command in ["calibrate", "doctor"] {
        let output = handeye(&[command, utf8(folder.path())]);
        let (template, message) = (text(&output.stdout), text(&output.stderr));
        assert_eq!((output.status.code(), message.lines().count()), (Some(2), 1), "{message}");
        assert!(message.contains("has no dataset.toml") && message.contains("standard output"), "{message}");
        for line in ["poses = \"poses.csv\"", "#? rotation = \"rpy\"", "#? rotation = \"rotation_vector\""] {
            assert!(template.lines().any(|found| found.starts_with(line)), "{line} is not in\n{template}");
        }
        // Saved unchanged, it is refused: nothing in it was guessed. A shell creates the file before the command runs.
        let file = std::fs::File::create(folder.path().join("dataset.toml")).expect("created");
        let saving =
            crate::solved::command().args([command, utf8(folder.path())]).stdout(file).output().expect("it runs");
        assert_eq!(saving.status.code(), Some(2), "{}", text(&saving.stderr));
        assert_eq!(std::fs::read_to_string(folder.path().join("dataset.toml")).expect("saved"), template);
        let refused = handeye(&[command, utf8(folder.path())]);
        assert_eq!((refused.status.code(), refused.stdout.len()), (Some(2), 0), "{}", text(&refused.stderr));
        assert!(text(&refused.stderr).contains("dataset.toml, row "), "{}", text(&refused.stderr));
        std::fs::remove_file(folder.path().join("dataset.toml")).expect("removed");
    }
    let empty = tempfile::tempdir().expect("a folder");
    let output = handeye(&["calibrate", utf8(empty.path())]);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
}

fn isometry(transform: &Value) -> Isometry3<f64> {
    let numbers = |key: &str| -> Vec<f64> {
        transform[key].as_array().expect(key).iter().map(|number| number.as_f64().expect(key)).collect()
    };
    let (t, q) = (numbers("translation_m"), numbers("rotation_xyzw"));
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]));
    Isometry3::from_parts(Translation3::new(t[0], t[1], t[2]), rotation)
}

#[test]
fn poses_are_planned_for_a_recorded_session_from_which_the_whole_board_is_seen() {
    let (_home, session) = copy_of_session();
    let output = handeye(&["--quiet", "plan", utf8(&session), "--count", "3", "--json", "-"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let plan: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(plan["format"], "handeye-plan");
    let of = plan["error_of"].as_str().expect("named");
    assert!(["reach", "reach_corrected"].contains(&of), "its joints are known: {of}");
    let result: Value =
        serde_json::from_str(&std::fs::read_to_string(session.join("result.json")).expect("a result")).expect("JSON");
    let (tip_from_camera, base_from_target) =
        (isometry(&result["arm"]["hand_eye"]), isometry(&result["arm"]["target"]));
    let of_camera = |key: &str| result["intrinsics"][key].as_f64().expect(key);
    let poses = plan["poses"].as_array().expect("poses");
    assert_eq!(poses.len(), 3);
    let mut before_mm = plan["error_mm"].as_f64().expect("stated");
    for pose in poses {
        let error_mm = pose["error_mm"].as_f64().expect("expected");
        assert!(error_mm < before_mm, "{error_mm} mm is no gain over {before_mm}");
        before_mm = error_mm;
        let camera_from_target = (isometry(&pose["base_from_tip"]) * tip_from_camera).inverse() * base_from_target;
        let reported = isometry(&pose["camera_from_target"]);
        // Except for the error of this arm, which is nearly exact.
        assert!((camera_from_target.translation.vector - reported.translation.vector).norm() < 1e-3, "{pose}");
        // The outermost of the 10×7 corners; the lens of this cell has no distortion.
        for corner in [[0.0, 0.0], [0.135, 0.0], [0.0, 0.09], [0.135, 0.09]] {
            let at = camera_from_target * Point3::new(corner[0], corner[1], 0.0);
            let px = [of_camera("fx") * at.x / at.z + of_camera("cx"), of_camera("fy") * at.y / at.z + of_camera("cy")];
            assert!(at.z > 0.0 && (0.0..640.0).contains(&px[0]) && (0.0..480.0).contains(&px[1]), "{px:?}");
        }
    }
    let again = handeye(&["--quiet", "plan", utf8(&session), "--count", "3", "--json", "-"]);
    assert_eq!(again.stdout, output.stdout, "the same every time");
    let table = text(&handeye(&["--quiet", "plan", utf8(&session)]).stdout);
    assert!(table.contains("whether the way there is free is not checked"), "{table}");
}

#[test]
fn names_and_messages_of_strangers_command_no_terminal() {
    let home = tempfile::tempdir().expect("a folder");
    let evil = "set\u{1b}]0;title\u{7}\u{1b}[2J\u{9b}31m\rdone\u{202e}";
    let folder = home.path().join(evil);
    std::fs::create_dir(&folder).expect("made");
    std::fs::write(folder.join(format!("{evil}.csv")), "x,y\n1,2\n").expect("written");
    let driver = format!("python3 -c 'print(\"{evil}\")'");
    let (out, none) = (home.path().join(format!("out{evil}")), folder.join("none"));
    let commands: [&[&str]; 8] = [
        &["calibrate", utf8(&folder)],
        &["doctor", utf8(&folder)],
        &["import", utf8(&folder)],
        &["import", utf8(&folder), "--out", utf8(&out)],
        &["export", utf8(&none), "--format", "opencv_yaml", "--out", utf8(&out)],
        &["driver", "test", &driver],
        &["track", "--calibration", utf8(&folder), "--connect", evil],
        &[evil],
    ];
    for command in commands {
        let output = handeye(command);
        for reported in [text(&output.stdout), text(&output.stderr)] {
            let obeyed: Vec<char> =
                reported.chars().filter(|letter| letter.is_control() && !"\n\t".contains(*letter)).collect();
            assert!(obeyed.is_empty() && !reported.contains('\u{202e}'), "{command:?}: {reported:?}");
        }
        assert!(text(&output.stderr).contains("\\u{202e}"), "{command:?}: {:?}", text(&output.stderr));
    }
}
