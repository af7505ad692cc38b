//! The end of the workbench, by a signal or by closing it, in the middle of its work.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::{Arm, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint};
use handeye_result::CalibrationResult;
use handeye_session::Store;
use handeye_tests::CellProcess;
use handeye_tests::desktop::{self, Desktop};
use handeye_tests::workbench::Workbench;
use handeye_workbench::command::Command;
use handeye_workbench::model::{CellSource, Model, SolveStatus};
use handeye_workbench::{export, solve};

/// The workbench gives itself 2 s to end. The rest is for a busy machine; a workbench that waits for an answer, a motion or
/// a file takes longer.
const LIMIT: Duration = Duration::from_secs(6);
/// Longer than anything that is waited for takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(4);

/// Another client of a cell.
struct Witness(Arm);

impl Witness {
    fn of(cell: &CellProcess) -> Self {
        let options = ConnectionOptions { heartbeat: None, ..ConnectionOptions::default() };
        Self(Arm::connect(&Endpoint::local(cell.port()), &options, &CellPaths::default()).expect("the cell is there"))
    }

    fn time_s(&mut self) -> f64 {
        self.0.sim().get_simulation_time().expect("the cell answers")
    }

    fn joints(&mut self) -> JointValues {
        self.0.joint_values().expect("the cell answers")
    }

    fn until_moving(&mut self) {
        let (at, deadline) = (self.joints(), Instant::now() + PATIENCE);
        while self.joints() == at {
            assert!(Instant::now() < deadline, "the arm does not move");
        }
    }

    fn wait_s(&mut self, seconds: f64) {
        let (until_s, deadline) = (self.time_s() + seconds, Instant::now() + PATIENCE);
        while self.time_s() < until_s {
            assert!(Instant::now() < deadline, "simulated time stands still");
        }
    }
}

/// The one session under the home folder of a desktop.
fn session_of(desktop: &Desktop) -> PathBuf {
    let mut sessions = std::fs::read_dir(desktop.home().join("handeye-sessions")).expect("the sessions").flatten();
    sessions.next().expect("a session").path()
}

/// Files under a folder, in any depth.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

fn a_sequence_ended_by(signal: &str) {
    let mut cell = CellProcess::start(&[]);
    let mut witness = Witness::of(&cell);
    witness.0.sim().start_simulation().expect("it starts");
    let shots = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("leaving");
    let address = format!("tcp://127.0.0.1:{}", cell.port());
    let mut desktop = Desktop::start((1440, 900), &shots, &["--connect", &address], &[]);
    desktop.until_seen("Board in view");
    desktop.click("Run the 10 taught poses");
    // Behind an address the arm may be real.
    desktop.until_seen("Move there");
    desktop.click("Move there");
    desktop.until_seen("Use capture 2");
    witness.until_moving();

    let (status, took) = desktop.end_by(signal);
    println!("SIG{signal} in a sequence: {status} after {took:.2?}");
    assert!(status.success(), "it ends as closing the window does: {status}");
    assert!(took < LIMIT, "{took:?}");

    // The last target that was sent takes effect in the following pass.
    witness.wait_s(0.2);
    let at_rest = witness.joints();
    witness.wait_s(1.0);
    assert_eq!(witness.joints(), at_rest, "the arm moves on without the workbench");

    let folder = session_of(&desktop);
    let session = Store::open(&folder).expect("whole, and open nowhere else");
    let captures = &session.document().captures;
    assert!(captures.len() >= 2, "what was said to be kept: {captures:?}");
    for capture in captures {
        let image = image::open(folder.join(&capture.image)).expect("its image");
        assert_eq!((image.width(), image.height()), (640, 480));
    }
    // The next start offers it among the recent sessions.
    let remembered = desktop.home().join("data/handeye-workbench/app.ron");
    let remembered = std::fs::read_to_string(remembered).expect("what the window remembers");
    assert!(remembered.contains(&folder.display().to_string()), "{remembered}");
    // The recording is completed, too.
    assert!(folder.join("recording.rrd").metadata().is_ok_and(|file| file.len() > 0));
    cell.kill();
}

#[test]
fn a_signal_in_a_sequence_ends_the_window_as_closing_it_does() {
    if !desktop::is_possible() {
        return;
    }
    for signal in ["TERM", "HUP", "INT"] {
        a_sequence_ended_by(signal);
    }
}

fn idle_and_fresh(model: &Model) -> bool {
    model.solve.status == SolveStatus::Idle && model.solve.fresh
}

#[test]
fn closing_in_the_middle_of_a_solve_or_an_export_takes_no_longer_and_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let session = folder.path().join("captured");
    let made = std::process::Command::new(handeye_tests::handeye_binary())
        .args(["auto", "--quiet", "--rerun", "off", "--out"])
        .arg(&session)
        .output()
        .expect("handeye runs");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let captures = Store::open(&session).expect("a session").document().captures.clone();
    for under_way in [Command::Solve(solve::Command::Solve), Command::Export(export::Command::Export)] {
        let address = CellSource::Address("tcp://127.0.0.1:1".to_owned());
        let mut bench = Workbench::start(address, folder.path(), Some(session.clone()));
        bench.until("a solution", |model| model.session.folder.is_some() && idle_and_fresh(model));
        bench.click(under_way.clone());
        let began = Instant::now();
        drop(bench);
        let took = began.elapsed();
        println!("closed in the middle of {under_way:?}: {took:.2?}");
        assert!(took < LIMIT, "{under_way:?}: {took:?}");
        let kept = Store::open(&session).expect("whole, and open nowhere else");
        assert_eq!(kept.document().captures, captures);
        CalibrationResult::read(&session.join("result.json")).expect("the result of before, or the new one");
    }
    let exports = files(&session.join("exports"));
    assert!(!exports.is_empty());
    for file in exports {
        assert!(file.metadata().is_ok_and(|file| file.len() > 0), "{} is whole", file.display());
        assert!(!file.to_string_lossy().ends_with(".partial"), "{}", file.display());
    }
}
