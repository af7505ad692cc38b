//! A cell that is killed in the middle of a move and of an image, and comes back on the same port.

use std::thread;
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::{Arm, CameraFeed, CellClient, CellPaths};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint, LinkError, MotionLimits};
use handeye_tests::CellProcess;

/// The guarantee to users: a dead cell is reported within this time.
const NOTICED_WITHIN: Duration = Duration::from_secs(2);
/// A restarted cell answers within this on a busy machine.
const BACK_WITHIN: Duration = Duration::from_secs(30);

fn connect(port: u16) -> (Arm, CameraFeed) {
    let cell = CellClient::connect(&Endpoint::local(port), &ConnectionOptions::default(), &CellPaths::default());
    cell.expect("the cell is there").split()
}

/// Calls until it answers; every failure before that has to be a connection error.
fn until_it_answers<T>(mut call: impl FnMut() -> Result<T, LinkError>) -> T {
    let start = Instant::now();
    loop {
        match call() {
            Ok(value) => return value,
            Err(error) => assert!(
                error.is_connection_loss() && start.elapsed() < BACK_WITHIN,
                "{error} after {:?}",
                start.elapsed()
            ),
        }
    }
}

#[test]
fn a_cell_killed_in_a_move_is_reported_and_taken_up_again() {
    let mut cell = CellProcess::start(&[]);
    let port = cell.port();
    let (mut arm, _camera) = connect(port);
    arm.sim().start_simulation().expect("starts");
    // Slow enough to be under way for many seconds.
    let limits = MotionLimits::uniform(6, 0.05, 0.1, 0.5);
    let (moving, has_moved) = std::sync::mpsc::channel();
    let mover = thread::spawn(move || {
        let before = arm.joint_values().expect("answers");
        moving.send(()).expect("the test listens");
        let goal = before.map(|q| q + 1.0);
        let outcome = arm.move_to_joints(&goal, &limits, &CancelToken::default());
        (arm, outcome, Instant::now())
    });
    has_moved.recv().expect("the move begins");
    // A second client sees the arm move, so the kill happens during the move.
    let (mut witness, _) = connect(port);
    let start = witness.joint_values().expect("answers");
    while witness.joint_values().expect("answers") == start {}
    let killed = Instant::now();
    cell.kill();
    let (mut arm, outcome, noticed) = mover.join().expect("no panic");
    let error = outcome.expect_err("the cell is dead");
    assert!(error.is_connection_loss(), "{error}");
    println!("killed in a move: noticed after {:?}: {error}", noticed - killed);
    assert!(noticed - killed < NOTICED_WITHIN);

    let _again = CellProcess::start_on(port, &[]);
    until_it_answers(|| arm.joint_values());
    arm.sim().start_simulation().expect("starts");
    let limits = MotionLimits::uniform(6, 2.0, 8.0, 80.0);
    let goal = arm.joint_values().expect("answers").map(|q| q + 0.05);
    arm.move_to_joints(&goal, &limits, &CancelToken::default()).expect("carries on");
}

#[test]
fn a_cell_killed_while_images_flow_is_reported_and_taken_up_again() {
    let mut cell = CellProcess::start(&[]);
    let port = cell.port();
    let (_arm, mut camera) = connect(port);
    let (shown, images) = std::sync::mpsc::channel();
    let looker = thread::spawn(move || {
        loop {
            match camera.grab() {
                // The receiver goes away once it has seen enough.
                Ok(_) => drop(shown.send(())),
                Err(error) => return (camera, error, Instant::now()),
            }
        }
    });
    for _ in 0..10 {
        images.recv().expect("images flow");
    }
    let killed = Instant::now();
    cell.kill();
    let (mut camera, error, noticed) = looker.join().expect("no panic");
    assert!(error.is_connection_loss(), "{error}");
    println!("killed while images flow: noticed after {:?}: {error}", noticed - killed);
    assert!(noticed - killed < NOTICED_WITHIN);

    let _again = CellProcess::start_on(port, &[]);
    let frame = until_it_answers(|| camera.grab());
    assert_eq!(frame.rgb.dimensions(), (640, 480));
}
