//! Motions, jogs and stops of the arm against the real cell over a socket.

use ciborium::Value;
use handeye_arm::JointValues;
use handeye_cell::scene::{JointModeSpec, Scene};
use handeye_coppeliasim::cell::{
    Arm, ArmJog, ArmKinematics, CameraFeed, CellClient, CellPaths, JogAxes, JogEnd, JogObstacle,
};
use handeye_coppeliasim::{
    CallOptions, CancelToken, Connection, ConnectionOptions, Endpoint, LinkError, MotionLimits, ObjectHandle, Sim,
    SimulationState, Transport, TransportFault, ZmqTransport,
};
use handeye_geometry::frames::{Base, Camera, Pose, Tip};
use handeye_server::{CellConfig, CellServer};
use handeye_wire::{self as wire, Reader as _};
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::sync::mpsc::channel;
use std::time::Duration;

/// Only a failure takes this long.
const PATIENCE: Duration = Duration::from_mins(1);

const TIME_STEP_S: f64 = 0.05;

struct Bench {
    server: CellServer,
    arm: Arm,
}

impl Bench {
    /// A cell whose passes come only when the arm's client steps: the same numbers on every machine.
    fn stepped() -> Self {
        Self::stepped_in(Scene::reference().expect("valid"))
    }

    fn stepped_in(scene: Scene) -> Self {
        let mut bench = Self::running_in(scene);
        bench.arm.sim().set_stepping(true).expect("a call");
        bench
    }

    fn running() -> Self {
        Self::running_in(Scene::reference().expect("valid"))
    }

    fn running_in(scene: Scene) -> Self {
        let config = CellConfig { real_time: Some(false), ..CellConfig::new(scene) };
        let server = CellServer::start(config).expect("a free port");
        let mut arm = connect(&server);
        arm.sim().start_simulation().expect("a call");
        Self { server, arm }
    }

    fn kinematics(&mut self) -> ArmKinematics {
        self.arm.kinematics().expect("calls").expect("it is the UR5")
    }

    fn joints(&mut self) -> JointValues {
        self.arm.joint_values().expect("a call")
    }

    fn tip(&mut self) -> Pose<Base, Tip> {
        self.arm.base_from_tip().expect("a call")
    }
}

fn endpoint(server: &CellServer) -> Endpoint {
    server.endpoint().parse().expect("an address")
}

fn connect(server: &CellServer) -> Arm {
    Arm::connect(&endpoint(server), &ConnectionOptions::default(), &CellPaths::default()).expect("the scene is whole")
}

fn slow() -> MotionLimits {
    MotionLimits::uniform(6, 0.2, 1.0, 10.0)
}

/// Makes a server drop a client, as it does by itself with one that was silent for too long.
fn forget(address: &str, uuid: &str) {
    let request =
        wire::map([("func", Value::from("_*end*_")), ("args", Value::Array(Vec::new())), ("uuid", Value::from(uuid))]);
    let socket = zmq::Context::new().socket(zmq::REQ).expect("a socket");
    socket.set_rcvtimeo(PATIENCE.as_millis() as i32).expect("an option");
    socket.connect(address).expect("an address");
    socket.send(wire::encode(&request), 0).expect("sent");
    socket.recv_bytes(0).expect("an answer in time");
}

#[test]
fn a_motion_that_the_server_has_forgotten_is_named_and_can_be_made_again() {
    let Bench { server, arm: mut witness } = Bench::running();
    let goal = witness.joint_values().expect("a call").map(|angle| angle + 0.5);
    let (uuids, uuid) = channel::<String>();
    let (mut passes, address) = (0, server.endpoint());
    let mut cell = watched(&server, move || {
        passes += 1;
        if passes == 5 {
            forget(&address, &uuid.recv_timeout(PATIENCE).expect("its id"));
        }
    });
    uuids.send(cell.arm().sim().connection().uuid().to_owned()).expect("the transport listens");
    cell.arm().sim().set_stepping(true).expect("a call");
    let error =
        cell.arm().move_to_joints(&goal, &slow(), &CancelToken::default()).expect_err("nobody knows the motion");
    assert!(matches!(error, LinkError::Forgotten { .. }), "{error}");
    assert!(error.to_string().contains("slept"), "{error}");
    assert!(cell.arm().joint_values().expect("a call") != goal);
    let limits = MotionLimits::uniform(6, 3.0, 9.0, 90.0);
    cell.arm().move_to_joints(&goal, &limits, &CancelToken::default()).expect("there");
}

/// Held for a number of passes.
fn held_for(passes: usize, share: f64) -> impl FnMut() -> Option<f64> {
    let mut left = passes;
    move || {
        left = left.checked_sub(1)?;
        Some(share)
    }
}

#[test]
fn the_kinematics_of_the_built_in_arm_is_recognised_wherever_it_stands() {
    let mut bench = Bench::stepped();
    let kinematics = bench.kinematics();
    let goal = [0.4, 0.5, -1.2, 0.6, 1.1, -0.8];
    bench.arm.move_to_joints(&goal, &MotionLimits::uniform(6, 3.0, 9.0, 90.0), &CancelToken::default()).expect("there");
    let (distance_m, angle_rad) = kinematics.tip(&bench.joints()).distance_to(&bench.tip());
    assert!(distance_m < 1e-9 && angle_rad < 1e-7, "{distance_m} m, {angle_rad} rad");
}

#[test]
fn a_tip_that_was_moved_on_the_flange_is_not_jogged_along_lines() {
    let mut bench = Bench::stepped();
    let kinematics = bench.kinematics();
    let before = bench.joints();
    let tip = bench.arm.sim().get_object("/UR5/Tip").expect("the tip");
    let moved = Pose::<Base, Tip>::from_translation_xyzw([0.0, 0.0, 0.1], [0.0, 0.0, 0.0, 1.0]);
    bench.arm.sim().set_object_pose(tip, ObjectHandle::PARENT, &moved).expect("a call");
    let jog = ArmJog::Line { kinematics: &kinematics, axes: JogAxes::Base, along: Vector3::x() };
    assert_eq!(bench.arm.jog(&jog, None, &mut held_for(10, 1.0)), Ok(JogEnd::OtherTip));
    assert_eq!(bench.joints(), before);
}

#[test]
fn a_held_joint_moves_from_the_first_pass_within_its_limits_and_comes_to_rest() {
    let mut bench = Bench::stepped();
    let mut watch = connect(&bench.server);
    let mut seen = vec![bench.joints()[1]];
    let mut passes = 0;
    let mut held = || {
        seen.push(watch.joint_values().expect("a call")[1]);
        passes += 1;
        (passes <= 10).then_some(0.5)
    };
    let end = bench.arm.jog(&ArmJog::Joint { index: 1, forward: false }, None, &mut held);
    assert_eq!(end, Ok(JogEnd::Released));
    seen.push(bench.joints()[1]);
    assert_eq!(seen[0], seen[1], "nothing moves before it is asked for");
    assert!(seen[2] < seen[1], "the first pass moves it");
    let speeds: Vec<f64> = seen.windows(2).map(|pair| (pair[0] - pair[1]) / TIME_STEP_S).collect();
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    assert!((fastest - 30_f64.to_radians()).abs() < 1e-9, "{fastest}");
    for pair in speeds.windows(2) {
        assert!((pair[1] - pair[0]).abs() <= 180_f64.to_radians() * TIME_STEP_S + 1e-9, "{speeds:?}");
    }
    let before = bench.joints();
    bench.arm.sim().step(&CallOptions::default()).expect("a pass");
    assert_eq!(bench.joints(), before, "it stands");
}

#[test]
fn a_joint_stops_at_the_end_of_its_range() {
    let mut bench = Bench::stepped();
    let end = bench.arm.jog(&ArmJog::Joint { index: 4, forward: true }, None, &mut || Some(1.0));
    assert!(matches!(end, Ok(JogEnd::Obstacle(JogObstacle::JointRange { joint: 5, .. }))), "{end:?}");
    assert!((bench.joints()[4] - std::f64::consts::TAU).abs() < 1e-6, "{:?}", bench.joints());
}

#[test]
fn the_tip_moves_along_the_axes_of_base_tip_and_camera() {
    let mut bench = Bench::stepped();
    let kinematics = bench.kinematics();
    let tip_from_camera = bench.arm.ground_truth().expect("published").tip_from_camera;
    for axes in [JogAxes::Base, JogAxes::Tip, JogAxes::Camera(tip_from_camera)] {
        let before = bench.tip();
        let expected = match axes {
            JogAxes::Base => Vector3::y(),
            JogAxes::Tip => before.rotation() * Vector3::y(),
            JogAxes::Camera(_) => before.rotation() * (tip_from_camera.rotation() * Vector3::y()),
        };
        let jog = ArmJog::Line { kinematics: &kinematics, axes, along: Vector3::y() };
        assert_eq!(bench.arm.jog(&jog, Some(0.013), &mut || Some(0.25)), Ok(JogEnd::Arrived));
        let after = bench.tip();
        assert!((after.translation() - before.translation() - expected * 0.013).norm() < 1e-7, "{axes:?}");
        assert!(before.distance_to(&after).1 < 1e-6, "{axes:?}");
    }
}

#[test]
fn turning_about_the_camera_keeps_the_camera_in_its_place() {
    let mut bench = Bench::stepped();
    let kinematics = bench.kinematics();
    let tip_from_camera = bench.arm.ground_truth().expect("published").tip_from_camera;
    let before: Pose<Base, Camera> = bench.tip() * tip_from_camera;
    let axes = JogAxes::Camera(tip_from_camera);
    let jog = ArmJog::Turn { kinematics: &kinematics, axes, about: Vector3::x() };
    assert_eq!(bench.arm.jog(&jog, Some(0.2), &mut || Some(0.5)), Ok(JogEnd::Arrived));
    let after: Pose<Base, Camera> = bench.tip() * tip_from_camera;
    let (distance_m, angle_rad) = before.distance_to(&after);
    assert!(distance_m < 1e-7 && (angle_rad - 0.2).abs() < 1e-7, "{distance_m} m, {angle_rad} rad");
    let turned = before.rotation().inverse() * after.rotation();
    assert!((turned.scaled_axis() - Vector3::x() * 0.2).norm() < 1e-6, "right-handed about x of the camera");
}

#[test]
fn a_tip_that_is_held_until_it_can_go_no_further_stops_and_says_why() {
    let mut bench = Bench::stepped();
    let kinematics = bench.kinematics();
    let mut watch = connect(&bench.server);
    let mut before = bench.joints();
    let mut fastest_rad_s = 0.0_f64;
    let mut held = || {
        let now = watch.joint_values().expect("a call");
        let change = now.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        fastest_rad_s = fastest_rad_s.max(change / TIME_STEP_S);
        before = now;
        Some(1.0)
    };
    let jog = ArmJog::Line { kinematics: &kinematics, axes: JogAxes::Base, along: Vector3::x() };
    let end = bench.arm.jog(&jog, None, &mut held).expect("calls");
    assert!(matches!(end, JogEnd::Obstacle(JogObstacle::Reach(_) | JogObstacle::Singular { .. })), "{end:?}");
    assert!(fastest_rad_s <= 90.01_f64.to_radians(), "{}°/s", fastest_rad_s.to_degrees());
}

#[test]
fn a_joint_whose_controller_is_slower_than_the_motion_is_waited_for_and_not_taken_for_held() {
    let mut scene = Scene::coppeliasim().expect("valid");
    scene.robot.joint_mode = JointModeSpec::Dynamic;
    let mut bench = Bench::stepped_in(scene);
    let start = bench.joints();
    let mut goal = start;
    goal[5] += 4.0;
    // The controller moves no faster than 90°/s.
    let fast = MotionLimits::uniform(6, 4.0, 30.0, 300.0);
    bench.arm.move_to_joints(&goal, &fast, &CancelToken::default()).expect("it is on its way, and arrives");

    // An arm that is moved away from its commanded position is controlled by another client, though its controller
    // takes it back.
    let mut other = connect(&bench.server);
    let joint = other.sim().get_object_index("/UR5/joint", 0).expect("a joint");
    let at = bench.joints()[0];
    let mut passes = 0;
    let mut held = || {
        passes += 1;
        if passes == 5 {
            other.sim().set_joint_position(joint, at - 0.6).expect("a call");
        }
        (passes < 20).then_some(0.1)
    };
    let end = bench.arm.jog(&ArmJog::Joint { index: 0, forward: true }, None, &mut held);
    assert_eq!(end, Ok(JogEnd::NotFollowing { joint: 1 }));
}

#[test]
fn a_jog_gives_way_when_somebody_else_moves_the_joint() {
    let mut bench = Bench::stepped();
    let mut other = connect(&bench.server);
    let joint = other.sim().get_object_index("/UR5/joint", 0).expect("a joint");
    let mut passes = 0;
    let mut held = || {
        passes += 1;
        if passes == 5 {
            other.sim().set_joint_position(joint, -1.0).expect("a call");
        }
        Some(0.2)
    };
    let end = bench.arm.jog(&ArmJog::Joint { index: 0, forward: true }, None, &mut held);
    assert_eq!(end, Ok(JogEnd::NotFollowing { joint: 1 }));
    assert!((bench.joints()[0] + 1.0).abs() < 1e-9, "the other has its way");
}

#[test]
fn a_stop_of_another_client_brings_a_jog_to_rest_within_its_limits() {
    let mut bench = Bench::stepped();
    let mut other = connect(&bench.server);
    let mut seen = vec![bench.joints()[0]];
    let mut passes = 0;
    let mut held = || {
        passes += 1;
        seen.push(other.joint_values().expect("a call")[0]);
        if passes == 15 {
            other.stop().expect("a call");
        }
        Some(0.5)
    };
    let end = bench.arm.jog(&ArmJog::Joint { index: 0, forward: true }, None, &mut held);
    assert_eq!(end, Ok(JogEnd::Stopped));
    assert!(passes < 30, "it took {passes} passes");
    let speeds: Vec<f64> = seen.windows(2).map(|pair| (pair[1] - pair[0]) / TIME_STEP_S).collect();
    for pair in speeds.windows(2) {
        assert!((pair[1] - pair[0]).abs() <= 180_f64.to_radians() * TIME_STEP_S + 1e-9, "{speeds:?}");
    }
    let end = bench.arm.jog(&ArmJog::Joint { index: 0, forward: true }, None, &mut held_for(3, 0.5));
    assert_eq!(end, Ok(JogEnd::Released), "and the next jog is a new one");
}

#[test]
fn a_jog_ends_when_the_simulation_does() {
    let mut bench = Bench::running();
    let mut other = connect(&bench.server);
    let mut passes = 0;
    let mut held = || {
        passes += 1;
        if passes == 5 {
            other.sim().stop_simulation().expect("a call");
        }
        Some(0.2)
    };
    let end = bench.arm.jog(&ArmJog::Joint { index: 0, forward: true }, None, &mut held);
    // The start is restored, and nothing is sent after it; nobody else moved the joints.
    assert!(matches!(end, Err(LinkError::NotRunning { state: SimulationState::Stopped, .. })), "{end:?}");
}

/// A transport that runs a check after every pass that its client has made, before the client continues.
struct Watched<F> {
    transport: ZmqTransport,
    is_step: bool,
    look: F,
}

impl<F: FnMut() + Send> Transport for Watched<F> {
    fn send(&mut self, message: &[u8]) -> Result<(), TransportFault> {
        let request = wire::decode(message).expect("requests are valid");
        self.is_step = request.get("func").and_then(|func| func.text()) == Some("sim.step");
        self.transport.send(message)
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, TransportFault> {
        let reply = self.transport.receive(wait)?;
        if reply.is_some() && std::mem::take(&mut self.is_step) {
            (self.look)();
        }
        Ok(reply)
    }

    fn reset(&mut self) {
        self.transport.reset();
    }

    fn send_last(&mut self, message: &[u8]) {
        self.transport.send_last(message);
    }

    fn connected(&mut self) -> bool {
        self.transport.connected()
    }

    fn ended(&mut self) -> bool {
        self.transport.ended()
    }
}

/// A client that runs a check after every pass that it has made.
pub fn watched(server: &CellServer, look: impl FnMut() + Send + 'static) -> CellClient {
    let (address, options) = (endpoint(server), ConnectionOptions::default());
    let transport = Watched { transport: ZmqTransport::new(&address, options.heartbeat), is_step: false, look };
    let control = Sim::new(Connection::over(Box::new(transport), &address, options.clone()));
    let camera = Sim::connect(&address, options).expect("a socket");
    CellClient::over(control, camera, &CellPaths::default()).expect("the scene is whole")
}

#[test]
fn a_cancelled_motion_is_braked_and_not_cut_off() {
    const CANCELLED_AT_RAD: f64 = 0.8;
    let Bench { server, arm: mut watch } = Bench::running();
    let goal = [2.0, 0.8, -1.0, 0.0, 1.5, 0.0];
    let limits = MotionLimits::uniform(6, 0.4, 2.0, 20.0);
    let cancel = CancelToken::default();
    let (token, (seen, passes)) = (cancel.clone(), channel());
    let look = move || {
        let angle_rad = watch.joint_values().expect("a call")[0];
        if angle_rad > CANCELLED_AT_RAD {
            token.cancel();
        }
        seen.send(angle_rad).expect("the test listens");
    };
    let mut cell = watched(&server, look);
    // Passes come only when this client steps: every one of them is seen.
    cell.arm().sim().set_stepping(true).expect("a call");
    let outcome = cell.arm().move_to_joints(&goal, &limits, &cancel);
    assert!(matches!(outcome, Err(LinkError::Cancelled { .. })), "{outcome:?}");
    let rest = cell.arm().joint_values().expect("a call")[0];
    let seen: Vec<f64> = passes.try_iter().collect();
    let cancelled_at = *seen.iter().find(|angle| **angle > CANCELLED_AT_RAD).expect("it was cancelled");
    assert!(rest < 1.6, "it stopped on its way, at {rest}");
    // From 0.4 rad/s it takes 0.03 rad to stop; an arm that stops abruptly takes none.
    assert!(rest - cancelled_at > 0.02, "it stopped dead, within {} rad", rest - cancelled_at);
    for triple in seen.windows(3) {
        let acceleration = (triple[2] - 2.0 * triple[1] + triple[0]) / (TIME_STEP_S * TIME_STEP_S);
        assert!(acceleration.abs() <= TAU + 1e-6, "{acceleration} rad/s² over {triple:?}");
    }
    assert_eq!(seen.last(), Some(&rest), "and it stands");
}

#[test]
fn a_stop_brings_the_motion_of_another_client_to_rest() {
    let mut bench = Bench::running();
    let address = endpoint(&bench.server);
    let goal = [3.0, 0.8, -1.0, 0.0, 1.5, 0.0];
    let (began, begun) = channel();
    // An ordinary client: one call that the server answers when the motion is over.
    let other = std::thread::spawn(move || {
        let mut sim = Sim::connect(&address, ConnectionOptions::default()).expect("a socket");
        let joints = wire::integers((0..6).map(|i| sim.get_object_index("/UR5/joint", i).expect("a joint").0));
        let six = |value: f64| wire::floats([value; 6]);
        let motion = wire::map([
            ("joints", joints),
            ("targetPos", wire::floats(goal)),
            ("maxVel", six(1e-3)),
            ("maxAccel", six(1.0)),
            ("maxJerk", six(10.0)),
        ]);
        began.send(()).expect("the test waits");
        let patient = CallOptions::long(PATIENCE, &CancelToken::default());
        sim.connection().call_with("sim.moveToConfig", vec![motion], &patient)
    });
    begun.recv_timeout(PATIENCE).expect("it begins");
    let start = bench.joints()[0];
    while bench.joints()[0] == start {
        assert!(!other.is_finished(), "{:?}", other.join());
    }
    bench.arm.stop().expect("a call");
    // At this speed the whole way takes fifty minutes of simulated time.
    other.join().expect("no panic").expect("its call returns");
    let rest = bench.joints();
    bench.arm.sim().step(&CallOptions::default()).expect("a pass");
    assert_eq!(bench.joints(), rest);
    assert!((rest[0] - goal[0]).abs() > 0.1);
}

#[test]
fn a_motion_that_another_client_stops_says_so() {
    let mut bench = Bench::running();
    let mut other = connect(&bench.server);
    let (began, begun) = channel();
    let start = bench.joints()[0];
    let stopping = std::thread::spawn(move || {
        begun.recv_timeout(PATIENCE).expect("it begins");
        while other.joint_values().expect("a call")[0] == start {}
        other.stop()
    });
    began.send(()).expect("it waits");
    let goal = [3.0, 0.8, -1.0, 0.0, 1.5, 0.0];
    let outcome = bench.arm.move_to_joints(&goal, &slow(), &CancelToken::default());
    stopping.join().expect("no panic").expect("a call");
    assert_eq!(outcome, Err(LinkError::MotionStopped { task: "moving the joints" }));
}

#[test]
fn either_half_of_a_cell_can_be_had_alone() {
    let bench = Bench::running();
    let options = ConnectionOptions::default();
    let mut camera = CameraFeed::connect(&endpoint(&bench.server), &options, &CellPaths::default()).expect("a camera");
    assert_eq!(camera.grab().expect("a frame").depth.width, camera.info().depth_optics.width);
    assert!(camera.info().is_handeye_cell);
}
