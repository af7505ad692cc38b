//! The recorded sample that comes with the program: how it is created, and that its answer is right.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use handeye_coppeliasim::cell::{CellClient, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint};
use handeye_estimate::handeye::HandEye;
use handeye_geometry::se3;
use handeye_result::{CalibrationResult, TransformEstimate};
use handeye_tests::workbench::Workbench;
use handeye_tests::{CellProcess, workspace_root};
use handeye_workbench::model::{CellSource, Solved};
use handeye_workbench::session;
use image::codecs::jpeg::JpegEncoder;

use crate::solved::{handeye, text, utf8};

/// The cell that was photographed.
const SCENE: &str = "realistic";
const POSES: &str = "assets/poses/realistic20.toml";
const SEED: &str = "35";
/// Number of its poses.
const VIEWS: usize = 12;
const QUALITY: u8 = 95;

const DESCRIPTION: &str = "\
# Twelve photographs of a chessboard by a camera on the hand of a UR5, and where the hand was.
mode = \"eye_in_hand\"

[target]
kind = \"chessboard\"
columns = 10                      # inner corners
rows = 7
square_m = 0.015

[robot]
poses = \"poses.csv\"
length_unit = \"m\"
rotation = \"quaternion_xyzw\"
pose = \"base_from_tip\"
";

fn sample() -> PathBuf {
    workspace_root().join("assets/samples/ur5")
}

/// Not a test: photographs the cell again, if the sample has to change. `cargo test -p handeye_tests -- --ignored
/// photograph_the_sample`
#[test]
#[ignore = "writes assets/samples/ur5"]
fn photograph_the_sample() {
    let home = tempfile::tempdir().expect("a folder");
    let session = home.path().join("session");
    let poses = workspace_root().join(POSES);
    let auto = ["auto", "--scene", SCENE, "--poses", utf8(&poses), "--seed", SEED, "--out", utf8(&session)];
    let output = handeye(&auto);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let folder = sample();
    if folder.exists() {
        fs::remove_dir_all(&folder).expect("the earlier one goes");
    }
    fs::create_dir_all(folder.join("images")).expect("made");
    let recorded = fs::read_to_string(session.join("poses.csv")).expect("a table");
    let mut table = String::from("image,x,y,z,qx,qy,qz,qw\n");
    for (view, row) in (1..=VIEWS).zip(recorded.lines().skip(1)) {
        let cells: Vec<&str> = row.split(',').collect();
        let image = image::open(session.join(cells[0])).expect("an image").into_rgb8();
        let name = format!("images/{view:02}.jpg");
        let file = fs::File::create(folder.join(&name)).expect("made");
        JpegEncoder::new_with_quality(file, QUALITY).encode_image(&image).expect("encoded");
        write!(table, "{name}").expect("a string takes any text");
        for number in &cells[1..8] {
            let number: f64 = number.parse().expect("a number");
            write!(table, ",{number:.9}").expect("a string takes any text");
        }
        table.push('\n');
    }
    fs::write(folder.join("poses.csv"), table).expect("written");
    fs::write(folder.join("dataset.toml"), DESCRIPTION).expect("written");
}

/// Compares an answer with what the cell publishes about its camera and its board.
fn assert_true(result: &CalibrationResult) {
    let cell = CellProcess::start(&["--scene", SCENE, "--seed", SEED]);
    let endpoint: Endpoint = format!("tcp://127.0.0.1:{}", cell.port()).parse().expect("an address");
    let mut client =
        CellClient::connect(&endpoint, &ConnectionOptions::own_cell(), &CellPaths::default()).expect("connected");
    let truth = client.camera().ground_truth().expect("published");
    let board = truth.base_from_target.expect("published");
    let links = result.links().expect("an answer");
    let HandEye::EyeInHand { tip_from_camera, base_from_target } = links else { panic!("{links:?}") };
    for (link, found, truth) in [
        (result.hand_eye.as_ref(), tip_from_camera.isometry(), truth.tip_from_camera.isometry()),
        (result.target.as_ref(), base_from_target.isometry(), board.isometry()),
    ] {
        let covariance = link.and_then(TransformEstimate::covariance_matrix).expect("stated");
        let off = se3::log(&(found.inverse() * truth));
        let weighed = covariance.cholesky().expect("positive definite").solve(&off);
        // 99.9 % of six numbers with a correctly stated spread are below it.
        assert!(off.dot(&weighed) < 22.46, "{:.1} by {off:?}", off.dot(&weighed));
        // And it is a useful answer.
        assert!(off.fixed_rows::<3>(0).norm() < 0.3e-3, "{off:?}");
    }
    assert!(result.quality.tip_error_95_mm.is_some_and(|error| error < 0.3), "{:?}", result.quality);
    assert_eq!(result.problem(), None);
}

#[test]
fn the_answer_to_the_sample_is_the_truth_within_what_is_stated_of_it() {
    let home = tempfile::tempdir().expect("a folder");
    let folder = home.path().join("my_robot_images");
    let written = handeye(&["sample", "--out", utf8(&folder)]);
    assert_eq!(written.status.code(), Some(0), "{}", text(&written.stderr));
    let output = handeye(&["calibrate", utf8(&folder), "--json", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_true(&CalibrationResult::from_json(&text(&output.stdout)).expect("a result"));
}

#[test]
fn the_sample_is_opened_as_a_session_of_its_own_and_solved() {
    let home = tempfile::tempdir().expect("a folder");
    let sessions = home.path().join("sessions");
    let nothing = CellSource::Address("tcp://127.0.0.1:1".to_owned());
    let mut bench = Workbench::start(nothing, &sessions, None);
    for name in ["sample", "sample-2"] {
        bench.click(session::Command::OpenSample);
        bench.until("its answer", |model| {
            model.session.name().as_deref() == Some(name) && model.solve.fresh && model.solve.current().is_some()
        });
        assert_eq!(bench.model().document().captures.len(), VIEWS);
        assert!(bench.model().session.folder.as_ref().is_some_and(|folder| folder.starts_with(&sessions)));
        assert_true(&bench.model().solve.current().expect("solved").result);
    }
}

/// Stated on the command line, in the data set and in the window it has the same effect.
#[test]
fn the_accuracy_of_the_robot_says_how_near_a_tool_arrives() {
    let calibrated = |folder: &Path, options: &[&str]| {
        let output = handeye(&[&["calibrate", utf8(folder), "--json", "-"], options].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        CalibrationResult::from_json(&text(&output.stdout)).expect("a result").quality
    };
    let unknown = calibrated(&sample(), &[]);
    assert_eq!((unknown.reach_error_95_mm, unknown.robot_accuracy_mm), (None, None));
    let said = calibrated(&sample(), &["--robot-accuracy", "0.5"]);
    assert_eq!(said.robot_accuracy_mm, Some(0.5));
    assert_eq!(said.tip_error_95_mm, unknown.tip_error_95_mm, "the camera's part alone");
    let reach_mm = said.reach_error_95_mm.expect("it follows from the accuracy");
    assert!((0.5..5.0).contains(&reach_mm), "{reach_mm} mm");
    assert_eq!(said.reach_error_corrected_95_mm, None, "no errors are known to correct");
    let longer = calibrated(&sample(), &["--robot-accuracy", "0.5", "--tool", "0,0,0.3"]);
    assert!(longer.reach_error_95_mm > Some(reach_mm), "{longer:?}");

    let home = tempfile::tempdir().expect("a folder");
    let folder = home.path().join("my_robot_images");
    let written = handeye(&["sample", "--out", utf8(&folder)]);
    assert_eq!(written.status.code(), Some(0), "{}", text(&written.stderr));
    let description = fs::read_to_string(folder.join("dataset.toml")).expect("written");
    fs::write(folder.join("dataset.toml"), description.replace("[robot]", "[robot]\naccuracy_mm = 0.5"))
        .expect("written");
    assert_eq!(calibrated(&folder, &[]), said);
    assert_eq!(calibrated(&sample(), &["--robot-accuracy", "0.03"]).robot_accuracy_mm, Some(0.03), "as it was stated");

    let nothing = CellSource::Address("tcp://127.0.0.1:1".to_owned());
    let mut bench = Workbench::start(nothing, &home.path().join("sessions"), None);
    bench.click(session::Command::OpenSample);
    let solved = |bench: &mut Workbench, accuracy_mm| {
        bench.until("an answer with this accuracy", |model| {
            let is_there = |solved: &Arc<Solved>| solved.result.quality.robot_accuracy_mm == accuracy_mm;
            model.solve.fresh && model.solve.current().is_some_and(is_there)
        });
        bench.model().solve.current().expect("solved").result.quality
    };
    assert_eq!(solved(&mut bench, None).reach_error_95_mm, None);
    bench.click(session::Command::SetRobotAccuracy(Some(0.5)));
    let shown_mm = solved(&mut bench, Some(0.5)).reach_error_95_mm.expect("as on the command line");
    assert!((shown_mm - reach_mm).abs() < 1e-9, "{shown_mm} mm, {reach_mm} mm");
    let folder = bench.model().session.folder.clone().expect("a session");
    assert_eq!(calibrated(&folder, &[]).robot_accuracy_mm, Some(0.5), "it is kept");
    bench.click(session::Command::Undo);
    assert_eq!(solved(&mut bench, None).reach_error_95_mm, None);
}

/// A small recording, because every user downloads it.
#[test]
fn the_sample_is_small() {
    fn bytes(folder: &Path) -> u64 {
        let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
        entries.map(|path| if path.is_dir() { bytes(&path) } else { path.metadata().expect("a file").len() }).sum()
    }
    assert!(bytes(&sample()) < 1_500_000, "{} bytes", bytes(&sample()));
}
