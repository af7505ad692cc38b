//! The arm follows the board, by what a user clicks, on the built-in cell over its real socket.

use std::process::Command as Process;

use handeye_app::command::Command;
use handeye_app::model::{BoardMotion, BoardPath, CellSource, FollowStatus, FollowWish, Model};
use handeye_core::frames::{Camera, Pose, Target};
use handeye_core::session::CaptureId;
use handeye_core::track::State;
use handeye_sim_link::cell::scene::Scene;
use handeye_sim_link::cell::server::{CellConfig, CellServer};
use handeye_sim_link::client::cell::FollowLimits;
use handeye_tests::workbench::Workbench;
use handeye_tests::{handeye_binary, workspace_root};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Speed of the board that is followed [m/s].
const SPEED_M_S: f64 = 0.05;

/// Where following begins: of the ten, the pose furthest from the column of the arm, where it has most room.
const FIRST: CaptureId = CaptureId(7);

/// Hidden boards; `HANDEYE_TRIALS` has more of them.
const TRIALS: u32 = 5;

/// A calibrated workbench that tracks: realistic pictures, 33 a second.
fn tracking(folder: &std::path::Path) -> (Workbench, CellServer) {
    let session = folder.join("session");
    let scene = workspace_root().join("assets/scenes/realistic.toml");
    let calibrated = Process::new(handeye_binary())
        .args(["auto", "--quiet", "--rerun", "off", "--scene"])
        .arg(scene)
        .arg("--out")
        .arg(&session)
        .output()
        .expect("handeye runs");
    assert!(calibrated.status.success(), "{}", String::from_utf8_lossy(&calibrated.stderr));
    let mut scene = Scene::realistic().expect("the scene");
    scene.simulation.time_step_s = 0.03;
    let cell = CellServer::start(CellConfig { real_time: Some(true), ..CellConfig::new(scene) }).expect("a cell");
    let mut bench = Workbench::start(CellSource::Address(cell.endpoint()), folder, Some(session));
    bench.until("a cell", |model| {
        let connected = model.control.is_connected() && model.camera.is_connected() && model.mover.is_connected();
        connected && model.frame.is_some() && model.cell.is_some() && model.robot.is_some()
    });
    bench.click(Command::StartSimulation);
    bench.until("passing time", |model| model.resting_simulation().is_none());
    bench.until("a solution", |model| model.solve.current().is_some());
    bench.click(Command::GoToCapture(FIRST));
    bench.until("the arm at the first pose", |model| model.motion == handeye_app::model::Motion::Idle);
    bench.click(Command::SetTracking(true));
    bench.until("the board", is_tracked);
    (bench, cell)
}

fn is_tracked(model: &Model) -> bool {
    model.track.newest.as_ref().is_some_and(|newest| matches!(newest.update.state, State::Tracking { .. }))
}

fn sim_time_s(model: &Model) -> f64 {
    model.frame.as_ref().map_or(0.0, |frame| frame.info.sim_time_s)
}

/// What the camera really sees in the newest picture: by the cell's own word for camera and board.
fn true_view(model: &Model) -> Pose<Camera, Target> {
    let truth = model.cell.as_ref().and_then(|cell| cell.truth.as_ref()).expect("the cell's truth");
    let frame = &model.frame.as_ref().expect("a picture").info;
    let base_from_target = frame.base_from_target_true.expect("where the board is");
    (frame.base_from_tip * truth.tip_from_camera).inverse() * base_from_target
}

/// How far the view is from the one to be kept over some simulated time: RMS [m, rad].
fn deviation(bench: &mut Workbench, kept: &Pose<Camera, Target>, seconds: f64) -> [f64; 2] {
    let end_s = sim_time_s(bench.model()) + seconds;
    let (mut squares, mut count, mut seen) = ([0.0; 2], 0.0, 0);
    while sim_time_s(bench.model()) < end_s {
        bench.until("the next picture", |model| model.frame.as_ref().is_some_and(|frame| frame.info.number != seen));
        let model = bench.model();
        assert!(!matches!(model.track.follow, FollowStatus::Ended(_)), "{}", bench.said());
        seen = model.frame.as_ref().map_or(0, |frame| frame.info.number);
        let (metres, radians) = true_view(model).distance_to(kept);
        squares = [squares[0] + metres * metres, squares[1] + radians * radians];
        count += 1.0;
    }
    squares.map(|sum| f64::sqrt(sum / count))
}

fn wait(bench: &mut Workbench, seconds: f64) {
    let end_s = sim_time_s(bench.model()) + seconds;
    bench.until("time to pass", |model| sim_time_s(model) >= end_s);
}

#[test]
fn the_view_is_kept_while_the_board_moves_and_exactly_once_it_stands() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = tracking(folder.path());
    let newest = bench.model().track.newest.clone().expect("tracked");
    let kept = newest.update.seen.as_ref().expect("seen").camera_from_target;
    bench.click(Command::SetFollow(Some(FollowWish::KeepPose(kept))));
    bench.until("following", |model| matches!(model.track.follow, FollowStatus::Following { .. }));
    bench.click(Command::MoveBoard(BoardMotion { path: BoardPath::Circle, speed_m_s: SPEED_M_S }));
    wait(&mut bench, 2.0);
    let [metres, radians] = deviation(&mut bench, &kept, 10.0);
    println!("board at {SPEED_M_S} m/s: {:.2} mm, {:.3}° RMS", metres * 1e3, radians.to_degrees());
    assert!(metres <= 10e-3 && radians.to_degrees() <= 1.0, "{metres} m, {radians} rad");

    bench.click(Command::MoveBoard(BoardMotion { path: BoardPath::Still, speed_m_s: SPEED_M_S }));
    wait(&mut bench, 3.0);
    let [metres, radians] = deviation(&mut bench, &kept, 2.0);
    println!("board at rest: {:.2} mm, {:.3}° RMS", metres * 1e3, radians.to_degrees());
    assert!(metres <= 2e-3 && radians.to_degrees() <= 0.2, "{metres} m, {radians} rad");

    // Nothing but the stop is pressed; it ends the following as it ends everything.
    bench.click(Command::Stop);
    bench.until("the arm at rest", |model| !model.stop_pending && matches!(model.track.follow, FollowStatus::Ended(_)));
}

#[test]
fn an_arm_whose_board_is_hidden_comes_to_rest_within_its_limits() {
    let trials = std::env::var("HANDEYE_TRIALS").ok().and_then(|text| text.parse().ok()).unwrap_or(TRIALS);
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, _cell) = tracking(folder.path());
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let limits = FollowLimits::default();
    let paths = [BoardPath::Circle, BoardPath::FigureEight, BoardPath::RandomWalk, BoardPath::Step];
    for trial in 0..trials {
        let path = paths[rng.random_range(0..paths.len())];
        bench.click(Command::SetFollow(Some(FollowWish::KeepView)));
        bench.until("following", |model| matches!(model.track.follow, FollowStatus::Following { .. }));
        bench.click(Command::MoveBoard(BoardMotion { path, speed_m_s: 0.1 }));
        wait(&mut bench, rng.random_range(0.3..2.5));
        bench.click(Command::HideBoard(true));
        let hidden_s = sim_time_s(bench.model());
        let mut fastest_rad_s: f64 = 0.0;
        let mut before = bench.model().frame.clone().expect("a picture").info;
        let mut at_rest_since_s = None;
        while at_rest_since_s.is_none_or(|since_s| before.sim_time_s < since_s + 0.6) {
            let seen = before.number;
            bench.until("a picture", |model| model.frame.as_ref().is_some_and(|frame| frame.info.number != seen));
            let now = bench.model().frame.clone().expect("a picture").info;
            let dt_s = now.sim_time_s - before.sim_time_s;
            if dt_s > 0.0 {
                let turned = now.joints_rad.iter().zip(before.joints_rad).map(|(now, before)| (now - before).abs());
                let speed = turned.fold(0.0, f64::max) / dt_s;
                fastest_rad_s = fastest_rad_s.max(speed);
                at_rest_since_s = if speed > 0.0 { None } else { at_rest_since_s.or(Some(now.sim_time_s)) };
            }
            assert!(now.sim_time_s < hidden_s + 5.0, "trial {trial}: the arm still moves; {}", bench.said());
            before = now;
        }
        bench.until("the end of following", |model| matches!(model.track.follow, FollowStatus::Ended(_)));
        assert!(fastest_rad_s <= limits.joint_speed_rad_s * 1.001, "trial {trial}: {fastest_rad_s} rad/s");
        assert!(limits.workspace.contains(&before.base_from_tip.translation()), "trial {trial}: outside its box");
        bench.click(Command::MoveBoard(BoardMotion { path: BoardPath::Still, speed_m_s: 0.1 }));
        bench.click(Command::HideBoard(false));
        bench.click(Command::GoToCapture(FIRST));
        bench.until("the arm at the first pose", |model| model.motion == handeye_app::model::Motion::Idle);
        bench.until("the board", is_tracked);
    }
    println!("{trials} hidden boards: at rest within the limits every time");
}
