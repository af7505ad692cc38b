//! Verification at poses that the program plans, controlled by clicks, on the built-in cell over its real socket.

use handeye_cell::scene::Scene;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_server::{CellConfig, CellServer};
use handeye_session::Role;
use handeye_tests::workbench::Workbench;
use handeye_tests::{handeye_binary, hurry};
use handeye_workbench::model::{CellSource, JogSettings, Model, Motion};
use handeye_workbench::{connect, motion, taught};

/// The ten reference poses, captured and solved, and a cell to verify on. At full speed, otherwise it takes minutes.
fn solved(folder: &std::path::Path) -> (Workbench, CellServer) {
    let session = folder.join("session");
    let made = std::process::Command::new(handeye_binary())
        .args(["auto", "--quiet", "--rerun", "off", "--out"])
        .arg(&session)
        .output()
        .expect("handeye runs");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let mut scene = Scene::reference().expect("the scene");
    hurry(&mut scene);
    let cell = CellServer::start(CellConfig { real_time: Some(true), ..CellConfig::new(scene) }).expect("a cell");
    let mut bench = Workbench::start(CellSource::Address(cell.endpoint()), folder, Some(session));
    bench.until("a cell", |model| {
        let connected = model.control.is_connected() && model.camera.is_connected() && model.mover.is_connected();
        connected && model.frame.is_some() && model.cell.is_some() && model.robot.is_some()
    });
    bench.click(connect::Command::StartSimulation);
    bench.until("passing time", |model| model.resting_simulation().is_none());
    bench.until("a solution", |model| model.solve.current().is_some());
    bench.click(motion::Command::SetJog(JogSettings { speed: Some(1.0), ..JogSettings::default() }));
    (bench, cell)
}

fn poses(model: &Model, role: Role) -> Vec<Pose<Base, Tip>> {
    model.document().captures.iter().filter(|it| it.role == role).filter_map(|it| it.base_from_tip).collect()
}

#[test]
fn a_calibration_is_verified_at_planned_poses_that_were_not_in_the_fit() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = solved(folder.path());
    bench.click(taught::Command::SetConfirmMoves(false));
    bench.allow(taught::Command::VerifyAtPlanned);
    bench.until("the sequence", |model| model.sequence_runs);
    bench.until("its end", |model| !model.sequence_runs);
    bench.until("the verification", |model| {
        model.solve.current().is_some_and(|solved| solved.verified_captures.len() == 5)
    });
    let model = bench.model();
    let (fitted, checks) = (poses(model, Role::Calibration), poses(model, Role::Verification));
    assert_eq!((fitted.len(), checks.len()), (10, 5), "{}", bench.text());
    for check in &checks {
        let nearest_rad =
            fitted.iter().map(|pose| pose.rotation().angle_to(&check.rotation())).fold(f64::INFINITY, f64::min);
        println!("{:.1}° from the nearest pose of the fit", nearest_rad.to_degrees());
        assert!(nearest_rad > 10.0_f64.to_radians(), "{nearest_rad} rad");
    }
    let solved = model.solve.current().expect("solved").clone();
    assert_eq!(solved.captures.len(), 10, "a capture that verifies is not in the fit");
    let Some(Ok(verification)) = &solved.verification else { panic!("verified") };
    println!("{:.3} mm, {:.3} px", verification.centre_rms_m * 1e3, verification.rms_px);
    assert!(verification.centre_rms_m < 1e-3, "{verification:?}");
}

#[test]
fn a_stop_ends_the_verification_and_keeps_what_was_captured() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = solved(folder.path());
    bench.click(taught::Command::SetConfirmMoves(false));
    bench.allow(taught::Command::VerifyAtPlanned);
    bench.until("a capture", |model| !poses(model, Role::Verification).is_empty());
    bench.click(motion::Command::Stop);
    bench.until("the arm at rest", |model| !model.sequence_runs && !model.stop_pending && model.motion == Motion::Idle);
    let kept = poses(bench.model(), Role::Verification).len();
    assert!((1..5).contains(&kept), "{kept}");
    let sim_time = |model: &Model| model.robot.as_ref().map_or(0.0, |robot| robot.sim_time_s);
    let joints = |bench: &Workbench| bench.model().robot.as_ref().map(|robot| robot.joints_rad);
    let stopped_s = sim_time(bench.model());
    bench.until("two seconds", |model| sim_time(model) > stopped_s + 2.0);
    let (at_rest, at_s) = (joints(&bench), sim_time(bench.model()));
    bench.until("another second", |model| sim_time(model) > at_s + 1.0);
    assert_eq!(joints(&bench), at_rest, "the arm moves on after a stop");
    assert_eq!(poses(bench.model(), Role::Verification).len(), kept);
}
