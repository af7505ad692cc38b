//! A simulation that another client holds, over real sockets.

use std::time::{Duration, Instant};

use ciborium::Value;
use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{Arm, ArmJog, CellClient, CellPaths, SettleOptions};
use handeye_coppeliasim::{CallOptions, CancelToken, ConnectionOptions, Endpoint, LinkError, MotionLimits, Sim};
use handeye_server::{CellConfig, CellServer};

/// It is 3 s; the rest is for a busy machine. A call may take 60 s.
const SOON: Duration = Duration::from_secs(10);

fn is_held_soon<T: std::fmt::Debug>(what: &str, work: impl FnOnce() -> Result<T, LinkError>) {
    let started = Instant::now();
    let error = work().expect_err(what);
    let LinkError::Held { after } = error else { panic!("{what}: {error}") };
    assert!(after >= Duration::from_secs(3) && started.elapsed() < SOON, "{what}: {:?}", started.elapsed());
    let reported = error.to_string();
    assert!(reported.contains("another client holds it, in stepping mode without a step"), "{reported}");
}

#[test]
fn a_client_in_stepping_mode_that_does_not_step_is_named_within_seconds_and_work_goes_on_when_it_has_left() {
    let config = CellConfig { real_time: Some(false), ..CellConfig::new(Scene::reference().expect("valid")) };
    let server = CellServer::start(config).expect("a free port");
    let endpoint: Endpoint = server.endpoint().parse().expect("an address");
    // As the vendor's Python client, which may be silent for ten minutes.
    let patient = ConnectionOptions { idle_timeout_s: 600, ..ConnectionOptions::default() };
    let mut idle = Sim::connect(&endpoint, patient).expect("an address");
    idle.set_stepping(true).expect("a call");
    idle.start_simulation().expect("a call");

    // What needs no pass is there.
    let cell = CellClient::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("connected");
    let (mut arm, mut camera) = cell.split();
    let frame = camera.grab().expect("a frame");
    camera.grab().expect("the same frame");
    let (start, limits, cancel) = (frame.joints, MotionLimits::uniform(6, 1.0, 4.0, 40.0), CancelToken::default());
    let goal = start.map(|angle| angle + 0.1);

    // What waits for a pass reports why it does not come.
    is_held_soon("a motion", || arm.move_to_joints(&goal, &limits, &cancel));
    let jog = ArmJog::Joint { index: 0, forward: true };
    is_held_soon("a jog", || arm.jog(&jog, Some(0.1), &mut || Some(1.0)));
    is_held_soon("waiting for the arm", || arm.settle(&SettleOptions::default(), &cancel));

    // A call that merely takes long is left alone, although the server asks to wait all along.
    let longer_s = SOON.as_secs_f64() / 2.0;
    let waited = arm.sim().connection().call("sim.wait", vec![Value::Float(longer_s), Value::from(false)]);
    waited.expect("a call that takes long");

    // A lock holds as much.
    idle.set_stepping(false).expect("a call");
    idle.acquire_lock().expect("a call");
    is_held_soon("the next pass", || arm.sim().step(&CallOptions::default()));

    drop(idle);
    moves(&mut arm, &goal, &limits);
}

fn moves(arm: &mut Arm, goal: &[f64], limits: &MotionLimits) {
    arm.move_to_joints(goal, limits, &CancelToken::default()).expect("nobody holds it any more");
    assert_eq!(&arm.joint_values().expect("a call")[..], goal);
}
