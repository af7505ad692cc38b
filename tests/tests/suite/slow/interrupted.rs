//! Commands whose simulation is paused or ended in between, or whose server dies.

use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr};
use std::time::{Duration, Instant};

use handeye_capture::Wait;
use handeye_coppeliasim::cell::{Arm, CellPaths};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint, MotionLimits, SimulationState};
use handeye_record::RerunChoice;
use handeye_session::Session;
use handeye_tests::CellProcess;
use handeye_tests::process::{end_of, signal, start, until_message};
use handeye_tests::workbench::Workbench;
use handeye_workbench::model::{CaptureOptions, CapturePurpose, CaptureWait, CellSource, Model};
use handeye_workbench::{capture, connect, taught};
use serde_json::Value;
use tempfile::TempDir;

use crate::solved::copy_of_session;

/// As long as a client waits for a reply: a command that contacts a dead server again takes this long, and one that does
/// not takes two seconds at most.
const A_REPLY: Duration = Duration::from_secs(5);

/// How it ends, and its last output.
fn end(mut child: Child, mut reported: BufReader<ChildStderr>) -> (Option<i32>, String) {
    let mut rest = String::new();
    reported.read_to_string(&mut rest).expect("text");
    (end_of(&mut child).code(), rest)
}

/// Kills the cell of a command, which has to end soon; returns its last output.
fn end_after(cell: &mut CellProcess, child: Child, reported: BufReader<ChildStderr>) -> String {
    cell.kill();
    let killed = Instant::now();
    let (code, rest) = end(child, reported);
    let took = killed.elapsed();
    println!("ended {took:?} after its server");
    assert_eq!(code, Some(1), "{rest}");
    assert!(took < A_REPLY, "{took:?}: {rest}");
    rest
}

/// A cell, and the folder of the session that `auto` takes on it.
struct Auto {
    cell: CellProcess,
    folder: TempDir,
}

impl Auto {
    fn on_a_cell() -> Self {
        Self { cell: CellProcess::start(&["--fast"]), folder: tempfile::tempdir().expect("a folder") }
    }

    fn start(&self, more: &[&str]) -> (Child, BufReader<ChildStderr>) {
        let address = format!("tcp://127.0.0.1:{}", self.cell.port());
        let out = self.out().display().to_string();
        start(&[&["auto", "--rerun", "off", "--connect", &address, "--out", &out], more].concat())
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("session")
    }

    fn captures(&self) -> usize {
        Session::open(&self.out()).expect("a session").document.captures.len()
    }
}

/// A user at the simulator.
fn person(cell: &CellProcess) -> Arm {
    let options = ConnectionOptions::default();
    Arm::connect(&Endpoint::local(cell.port()), &options, &CellPaths::default()).expect("it answers")
}

#[test]
fn auto_waits_out_a_pause_and_leaves_a_simulation_running_that_it_did_not_start() {
    let auto = Auto::on_a_cell();
    let mut person = person(&auto.cell);
    person.sim().start_simulation().expect("an answer");
    let (child, mut reported) = auto.start(&[]);
    until_message(&mut reported, "pose 2 of 10 captured");
    person.sim().pause_simulation().expect("an answer");
    until_message(&mut reported, "the simulation is paused");
    person.sim().start_simulation().expect("an answer");
    let (code, rest) = end(child, reported);
    assert_eq!(code, Some(0), "{rest}");
    assert_eq!(auto.captures(), 10, "{rest}");
    assert_eq!(person.sim().get_simulation_state(), Ok(SimulationState::Running));
}

/// Waits until the arm has moved and is then at rest for this many passes.
fn until_it_stands(person: &mut Arm, passes: u32) {
    let start = person.joint_values().expect("an answer");
    while person.joint_values().expect("an answer") == start {}
    let mut joints = start;
    let (mut time_s, mut seen) = (f64::NAN, 0);
    while seen < passes {
        let (now, now_s) =
            (person.joint_values().expect("an answer"), person.sim().get_simulation_time().expect("an answer"));
        seen = if now == joints { seen + u32::from(now_s != time_s) } else { 0 };
        (joints, time_s) = (now, now_s);
    }
}

#[test]
fn auto_takes_a_capture_again_whose_images_a_pause_broke_off() {
    let auto = Auto::on_a_cell();
    let mut person = person(&auto.cell);
    // With this many images to average the arm is at a pose longer than it moves towards it.
    let (child, mut reported) = auto.start(&["--frames", "64"]);
    until_message(&mut reported, "pose 1 of 10 captured");
    until_it_stands(&mut person, 20);
    person.sim().pause_simulation().expect("an answer");
    until_message(&mut reported, "the simulation is paused");
    person.sim().start_simulation().expect("an answer");
    let (code, rest) = end(child, reported);
    assert_eq!(code, Some(0), "{rest}");
    assert_eq!(auto.captures(), 10, "{rest}");
}

#[test]
fn a_sequence_of_the_window_goes_on_after_a_pause_with_the_pose_that_has_no_capture() {
    let folder = tempfile::tempdir().expect("a folder");
    let cell = CellProcess::start(&["--fast"]);
    let mut person = person(&cell);
    let source = CellSource::Address(format!("tcp://127.0.0.1:{}", cell.port()));
    let mut bench = Workbench::start_recording(source, folder.path(), None, RerunChoice::Off);
    bench.until("a cell", |model| {
        let connected = model.control.is_connected() && model.camera.is_connected() && model.mover.is_connected();
        connected && model.frame.is_some() && model.cell.is_some() && model.robot.is_some()
    });
    bench.click(connect::Command::StartSimulation);
    bench.until("passing time", |model| model.resting_simulation().is_none());
    // Enough that the pause comes between two of them, however busy the machine is.
    bench.click(capture::Command::SetOptions(CaptureOptions { frames: 32, ..CaptureOptions::default() }));
    bench.until("the reference poses", |model| model.taught().len() == 10);
    bench.allow(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
    let averages = |model: &Model| {
        let wait = model.capture.as_ref().map(|capture| capture.wait);
        matches!(wait, Some(CaptureWait::Images(Wait::Averaging { .. })))
    };
    bench.until("the images of the second pose", |model| model.document().captures.len() == 1 && averages(model));
    person.sim().pause_simulation().expect("an answer");
    bench.until("the end of the sequence", |model| !model.sequence_runs);
    assert_eq!(bench.model().document().captures.len(), 1, "{}", bench.text());

    bench.click(connect::Command::StartSimulation);
    bench.until("passing time", |model| model.resting_simulation().is_none());
    bench.click(capture::Command::SetOptions(CaptureOptions::default()));
    bench.click(taught::Command::ContinueSequence);
    // The arm is at the second pose, or was stopped before it: the first move is to the third, or to the second.
    bench.until("the first move that waits", |model| model.asked.is_some());
    bench.click(taught::Command::ConfirmMove);
    bench.until("the end of the sequence", |model| !model.sequence_runs);
    assert_eq!(bench.model().document().captures.len(), 10, "{}", bench.text());
}

/// Moves the arm to where it saw the board, with room to follow it.
fn before_the_board(person: &mut Arm, session: &Path) {
    person.sim().start_simulation().expect("an answer");
    let session = Session::open(session).expect("a session");
    let joints = session.document.captures[6].joints_rad.as_deref().expect("joints");
    let limits = MotionLimits::uniform(6, 1.0, 2.0, 20.0);
    person.move_to_joints(joints, &limits, &CancelToken::default()).expect("it gets there");
}

#[test]
fn following_that_loses_its_board_fails_and_says_why_and_what_was_asked_for_is_no_failure() {
    let (folder, session) = copy_of_session();
    let cell = CellProcess::start(&[]);
    let mut person = person(&cell);
    before_the_board(&mut person, &session);
    let address = format!("tcp://127.0.0.1:{}", cell.port());
    let file = folder.path().join("track.json");
    let (session, json) = (session.display().to_string(), file.display().to_string());
    let follow = ["track", "--follow", "--connect", &address, "--calibration", &session, "--json", &json];
    let summary = || -> Value {
        let track: Value = serde_json::from_slice(&std::fs::read(&file).expect("written")).expect("JSON");
        track["summary"].clone()
    };

    let (child, reported) = start(&[&follow[..], &["--frames", "20"]].concat());
    let (code, rest) = end(child, reported);
    assert_eq!(code, Some(0), "{rest}");
    assert!(summary()["error"].is_null() && summary()["follow_ended"].is_null(), "{:#}", summary());

    let (child, mut reported) = start(&follow);
    until_message(&mut reported, "images/s");
    signal(&child, "INT");
    let (code, rest) = end(child, reported);
    assert_eq!(code, Some(0), "{rest}");
    assert!(summary()["follow_ended"].is_null(), "{:#}", summary());

    let (child, mut reported) = start(&follow);
    until_message(&mut reported, "images/s");
    person.show_board(false).expect("an answer");
    let (code, rest) = end(child, reported);
    assert_eq!(code, Some(1), "{rest}");
    assert!(rest.trim_end().lines().last().is_some_and(|last| last.contains("following ended by itself")), "{rest}");
    for key in ["error", "follow_ended"] {
        assert!(summary()[key].as_str().is_some_and(|why| !why.is_empty()), "{:#}", summary());
    }
}

#[test]
fn a_simulation_that_is_ended_is_named_and_nobody_else_is_blamed() {
    let auto = Auto::on_a_cell();
    let mut person = person(&auto.cell);
    let (child, mut reported) = auto.start(&[]);
    until_message(&mut reported, "pose 2 of 10 captured");
    person.sim().stop_simulation().expect("an answer");
    let (code, rest) = end(child, reported);
    assert_eq!(code, Some(1), "{rest}");
    assert!(rest.contains("simulation is stopped") && !rest.contains("another client"), "{rest}");
    assert!(rest.contains("kept in"), "{rest}");
}

#[test]
fn auto_ends_soon_after_its_server_and_keeps_what_it_captured() {
    let mut auto = Auto::on_a_cell();
    let (child, mut reported) = auto.start(&[]);
    until_message(&mut reported, "pose 2 of 10 captured");
    let rest = end_after(&mut auto.cell, child, reported);
    assert!(rest.contains("kept in"), "{rest}");
    assert!(auto.captures() >= 2, "{rest}");
}

#[test]
fn a_track_says_what_it_waits_for_and_its_json_is_whole_when_the_server_dies() {
    let (folder, session) = copy_of_session();
    let session = session.display().to_string();
    let mut cell = CellProcess::start(&[]);
    let mut person = person(&cell);
    let address = format!("tcp://127.0.0.1:{}", cell.port());
    let file = folder.path().join("track.json");
    let json = file.display().to_string();
    let (child, mut reported) = start(&["track", "--connect", &address, "--calibration", &session, "--json", &json]);
    until_message(&mut reported, "the simulation is stopped: waiting until it is started");
    person.sim().start_simulation().expect("an answer");
    until_message(&mut reported, "images/s");
    person.sim().pause_simulation().expect("an answer");
    until_message(&mut reported, "the simulation is paused: waiting until it is continued");
    person.sim().start_simulation().expect("an answer");
    until_message(&mut reported, "the simulation goes on");
    end_after(&mut cell, child, reported);
    let track: Value = serde_json::from_slice(&std::fs::read(file).expect("written")).expect("JSON");
    assert!(track["summary"]["error"].as_str().is_some_and(|why| why.contains("closed the connection")), "{track:#}");
    let frames = track["frames"].as_array().map(Vec::len);
    assert_eq!(track["summary"]["frames"].as_u64(), frames.map(|count| count as u64));
    assert!(frames > Some(0));
}
