//! The contract of the command line: exit codes, streams, one-line errors.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use handeye_tests::handeye_binary;

fn handeye(arguments: &[&str]) -> Output {
    Command::new(handeye_binary()).args(arguments).output().expect("the binary is built: cargo build -p handeye_app")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

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

#[test]
fn every_subcommand_has_help_with_an_example() {
    for command in ["gui", "cell", "auto", "calibrate", "export", "target"] {
        let output = handeye(&[command, "--help"]);
        assert_eq!(output.status.code(), Some(0));
        assert!(text(&output.stdout).contains("Example:\n  handeye "), "{command}");
        assert!(text(&output.stdout).contains("--quiet"), "{command}");
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
    let folder = tempfile::tempdir().expect("a folder");
    dataset(folder.path(), "image,x,y,z,rx,ry,rz\na.png,0,0,0,0,0,0\na.png,0,0,nan,0,0,0\n");
    let path = folder.path().to_str().expect("UTF-8");
    for arguments in [
        &["calibrate", "/no/such/folder"][..],
        &["calibrate", path],
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
