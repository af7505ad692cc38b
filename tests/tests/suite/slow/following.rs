//! The arm follows the board, controlled by clicks, on the built-in cell over its real socket.

use std::process::Command as Process;

use handeye_cell::scene::{BoardMotionSpec, Scene};
use handeye_coppeliasim::cell::FollowLimits;
use handeye_coppeliasim::{CallOptions, ConnectionOptions, Sim};
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_server::{CellConfig, CellServer};
use handeye_session::CaptureId;
use handeye_tests::workbench::Workbench;
use handeye_tests::{handeye_binary, workspace_root};
use handeye_track::State;
use handeye_workbench::model::{BoardMotion, BoardPath, CellSource, FollowRequest, FollowStatus, Model};
use handeye_workbench::{connect, motion, taught, track};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

const TIME_STEP_S: f64 = 0.03;

/// Speed of the board that is followed [m/s].
const SPEED_M_S: f64 = 0.05;

/// Where following starts: of the ten, the pose furthest from the column of the arm, where it has most room.
const FIRST: CaptureId = CaptureId(7);

/// Number of hidden boards; `HANDEYE_TRIALS` sets more.
const TRIALS: u32 = 3;

/// The cell, and a client that can make its passes wait for the workbench: the measurement is then independent of how
/// busy the machine is.
struct Cell {
    pacer: Sim,
    _server: CellServer,
}

impl Cell {
    fn start(config: CellConfig) -> (Self, String) {
        let server = CellServer::start(CellConfig { real_time: Some(true), ..config }).expect("a cell");
        let endpoint = server.endpoint();
        let address = endpoint.parse().expect("an address");
        let pacer = Sim::connect(&address, ConnectionOptions::default()).expect("a socket");
        (Self { pacer, _server: server }, endpoint)
    }

    /// From now on a pass comes only when [`Cell::pass`] requests it, or as time passes.
    fn paced(&mut self, is_paced: bool) {
        self.pacer.set_stepping(is_paced).expect("a call");
    }

    /// Runs a pass, and waits until its image is tracked.
    fn pass(&mut self, bench: &mut Workbench) {
        self.pacer.step(&CallOptions::default()).expect("a pass");
        let now_s = self.pacer.get_simulation_time().expect("a call");
        bench.until("the image of the pass", |model| {
            let tracked = model.track.newest.as_ref().map_or(0, |newest| newest.frame);
            let frame = model.frame.as_ref().map(|frame| &frame.info);
            frame.is_some_and(|frame| frame.sim_time_s >= now_s - 1e-9 && tracked >= frame.number)
        });
    }

    fn passes(&mut self, bench: &mut Workbench, seconds: f64) {
        (0..passes_in(seconds)).for_each(|_| self.pass(bench));
    }
}

fn passes_in(seconds: f64) -> u32 {
    (seconds / TIME_STEP_S).round() as u32
}

/// Realistic images, 33 a second.
fn scene() -> Scene {
    let mut scene = Scene::realistic().expect("the scene");
    scene.simulation.time_step_s = TIME_STEP_S;
    scene
}

/// A calibrated workbench that tracks in that scene.
fn tracking(folder: &std::path::Path) -> (Workbench, Cell) {
    tracking_at(folder, "assets/scenes/realistic.toml", CellConfig::new(scene()), FIRST)
}

/// The same on another cell, and with the arm at another of the ten captures.
fn tracking_at(folder: &std::path::Path, file: &str, config: CellConfig, first: CaptureId) -> (Workbench, Cell) {
    let session = folder.join("session");
    let calibrated = Process::new(handeye_binary())
        .args(["auto", "--quiet", "--rerun", "off", "--scene"])
        .arg(workspace_root().join(file))
        .arg("--out")
        .arg(&session)
        .output()
        .expect("handeye runs");
    assert!(calibrated.status.success(), "{}", String::from_utf8_lossy(&calibrated.stderr));
    let (cell, endpoint) = Cell::start(config);
    let mut bench = Workbench::start(CellSource::Address(endpoint), folder, Some(session));
    bench.until("a cell", |model| {
        let connected = model.control.is_connected() && model.camera.is_connected() && model.mover.is_connected();
        connected && model.frame.is_some() && model.cell.is_some() && model.robot.is_some()
    });
    bench.click(connect::Command::StartSimulation);
    bench.until("passing time", |model| model.resting_simulation().is_none());
    bench.until("a solution", |model| model.solve.current().is_some());
    bench.click(motion::Command::GoToCapture(first));
    // The arm may be there already.
    bench.click(taught::Command::ConfirmMove);
    bench.until("the arm at the first pose", |model| model.motion == handeye_workbench::model::Motion::Idle);
    bench.click(track::Command::SetTracking(true));
    bench.until("the board", is_tracked);
    (bench, cell)
}

fn is_tracked(model: &Model) -> bool {
    model.track.newest.as_ref().is_some_and(|newest| matches!(newest.update.state, State::Tracking { .. }))
}

fn sim_time_s(model: &Model) -> f64 {
    model.frame.as_ref().map_or(0.0, |frame| frame.info.sim_time_s)
}

/// What the camera truly sees in the newest image: from the cell's own poses of camera and board.
fn true_view(model: &Model) -> Pose<Camera, Target> {
    let truth = model.cell.as_ref().and_then(|cell| cell.truth.as_ref()).expect("the cell's truth");
    let frame = &model.frame.as_ref().expect("an image").info;
    let base_from_target = frame.base_from_target_true.expect("where the board is");
    (frame.base_from_tip.expect("a cell reports it") * truth.tip_from_camera).inverse() * base_from_target
}

/// The tracking result for the newest image, on a cell that does not report where its board is.
fn seen_view(model: &Model) -> Pose<Camera, Target> {
    model.track.newest.as_ref().and_then(|newest| newest.update.seen.as_ref()).expect("seen").camera_from_target
}

/// Deviation of the view from the one to keep over some simulated time: RMS \[m, rad\].
fn deviation(bench: &mut Workbench, cell: &mut Cell, kept: &Pose<Camera, Target>, seconds: f64) -> [f64; 2] {
    deviation_of(true_view, bench, cell, kept, seconds)
}

fn deviation_of(
    view: impl Fn(&Model) -> Pose<Camera, Target>,
    bench: &mut Workbench,
    cell: &mut Cell,
    kept: &Pose<Camera, Target>,
    seconds: f64,
) -> [f64; 2] {
    let mut squares = [0.0; 2];
    for _ in 0..passes_in(seconds) {
        cell.pass(bench);
        let model = bench.model();
        assert!(!matches!(model.track.follow, FollowStatus::Ended(_)), "{}", bench.text());
        let (metres, radians) = view(model).distance_to(kept);
        squares = [squares[0] + metres * metres, squares[1] + radians * radians];
    }
    squares.map(|sum| f64::sqrt(sum / f64::from(passes_in(seconds))))
}

#[test]
fn the_view_is_kept_while_the_board_moves_and_exactly_once_it_stands() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, mut cell) = tracking(folder.path());
    let newest = bench.model().track.newest.clone().expect("tracked");
    let kept = newest.update.seen.as_ref().expect("seen").camera_from_target;
    bench.click(track::Command::SetFollow(Some(FollowRequest::KeepPose(kept))));
    bench.until("following", |model| matches!(model.track.follow, FollowStatus::Following { .. }));
    cell.paced(true);
    bench.click(track::Command::MoveBoard(BoardMotion { path: BoardPath::Circle, speed_m_s: SPEED_M_S }));
    cell.passes(&mut bench, 2.0);
    let [metres, radians] = deviation(&mut bench, &mut cell, &kept, 10.0);
    println!("board at {SPEED_M_S} m/s: {:.2} mm, {:.3}° RMS", metres * 1e3, radians.to_degrees());
    assert!(metres <= 10e-3 && radians.to_degrees() <= 1.0, "{metres} m, {radians} rad");

    bench.click(track::Command::MoveBoard(BoardMotion { path: BoardPath::Still, speed_m_s: SPEED_M_S }));
    cell.passes(&mut bench, 3.0);
    let [metres, radians] = deviation(&mut bench, &mut cell, &kept, 2.0);
    println!("board at rest: {:.2} mm, {:.3}° RMS", metres * 1e3, radians.to_degrees());
    assert!(metres <= 2e-3 && radians.to_degrees() <= 0.2, "{metres} m, {radians} rad");

    cell.paced(false);
    // Only the stop is pressed; it ends following like everything else.
    bench.click(motion::Command::Stop);
    bench.until("the arm at rest", |model| !model.stop_pending && matches!(model.track.follow, FollowStatus::Ended(_)));
}

#[test]
fn the_view_is_kept_with_nothing_but_what_coppeliasim_has() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut scene = scene();
    scene.board.motion =
        BoardMotionSpec { path: BoardPath::Circle, speed_m_s: SPEED_M_S, ..BoardMotionSpec::default() };
    let config = CellConfig { coppeliasim_only: true, ..CellConfig::new(scene) };
    let (mut bench, mut cell) = tracking_at(folder.path(), "assets/scenes/realistic.toml", config, FIRST);
    cell.paced(true);
    let kept = seen_view(bench.model());
    bench.click(track::Command::SetFollow(Some(FollowRequest::KeepPose(kept))));
    while !matches!(bench.model().track.follow, FollowStatus::Following { .. }) {
        assert!(!matches!(bench.model().track.follow, FollowStatus::Ended(_)), "{}", bench.text());
        cell.pass(&mut bench);
    }
    cell.passes(&mut bench, 2.0);
    let [metres, radians] = deviation_of(seen_view, &mut bench, &mut cell, &kept, 4.0);
    println!("board at {SPEED_M_S} m/s: {:.2} mm, {:.3}° RMS", metres * 1e3, radians.to_degrees());
    assert!(metres <= 10e-3 && radians.to_degrees() <= 1.0, "{metres} m, {radians} rad");
    cell.paced(false);
    bench.click(motion::Command::Stop);
    bench.until("the arm at rest", |model| !model.stop_pending && matches!(model.track.follow, FollowStatus::Ended(_)));
}

/// Where the ten reference poses leave the arm: close to its column.
const LAST: CaptureId = CaptureId(10);

#[test]
fn after_the_ten_poses_one_click_follows_the_board_along_every_path_for_minutes() {
    let seconds = std::env::var("HANDEYE_FOLLOW_S").ok().and_then(|text| text.parse().ok()).unwrap_or(6.0);
    let folder = tempfile::tempdir().expect("a folder");
    // The built-in cell: what a user sees first.
    let scene = Scene::reference().expect("the scene");
    let (mut bench, mut cell) =
        tracking_at(folder.path(), "assets/scenes/reference.toml", CellConfig::new(scene), LAST);
    bench.click(track::Command::SetFollow(Some(FollowRequest::KeepViewWithRoom)));
    bench.until("the move to where there is room", |model| model.track.follow == FollowStatus::MakingRoom);
    bench.until("following", |model| matches!(model.track.follow, FollowStatus::Following { .. }));
    for path in [BoardPath::Circle, BoardPath::FigureEight, BoardPath::RandomWalk, BoardPath::Step] {
        let kept = true_view(bench.model());
        cell.paced(true);
        bench.click(track::Command::MoveBoard(BoardMotion { path, speed_m_s: SPEED_M_S }));
        let [metres, radians] = deviation(&mut bench, &mut cell, &kept, seconds);
        println!("{path}: {:.2} mm, {:.3}° RMS in {seconds} s", metres * 1e3, radians.to_degrees());
        // A board that jumps every two seconds is 80 mm away at first, and the arm catches up in less than one.
        let most_m = if path == BoardPath::Step { 60e-3 } else { 10e-3 };
        assert!(metres <= most_m, "{path}: {metres} m");
        bench.click(track::Command::MoveBoard(BoardMotion { path: BoardPath::Still, speed_m_s: SPEED_M_S }));
        cell.passes(&mut bench, 4.0);
        cell.paced(false);
        assert!(matches!(bench.model().track.follow, FollowStatus::Following { .. }), "{path}: {}", bench.text());
    }
}

#[test]
fn an_arm_whose_board_is_hidden_comes_to_rest_within_its_limits() {
    let trials = std::env::var("HANDEYE_TRIALS").ok().and_then(|text| text.parse().ok()).unwrap_or(TRIALS);
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, mut cell) = tracking(folder.path());
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let limits = FollowLimits::default();
    let paths = [BoardPath::Circle, BoardPath::FigureEight, BoardPath::RandomWalk, BoardPath::Step];
    for trial in 0..trials {
        let path = paths[rng.random_range(0..paths.len())];
        bench.click(track::Command::SetFollow(Some(FollowRequest::KeepView)));
        bench.until("following", |model| matches!(model.track.follow, FollowStatus::Following { .. }));
        cell.paced(true);
        bench.click(track::Command::MoveBoard(BoardMotion { path, speed_m_s: 0.1 }));
        cell.passes(&mut bench, rng.random_range(0.3..2.5));
        bench.click(track::Command::HideBoard(true));
        let hidden_s = sim_time_s(bench.model());
        let mut fastest_rad_s: f64 = 0.0;
        let mut before = bench.model().frame.clone().expect("an image").info;
        let mut at_rest_since_s = None;
        while at_rest_since_s.is_none_or(|since_s| before.sim_time_s < since_s + 0.6) {
            cell.pass(&mut bench);
            let now = bench.model().frame.clone().expect("an image").info;
            let dt_s = now.sim_time_s - before.sim_time_s;
            if dt_s > 0.0 {
                let turned = now.joints_rad.iter().zip(&before.joints_rad).map(|(now, before)| (now - before).abs());
                let speed = turned.fold(0.0, f64::max) / dt_s;
                fastest_rad_s = fastest_rad_s.max(speed);
                at_rest_since_s = if speed > 0.0 { None } else { at_rest_since_s.or(Some(now.sim_time_s)) };
            }
            assert!(now.sim_time_s < hidden_s + 5.0, "trial {trial}: the arm still moves; {}", bench.text());
            before = now;
        }
        // The arm waits for a while before it stops; until then the board would leave the image of the first pose.
        bench.click(track::Command::MoveBoard(BoardMotion { path: BoardPath::Still, speed_m_s: 0.1 }));
        cell.paced(false);
        bench.until("the end of following", |model| matches!(model.track.follow, FollowStatus::Ended(_)));
        assert!(fastest_rad_s <= limits.joint_speed_rad_s * 1.001, "trial {trial}: {fastest_rad_s} rad/s");
        assert!(
            limits.workspace.contains(&before.base_from_tip.expect("a cell reports it").translation()),
            "trial {trial}: outside its box"
        );
        bench.click(track::Command::HideBoard(false));
        bench.click(motion::Command::GoToCapture(FIRST));
        bench.click(taught::Command::ConfirmMove);
        bench.until("the arm at the first pose", |model| model.motion == handeye_workbench::model::Motion::Idle);
        bench.until("the board", is_tracked);
    }
    println!("{trials} hidden boards: at rest within the limits every time");
}
