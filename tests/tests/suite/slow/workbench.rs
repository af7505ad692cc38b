//! A whole calibration controlled by clicks, on the built-in cell over its real socket.

use std::path::Path;

use handeye_cell::scene::Scene;
use handeye_result::CalibrationResult;
use handeye_server::{CellConfig, CellServer};
use handeye_session::{CaptureId, Role};
use handeye_tests::hurry;
use handeye_tests::workbench::Workbench;
use handeye_workbench::model::{CapturePurpose, CellSource, Message, Model, SolveStatus};
use handeye_workbench::text::Language;
use handeye_workbench::{capture, connect, export, motion, session, taught};

fn connected(model: &Model) -> bool {
    model.control.is_connected()
        && model.camera.is_connected()
        && model.mover.is_connected()
        && model.frame.is_some()
        && model.cell.is_some()
        && model.robot.is_some()
}

fn idle_and_fresh(model: &Model) -> bool {
    model.solve.status == SolveStatus::Idle && model.solve.fresh
}

/// A paced cell, with the ten reference poses captured and solved. Returned with the cell, which has only what
/// CoppeliaSim has, so that a session there works the same way.
fn sequence_done(sessions: &Path) -> (Workbench, CellServer) {
    let mut scene = Scene::reference().expect("the scene");
    hurry(&mut scene);
    let config = CellConfig { real_time: Some(true), coppeliasim_only: true, ..CellConfig::new(scene) };
    let cell = CellServer::start(config).expect("a cell");
    let mut bench = Workbench::start(CellSource::Address(cell.endpoint()), sessions, None);
    bench.until("a cell", connected);
    bench.click(connect::Command::StartSimulation);
    bench.until("passing time", |model| model.resting_simulation().is_none());
    bench.until("the reference poses", |model| model.taught().len() == 10);
    bench.allow(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
    bench.until("the end of the sequence", |model| !model.sequence_runs);
    bench.until("a solution", idle_and_fresh);
    assert_eq!(bench.model().document().captures.len(), 10, "{}", bench.text());
    (bench, cell)
}

/// A session with the ten reference poses captured, as made by the command line in seconds, opened and solved.
fn captured(folder: &Path) -> Workbench {
    let session = folder.join("captured");
    let made = std::process::Command::new(handeye_tests::handeye_binary())
        .args(["auto", "--quiet", "--rerun", "off", "--out"])
        .arg(&session)
        .output()
        .expect("handeye runs");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let address = CellSource::Address("tcp://127.0.0.1:1".to_owned());
    let mut bench = Workbench::start(address, folder, Some(session));
    bench.until("a solution", |model| model.session.folder.is_some() && idle_and_fresh(model));
    assert_eq!(bench.model().document().captures.len(), 10, "{}", bench.text());
    bench
}

fn result_beside(session: &Path) -> CalibrationResult {
    CalibrationResult::read(&session.join("result.json")).expect("a result beside the session")
}

fn by_command_line(session: &Path) -> CalibrationResult {
    let folder = tempfile::tempdir().expect("a folder");
    let result = folder.path().join("result.json");
    let status = std::process::Command::new(handeye_tests::handeye_binary())
        .args(["calibrate", "--quiet"])
        .arg(session)
        .arg("--json")
        .arg(&result)
        .stdout(std::process::Stdio::null())
        .status()
        .expect("handeye runs");
    assert!(status.success());
    CalibrationResult::read(&result).expect("a result")
}

#[test]
fn ten_poses_are_visited_captured_solved_verified_and_exported() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = sequence_done(folder.path());
    let model = bench.model();
    let solved = model.solve.current().expect("solved");
    let truth = solved.result.truth.expect("the cell publishes its truth");
    assert!(truth.translation_error_mm.is_some_and(|mm| mm < 0.5), "{truth:?}");
    assert!(truth.rotation_error_deg.is_some_and(|deg| deg < 0.03), "{truth:?}");
    assert!(truth.focal_error_percent.is_some_and(|percent| percent < 0.2), "{truth:?}");

    // One more from between two poses, which verifies and never enters the fit.
    bench.allow(motion::Command::GoToCapture(CaptureId(3)));
    bench.until("the arm at pose 3", |model| model.motion == handeye_workbench::model::Motion::Idle);
    bench.click(capture::Command::SetOptions(handeye_workbench::model::CaptureOptions {
        least_distance_m: 0.0,
        least_angle_rad: 0.0,
        ..Default::default()
    }));
    bench.click(capture::Command::Take(CapturePurpose::Verify));
    bench.until("the verification", |model| {
        model.solve.current().is_some_and(|solved| matches!(solved.verification, Some(Ok(_))))
    });
    let solved = bench.model().solve.current().expect("solved").clone();
    let Some(Ok(verification)) = &solved.verification else { panic!("verified") };
    assert_eq!(solved.captures.len(), 10, "a capture that verifies is not in the fit");
    assert!(verification.rms_px < 0.5 && verification.centre_rms_m < 0.5e-3, "{verification:?}");

    bench.click(export::Command::Export);
    bench.until("the exports", |model| model.export.written.is_some());
    let written = bench.model().export.written.clone().expect("written");
    let files = written.files.expect("files");
    assert!(files.len() >= 4 && files.iter().all(|file| file.is_file()), "{files:?}");
}

#[test]
fn deleting_and_excluding_solve_again_and_undo_brings_the_same_answer_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = captured(folder.path());
    let before = bench.model().solve.current().expect("solved").result.clone();

    bench.click(session::Command::Delete(vec![CaptureId(2), CaptureId(5)]));
    bench.until("eight captures", |model| model.document().captures.len() == 8 && idle_and_fresh(model));
    assert_ne!(bench.model().solve.current().expect("solved").result.hand_eye, before.hand_eye);
    bench.click(session::Command::SetExcluded { ids: vec![CaptureId(7)], excluded: true });
    bench.until("seven in the fit", |model| model.document().in_use().count() == 7 && idle_and_fresh(model));
    for _ in 0..2 {
        bench.until("something to undo", |model| model.session.undo.is_some());
        bench.click(session::Command::Undo);
    }
    bench.until("ten captures", |model| model.document().in_use().count() == 10 && idle_and_fresh(model));
    assert_eq!(bench.model().solve.current().expect("solved").result, before, "to the last bit");
    bench.click(session::Command::Redo);
    bench.until("eight captures", |model| model.document().captures.len() == 8);
}

#[test]
fn a_session_is_opened_again_as_it_was_and_solves_to_the_same_bits_as_the_command_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = captured(folder.path());
    bench.click(session::Command::SetExcluded { ids: vec![CaptureId(4)], excluded: true });
    bench.click(session::Command::SetPurpose { ids: vec![CaptureId(6)], purpose: CapturePurpose::Verify });
    bench.until("the changes", |model| model.document().in_use().count() == 8 && idle_and_fresh(model));
    let session = bench.model().session.folder.clone().expect("a folder");
    let (document, solved) = (bench.model().session.document.clone(), bench.model().solve.current().cloned());
    let undo = bench.model().session.undo.clone();
    drop(bench);
    let kept = result_beside(&session);

    let address = CellSource::Address("tcp://127.0.0.1:1".to_owned());
    let mut again = Workbench::start(address, folder.path(), Some(session.clone()));
    again.until("the session", |model| model.session.folder.is_some() && idle_and_fresh(model));
    let model = again.model();
    assert_eq!(model.session.document, document);
    assert_eq!(model.session.undo, undo, "what could be undone still can");
    assert_eq!(model.document().capture(CaptureId(6)).map(|it| it.role), Some(Role::Verification));
    let resolved = model.solve.current().expect("solved");
    let solved = solved.expect("solved");
    assert_eq!(resolved.result.hand_eye, solved.result.hand_eye);
    assert_eq!(resolved.result.quality, solved.result.quality);
    assert_eq!(resolved.result.views, solved.result.views);

    let cli = by_command_line(&session);
    assert_eq!(cli.hand_eye, kept.hand_eye);
    assert_eq!(cli.target, kept.target);
    assert_eq!(cli.intrinsics, kept.intrinsics);
    assert_eq!(cli.quality, kept.quality);
    assert_eq!(cli.views, kept.views, "the excluded one included");
    assert_eq!(cli.provenance.input_sha256, kept.provenance.input_sha256);
}

#[test]
fn a_stop_ends_the_sequence_and_keeps_what_was_captured() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Workbench::start(CellSource::default(), folder.path(), None);
    bench.until("a cell", connected);
    bench.until("the reference poses", |model| model.taught().len() == 10);
    bench.click(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
    bench.until("two captures", |model| model.document().captures.len() >= 2);
    bench.click(motion::Command::Stop);
    bench.until("the arm at rest", |model| !model.sequence_runs && !model.stop_pending);
    let kept = bench.model().document().captures.len();
    assert!((2..10).contains(&kept), "{kept}");
    // A session that was started by the first capture is a recent one as well.
    let recent = bench.model().recent.first().expect("a recent session");
    assert_eq!(recent.captures, kept);
    assert_eq!(Some(&recent.folder), bench.model().session.folder.as_ref());
    let joints = |bench: &Workbench| bench.model().robot.as_ref().map(|robot| robot.joints_rad);
    let sim_time = |model: &Model| model.robot.as_ref().map_or(0.0, |robot| robot.sim_time_s);
    // It brakes within its limits, which takes a moment of simulated time.
    let stopped_s = sim_time(bench.model());
    bench.until("a second at rest", |model| sim_time(model) > stopped_s + 1.5);
    let (at_rest, at_s) = (joints(&bench), sim_time(bench.model()));
    bench.until("another second", |model| sim_time(model) > at_s + 1.0);
    assert_eq!(joints(&bench), at_rest, "the arm moves on after a stop");
    assert_eq!(bench.model().document().captures.len(), kept);
}

#[test]
fn a_session_that_cannot_be_opened_says_why_and_leaves_the_present_one_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("broken");
    std::fs::create_dir(&broken).expect("a folder");
    std::fs::write(broken.join("session.json"), "{ \"format\": \"handeye-session\", \"vers").expect("a file");
    let address = CellSource::Address("tcp://127.0.0.1:1".to_owned());
    let mut bench = Workbench::start(address, folder.path(), None);
    bench.click(session::Command::New(Some(folder.path().join("mine"))));
    bench.until("a session", |model| model.session.folder.is_some());
    bench.click(session::Command::Open(broken));
    bench.until("the answer", |model| {
        let reported = |message: &Message| message.text.in_language(Language::English).contains("was not opened");
        !model.opening && model.messages.iter().any(reported)
    });
    assert_eq!(bench.model().session.name().as_deref(), Some("mine"));
}

#[test]
fn a_server_that_never_answers_is_left_for_a_cell_and_the_session_stays_open() {
    let folder = tempfile::tempdir().expect("a folder");
    let silent = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("tcp://{}", silent.local_addr().expect("an address"));
    let mut bench = Workbench::start(CellSource::Address(address), folder.path(), None);
    bench.click(session::Command::New(Some(folder.path().join("mine"))));
    bench.until("a session", |model| model.session.folder.is_some());

    let cell = CellServer::start(CellConfig::new(Scene::reference().expect("the scene"))).expect("a cell");
    bench.click(connect::Command::Connect(CellSource::Address(cell.endpoint())));
    bench.until("the cell", |model| model.control.is_connected() && model.camera.is_connected());
    bench.click(connect::Command::StartSimulation);
    bench.until("the board in an image", |model| {
        model.detection.as_ref().is_some_and(|detection| detection.corners.is_some())
    });
    assert_eq!(bench.model().session.name().as_deref(), Some("mine"));
    assert_eq!(bench.model().addresses.len(), 1);
}

#[test]
fn recorded_images_and_poses_are_opened_as_a_session_and_stay_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let bench = captured(&folder.path().join("sessions"));
    let recorded = bench.model().session.folder.clone().expect("a session");
    drop(bench);
    // A data set has no depths, and with them the answer would differ.
    std::fs::remove_dir_all(recorded.join("depth")).expect("depths");
    let expected = by_command_line(&recorded).hand_eye;
    // As written by another program: images, poses and their description, and nothing of ours.
    let dataset = folder.path().join("recorded");
    std::fs::create_dir_all(dataset.join("images")).expect("a folder");
    for file in ["dataset.toml", "poses.csv"] {
        std::fs::copy(recorded.join(file), dataset.join(file)).expect("copied");
    }
    for image in std::fs::read_dir(recorded.join("images")).expect("images").flatten() {
        std::fs::copy(image.path(), dataset.join("images").join(image.file_name())).expect("copied");
    }
    let address = CellSource::Address("tcp://127.0.0.1:1".to_owned());
    let mut bench = Workbench::start(address, &folder.path().join("others"), None);
    bench.click(session::Command::Open(dataset.clone()));
    bench.until("its answer", idle_and_fresh);
    assert_eq!(bench.model().document().captures.len(), 10);
    assert_eq!(bench.model().solve.current().expect("solved").result.hand_eye, expected, "to the last bit");
    assert!(!dataset.join("session.json").exists(), "the data set is as it was");
}
