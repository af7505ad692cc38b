//! `handeye auto` on a computer that falls asleep.

use std::io::{BufReader, Read as _};
use std::path::Path;
use std::process::{Child, ChildStderr};
use std::time::{Duration, Instant};

use handeye_cell::scene::Scene;
use handeye_coppeliasim::ConnectionOptions;
use handeye_coppeliasim::cell::{Arm, CellPaths};
use handeye_result::CalibrationResult;
use handeye_server::{CellConfig, CellServer};
use handeye_session::Session;
use handeye_tests::process::{end_of, put_to_sleep, signal, start, until_message};

/// Longer than anything that is waited for takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(4);

fn auto(out: &Path, arguments: &[&str]) -> (Child, BufReader<ChildStderr>) {
    let out = out.display().to_string();
    start(&[&["auto", "--rerun", "off", "--out", &out], arguments].concat())
}

fn check(mut child: Child, mut reported: BufReader<ChildStderr>, out: &Path) -> String {
    let mut rest = String::new();
    reported.read_to_string(&mut rest).expect("text");
    assert!(end_of(&mut child).success(), "{rest}");
    let session = Session::open(out).expect("a session");
    assert_eq!(session.document.captures.len(), 10, "{rest}");
    let result = CalibrationResult::read(&out.join("result.json")).expect("a result");
    let error_mm = result.truth.and_then(|truth| truth.translation_error_mm).expect("the cell publishes its truth");
    assert!(error_mm < 0.5, "{error_mm} mm");
    rest
}

#[test]
fn a_sequence_goes_on_when_the_cell_has_forgotten_the_sleeper() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("session");
    let scene = Scene::reference().expect("a scene");
    // Pings are answered by the library's thread, which is never busy for that long.
    let silence = Duration::from_millis(900);
    let cell = CellServer::start(CellConfig { real_time: Some(false), silence, ..CellConfig::new(scene) });
    let endpoint = cell.as_ref().expect("a cell").endpoint();
    let options = ConnectionOptions { heartbeat: None, ..ConnectionOptions::default() };
    let mut witness =
        Arm::connect(&endpoint.parse().expect("an address"), &options, &CellPaths::default()).expect("it answers");

    let (child, mut reported) = auto(&out, &["--connect", &endpoint]);
    until_message(&mut reported, "pose 2 of 10 captured");
    let (at, deadline) = (witness.joint_values().expect("an answer"), Instant::now() + PATIENCE);
    while witness.joint_values().expect("an answer") == at {
        assert!(Instant::now() < deadline, "the arm does not move");
    }
    put_to_sleep(&child);
    // Time is paused while the client is waited for, until the server drops it and lets time pass again.
    let stood_s = witness.sim().get_simulation_time().expect("an answer");
    while witness.sim().get_simulation_time().expect("an answer") < stood_s + 1.0 {
        assert!(Instant::now() < deadline, "the sleeper is waited for without end");
    }
    signal(&child, "CONT");
    let rest = check(child, reported, &out);
    assert!(rest.contains("asleep"), "it says what happened: {rest}");
}

#[test]
fn a_sequence_goes_on_when_the_cell_in_the_same_program_slept_as_well() {
    /// Longer than a client waits for an answer.
    const NAP: Duration = Duration::from_secs(6);
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("session");
    let (child, mut reported) = auto(&out, &[]);
    until_message(&mut reported, "pose 2 of 10 captured");
    put_to_sleep(&child);
    // Only time itself has to pass.
    std::thread::sleep(NAP);
    signal(&child, "CONT");
    check(child, reported, &out);
}
