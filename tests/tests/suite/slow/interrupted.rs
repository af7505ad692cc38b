//! Commands whose simulation is paused or ended meanwhile, or whose server dies.

use std::io::{BufReader, Read as _};
use std::process::{Child, ChildStderr};
use std::time::{Duration, Instant};

use handeye_core::project::session::Session;
use handeye_sim_link::client::cell::{Arm, CellPaths};
use handeye_sim_link::client::{ConnectionOptions, Endpoint, SimulationState};
use handeye_tests::CellProcess;
use handeye_tests::process::{end_of, start, until_said};
use serde_json::Value;

use crate::solved::copy_of_session;

/// As long as a client waits for a reply: a command that asks a dead server again takes that, and one that does not takes
/// two seconds at most.
const A_REPLY: Duration = Duration::from_secs(5);

/// How it ends, and what it still says.
fn end(mut child: Child, mut said: BufReader<ChildStderr>) -> (Option<i32>, String) {
    let mut rest = String::new();
    said.read_to_string(&mut rest).expect("text");
    (end_of(&mut child).code(), rest)
}

/// Kills the cell of a command, which has to end soon; what it still says.
fn end_after(cell: &mut CellProcess, child: Child, said: BufReader<ChildStderr>) -> String {
    cell.kill();
    let killed = Instant::now();
    let (code, rest) = end(child, said);
    let took = killed.elapsed();
    println!("ended {took:?} after its server");
    assert_eq!(code, Some(1), "{rest}");
    assert!(took < A_REPLY, "{took:?}: {rest}");
    rest
}

/// A person at the simulator.
fn person(cell: &CellProcess) -> Arm {
    let options = ConnectionOptions::default();
    Arm::connect(&Endpoint::local(cell.port()), &options, &CellPaths::default()).expect("it answers")
}

#[test]
fn auto_waits_out_a_pause_and_leaves_a_simulation_running_that_it_did_not_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("session");
    let cell = CellProcess::start(&["--fast"]);
    let mut person = person(&cell);
    person.sim().start_simulation().expect("an answer");
    let address = format!("tcp://127.0.0.1:{}", cell.port());
    let (child, mut said) =
        start(&["auto", "--rerun", "off", "--connect", &address, "--out", &out.display().to_string()]);
    until_said(&mut said, "pose 2 of 10 captured");
    person.sim().pause_simulation().expect("an answer");
    until_said(&mut said, "the simulation is paused");
    person.sim().start_simulation().expect("an answer");
    let (code, rest) = end(child, said);
    assert_eq!(code, Some(0), "{rest}");
    assert_eq!(Session::open(&out).expect("a session").document.captures.len(), 10, "{rest}");
    assert_eq!(person.sim().get_simulation_state(), Ok(SimulationState::Running));
}

#[test]
fn a_simulation_that_is_ended_is_named_and_nobody_else_is_blamed() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("session");
    let cell = CellProcess::start(&["--fast"]);
    let mut person = person(&cell);
    let address = format!("tcp://127.0.0.1:{}", cell.port());
    let (child, mut said) =
        start(&["auto", "--rerun", "off", "--connect", &address, "--out", &out.display().to_string()]);
    until_said(&mut said, "pose 2 of 10 captured");
    person.sim().stop_simulation().expect("an answer");
    let (code, rest) = end(child, said);
    assert_eq!(code, Some(1), "{rest}");
    assert!(rest.contains("the simulation is stopped") && !rest.contains("another client"), "{rest}");
    assert!(rest.contains("captures are kept in"), "{rest}");
}

#[test]
fn auto_ends_soon_after_its_server_and_keeps_what_it_captured() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("session");
    let mut cell = CellProcess::start(&["--fast"]);
    let address = format!("tcp://127.0.0.1:{}", cell.port());
    let (child, mut said) =
        start(&["auto", "--rerun", "off", "--connect", &address, "--out", &out.display().to_string()]);
    until_said(&mut said, "pose 2 of 10 captured");
    let rest = end_after(&mut cell, child, said);
    assert!(rest.contains("captures are kept in"), "{rest}");
    assert!(Session::open(&out).expect("a session").document.captures.len() >= 2, "{rest}");
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
    let (child, mut said) = start(&["track", "--connect", &address, "--calibration", &session, "--json", &json]);
    until_said(&mut said, "the simulation is stopped: waiting until it is started");
    person.sim().start_simulation().expect("an answer");
    until_said(&mut said, "images/s");
    person.sim().pause_simulation().expect("an answer");
    until_said(&mut said, "the simulation is paused: waiting until it is continued");
    person.sim().start_simulation().expect("an answer");
    until_said(&mut said, "the simulation goes on");
    end_after(&mut cell, child, said);
    let track: Value = serde_json::from_slice(&std::fs::read(file).expect("written")).expect("JSON");
    assert!(track["summary"]["error"].as_str().is_some_and(|why| why.contains("went away")), "{track:#}");
    let frames = track["frames"].as_array().map(Vec::len);
    assert_eq!(track["summary"]["frames"].as_u64(), frames.map(|count| count as u64));
    assert!(frames > Some(0));
}
