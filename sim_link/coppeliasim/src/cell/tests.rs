//! A cell in a closure: just enough of a server to see what the client makes of it.

use std::sync::{Mutex, PoisonError};

use approx::assert_relative_eq;
use ciborium::Value;
use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::constants;
use crate::convert::seven_from_pose;
use crate::sim::MotionLimits;
use crate::testing::{Answer, Log, args, connection, err, func, ret};
use crate::transport::TransportFault;
use handeye_wire::{self as wire, Reader};

const JOINTS: usize = 6;

/// State of the cell, and how it misbehaves.
struct World {
    state: i64,
    time_s: f64,
    joints: [f64; JOINTS],
    targets: [f64; JOINTS],
    base_from_tip: Pose<Base, Tip>,
    /// Parts of the way that a joint goes towards its target in a pass.
    follow: f64,
    missing: Vec<&'static str>,
    truth: Option<Value>,
    moment: Option<Value>,
    passes_per_image: u32,
    cancel_at_step: Option<(u32, CancelToken)>,
    /// Where joint 0 was in each pass.
    track: Vec<f64>,
    /// The mode of every joint: 0 is kinematic, 5 dynamic.
    joint_mode: i64,
    /// This joint refuses positions until it was sent to a target other than its position.
    stuck: Option<i64>,
    /// The account of a motion that the server gives.
    motion_state: Option<Vec<u8>>,
    /// Times that the sensors were handled.
    handled: u32,
    /// Times that another client moves the arm just after that.
    moved_when_handled: u32,
    die_in: Option<&'static str>,
    steps: u32,
    held: i32,
    /// Simulated time after a pass.
    clock: fn(f64) -> f64,
    version: i64,
    /// What is wrong with every path.
    no_path: Option<&'static str>,
}

type Shared = Arc<Mutex<World>>;

const TIP: i64 = 20;
const TARGET: i64 = 21;
const CAMERA: i64 = 22;
const DEPTH: i64 = 23;

fn world() -> Shared {
    Arc::new(Mutex::new(World {
        state: 17,
        time_s: 1.0,
        joints: [0.0; JOINTS],
        targets: [0.0; JOINTS],
        base_from_tip: Pose::from_translation_xyzw([0.1, 0.2, 0.9], [0.0, 0.0, 0.0, 1.0]),
        follow: 1.0,
        missing: Vec::new(),
        truth: None,
        moment: None,
        passes_per_image: 0,
        cancel_at_step: None,
        track: Vec::new(),
        joint_mode: 0,
        stuck: None,
        motion_state: None,
        handled: 0,
        moved_when_handled: 0,
        die_in: None,
        steps: 0,
        held: 0,
        clock: |time_s| time_s + 0.05,
        version: 41_000,
        no_path: None,
    }))
}

impl World {
    fn pass(&mut self) {
        self.time_s = (self.clock)(self.time_s);
        for (joint, target) in self.joints.iter_mut().zip(self.targets) {
            *joint += self.follow * (target - *joint);
        }
        self.track.push(self.joints[0]);
        if let Some((at, cancel)) = &self.cancel_at_step
            && self.track.len() == *at as usize
        {
            cancel.cancel();
        }
    }

    fn answer(&mut self, request: &Value) -> Answer {
        let (name, args) = (func(request), args(request));
        if self.missing.contains(&name) {
            return err(&format!("No such function: {name}"));
        }
        if self.die_in == Some(name) {
            return Answer::Fault(TransportFault::Disconnected);
        }
        let id = args.first().and_then(Reader::integer).unwrap_or(-1);
        match name {
            "sim.getObject" => self.object(args),
            // The tip hangs on nothing, so its joints are found by their name.
            "sim.getObjectParent" => ret([Value::from(-1)]),
            // What the scene has in place of what is missing.
            "sim.getObjectsInTree" => ret([Value::Array((1..=25).map(Value::from).collect())]),
            "sim.getObjectAlias" => {
                ret([Value::from(format!("/object[{}]", args[0].as_integer().map_or(0, i128::from)))])
            }
            "sim.getJointType" => ret([Value::from(constants::JOINT_REVOLUTE)]),
            "sim.getJointInterval" => ret([Value::from(false), wire::floats([-3.0, 6.5])]),
            "sim.getJointPosition" => ret([Value::Float(self.joints[id as usize])]),
            "sim.setJointTargetPosition" => {
                let target = args[1].number().expect("a number");
                if (target - self.joints[id as usize]).abs() > 0.01_f64.to_radians() && self.stuck == Some(id) {
                    self.stuck = None;
                }
                self.targets[id as usize] = target;
                ret([Value::from(1)])
            }
            "sim.getJointMode" => ret([Value::from(self.joint_mode)]),
            "sim.setJointPosition" if self.stuck == Some(id) => ret([Value::from(0)]),
            "sim.setJointPosition" => {
                self.joints[id as usize] = args[1].number().expect("a number");
                self.targets[id as usize] = self.joints[id as usize];
                ret([Value::from(1)])
            }
            "sim.handleVisionSensor" => {
                // A motion on the other connection may hold it too.
                assert!(args[0].integer() == Some(-3) && self.held > 0, "all, while time stands");
                self.handled += 1;
                if self.moved_when_handled > 0 {
                    self.moved_when_handled -= 1;
                    let further = nalgebra::Isometry3::translation(0.01, 0.0, 0.0) * self.base_from_tip.isometry();
                    self.base_from_tip = Pose::from_isometry(further);
                }
                ret([Value::from(0)])
            }
            "sim.setObjectPose" | "zmqRemoteApi.require" => ret([]),
            "sim.getInt32Param" => ret([Value::from(self.version)]),
            "sim.getVisionSensorRes" => ret([wire::integers([4, 2])]),
            "sim.getObjectInt32Param" => ret([Value::from(1)]),
            "sim.getObjectFloatParam" => ret([Value::Float(match args[1].integer() {
                Some(1000) => 0.01,
                Some(1001) => 3.5,
                _ => 1.0,
            })]),
            "sim.getSimulationTimeStep" => ret([Value::Float(0.05)]),
            "sim.getSimulationTime" => ret([Value::Float(self.time_s)]),
            "sim.getSimulationState" => ret([Value::from(self.state)]),
            "sim.step" => {
                self.pass();
                ret([])
            }
            "sim.acquireLock" => {
                self.held += 1;
                ret([])
            }
            "sim.releaseLock" => {
                self.held -= 1;
                ret([])
            }
            "sim.getObjectPose" => self.pose(id, args),
            "sim.getVisionSensorImg" => {
                if self.held == 0 {
                    (0..self.passes_per_image).for_each(|_| self.pass());
                }
                ret([Value::Bytes((0..24).collect()), wire::integers([4, 2])])
            }
            "sim.getVisionSensorDepth" => ret([Value::Bytes(vec![0; 32]), wire::integers([4, 2])]),
            "sim.getNamedStringParam" => ret([Value::Null]),
            // CoppeliaSim's answer; a real cell that brakes is met in the end-to-end tests.
            "handeye.stop" => err("No such function: handeye.stop"),
            "handeye.truth" => match &self.truth {
                Some(truth) => ret([truth.clone()]),
                None => err("No such function: handeye.truth"),
            },
            "handeye.moment" => match &self.moment {
                Some(moment) => ret([moment.clone()]),
                None => err("No such function: handeye.moment"),
            },
            "handeye.moveBoard" | "handeye.showBoard" => err(&format!("No such function: {name}")),
            _ => self.motion(name, args),
        }
    }

    fn object(&self, args: &[Value]) -> Answer {
        let index = args.get(1).and_then(|options| options.get("index")).and_then(Reader::integer);
        let quiet = args.get(1).is_some_and(|options| options.get("noError").is_some());
        if let Some(text) = self.no_path {
            return err(text);
        }
        let path = args[0].text().expect("a path");
        let handle = match (path, index) {
            ("/UR5/joint", Some(index)) => (index < JOINTS as i64).then_some(index),
            ("/UR5/Tip", None) => Some(TIP),
            ("/UR5/Target", None) => Some(TARGET),
            ("/UR5/3D_camera", None) => Some(CAMERA),
            ("/UR5/3D_camera/depth", None) => Some(DEPTH),
            _ => None,
        };
        match handle.filter(|_| !self.missing.contains(&path)) {
            Some(handle) => ret([Value::from(handle)]),
            None if quiet => ret([Value::from(-1)]),
            None => err("354: in sim._getObject: object does not exist, or alias/path is ill formatted."),
        }
    }

    fn pose(&self, id: i64, args: &[Value]) -> Answer {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        match (id, args[1].integer()) {
            (TIP, Some(-1)) => ret([wire::floats(seven_from_pose(&self.base_from_tip))]),
            // The reference scene's sensor on its tip.
            (CAMERA, Some(TIP)) => ret([wire::floats([0.05, 0.0, 0.0, 0.0, 0.0, -half, half])]),
            other => panic!("{other:?}"),
        }
    }

    /// Motions to a pose of three steps; the inverse kinematics fails, and nothing moves.
    fn motion(&mut self, name: &str, args: &[Value]) -> Answer {
        match name {
            "sim.moveToPose_init" => {
                self.steps = 0;
                match &self.motion_state {
                    Some(bytes) => Answer::Raw(bytes.clone()),
                    None => ret([wire::map([("ruckigObj", Value::from(1))])]),
                }
            }
            "sim.moveToPose_step" => {
                self.steps += 1;
                ret([Value::from(i64::from(self.steps == 3)), args[0].clone()])
            }
            "sim.moveToPose_cleanup" => {
                self.steps = 0;
                ret([])
            }
            "sim.moveToPose" => ret([wire::map([("timeLeft", Value::Float(0.0))])]),
            other => panic!("{other:?}"),
        }
    }
}

struct Cell {
    client: CellClient,
    world: Shared,
    control: Log,
    camera: Log,
}

fn try_cell(world: &Shared) -> (Result<CellClient, LinkError>, Log, Log) {
    let half = || {
        let shared = Arc::clone(world);
        let answer = move |request: &Value| shared.lock().unwrap_or_else(PoisonError::into_inner).answer(request);
        let (connection, log) = connection(answer);
        (Sim::new(connection), log)
    };
    let ((control, control_log), (camera, camera_log)) = (half(), half());
    (CellClient::over(control, camera, &CellPaths::default()), control_log, camera_log)
}

fn cell(world: Shared) -> Cell {
    let (client, control, camera) = try_cell(&world);
    Cell { client: client.expect("the scene is complete"), world, control, camera }
}

impl Cell {
    fn world(&self) -> std::sync::MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn edit(world: &Shared, change: impl FnOnce(&mut World)) {
    change(&mut world.lock().unwrap_or_else(PoisonError::into_inner));
}

const GOAL: JointValues = JointValues::of([0.3, -0.6, 0.9, 0.0, 1.5, 0.0]);

fn limits() -> MotionLimits {
    MotionLimits::uniform(JOINTS, 3.0, 2.0, 1.0)
}

fn pose_limits() -> MotionLimits {
    MotionLimits::uniform(4, 3.0, 2.0, 1.0)
}

#[test]
fn the_reference_scene_is_discovered() {
    let cell = cell(world());
    let info = cell.client.info();
    assert_eq!((info.program_version, info.time_step_s), (41000, 0.05));
    assert_eq!((info.optics.width, info.optics.height, info.depth_optics.far_m), (4, 2, 3.5));
    assert_relative_eq!(info.joints[5].range.max, 3.5, epsilon = 1e-12);
    // f = 2 / tan(0.5)
    assert_relative_eq!(cell.client.info().camera_intrinsics_nominal().fx, 3.6609754, epsilon = 1e-6);
}

#[test]
fn a_simulator_that_is_too_old_is_refused_before_anything_else_is_asked() {
    let world = world();
    edit(&world, |w| w.version = 40_699);
    let (client, control, _) = try_cell(&world);
    assert_eq!(client.err(), Some(LinkError::TooOld { version: Some(40_699) }));
    assert_eq!(control.functions(), ["sim.getInt32Param"]);
    // A server that does not report it is not CoppeliaSim.
    for version in [40_700, 41_000, 0] {
        edit(&world, |w| w.version = version);
        assert_eq!(try_cell(&world).0.err(), None, "{version}");
    }
}

#[test]
fn a_scene_without_its_tip_is_named_with_the_path() {
    let world = world();
    edit(&world, |w| w.missing.push("/UR5/Tip"));
    let error = try_cell(&world).0.err().expect("no tip");
    let reported = error.to_string();
    let LinkError::NoSuchObject { path, part, there } = error else { panic!("{error}") };
    assert_eq!((path.as_str(), part), ("/UR5/Tip", CellPart::Tip));
    // Not all of a scene with many of them.
    assert_eq!((there.len(), there[19].as_str(), there[20].as_str()), (21, "/object[20]", "and 5 more"));
    assert!(
        reported.contains("its dummies are /object[1], /object[2]") && reported.contains("object path \"tip\""),
        "{reported}"
    );
}

#[test]
fn only_a_server_that_says_that_an_object_is_not_there_is_taken_to_say_so() {
    let fails_with = |text| {
        let world = world();
        edit(&world, |w| w.no_path = Some(text));
        try_cell(&world).0.err().expect("refused")
    };
    for text in
        ["354: in sim._getObject: object does not exist, or alias/path is ill formatted.", "Object does not exist"]
    {
        assert!(matches!(fails_with(text), LinkError::NoSuchObject { .. }), "{text}");
    }
    let full = "the built-in cell serves 64 clients at a time: close one and try again.";
    // The place in the script that the server puts in front is of no use to the person who reads it.
    for (text, shown) in [(full, full), ("354: a script error", "a script error")] {
        let error = fails_with(text).to_string();
        assert!(error.ends_with(shown) && !error.contains("354"), "{error}");
    }
}

#[test]
fn a_scene_without_a_target_can_do_everything_but_motions_to_a_pose() {
    let world = world();
    edit(&world, |w| w.missing.push("/UR5/Target"));
    let mut cell = cell(world);
    cell.client.arm().move_to_joints(&GOAL, &limits(), &CancelToken::default()).expect("joints need no target");
    let goal = Pose::identity();
    let error =
        cell.client.arm().move_to_pose(&goal, &pose_limits(), &MotionTolerance::default(), &CancelToken::default());
    assert!(matches!(error, Err(LinkError::NoSuchObject { path, .. }) if path == "/UR5/Target"));
}

#[test]
fn a_motion_is_sent_point_by_point_within_its_limits() {
    let mut cell = cell(world());
    cell.client.arm().move_to_joints(&GOAL, &limits(), &CancelToken::default()).expect("arrived");
    assert_eq!(cell.client.arm().joint_values(), Ok(GOAL));
    let functions = cell.control.functions();
    for unwanted in ["sim.setStepping", "sim.setJointTargetPosition"] {
        assert!(!functions.contains(&unwanted.to_owned()), "{unwanted}");
    }
    assert_gentle(&cell.world().track, 2.0);
}

/// Second differences over passes of 0.05 s are within an acceleration.
fn assert_gentle(track: &[f64], most: f64) {
    let start = [0.0; 2];
    let passes: Vec<f64> = start.iter().chain(track).copied().collect();
    for triple in passes.windows(3) {
        let acceleration = (triple[2] - 2.0 * triple[1] + triple[0]) / (0.05 * 0.05);
        assert!(acceleration.abs() <= most + 1e-6, "{acceleration} rad/s² over {triple:?}");
    }
}

#[test]
fn a_motion_of_joints_that_controllers_move_waits_until_they_are_there() {
    let world = world();
    edit(&world, |w| (w.joint_mode, w.follow) = (5, 0.5));
    let mut cell = cell(world);
    cell.client.arm().move_to_joints(&GOAL, &limits(), &CancelToken::default()).expect("arrived");
    let joints = cell.client.arm().joint_values().expect("a call");
    assert!(joints.iter().zip(&GOAL).all(|(a, b)| (a - b).abs() < 1e-4), "{joints:?}");

    edit(&cell.world, |w| w.follow = 0.0);
    let error =
        cell.client.arm().move_to_joints(&[0.0; JOINTS], &limits(), &CancelToken::default()).expect_err("they stand");
    assert!(matches!(error, LinkError::JointElsewhere { .. }), "{error}");
}

#[test]
fn a_cancelled_motion_is_braked_and_not_cut_off() {
    let world = world();
    let cancel = CancelToken::default();
    edit(&world, |w| w.cancel_at_step = Some((12, cancel.clone())));
    let mut cell = cell(world);
    let error = cell.client.arm().move_to_joints(&GOAL, &limits(), &cancel).expect_err("cancelled");
    assert!(matches!(error, LinkError::Cancelled { .. }), "{error}");
    let track = cell.world().track.clone();
    assert_gentle(&track, std::f64::consts::TAU);
    assert!(track.len() > 13 && *track.last().expect("passes") < GOAL[0], "{track:?}");
    assert!(!cell.control.functions().contains(&"sim.setJointTargetPosition".to_owned()), "that would lock the joints");
}

#[test]
fn a_motion_that_is_cancelled_before_it_begins_does_not_begin() {
    let mut cell = cell(world());
    let cancel = CancelToken::default();
    cancel.cancel();
    assert!(matches!(cell.client.arm().move_to_joints(&GOAL, &limits(), &cancel), Err(LinkError::Cancelled { .. })));
    assert!(!cell.control.functions().contains(&"sim.setJointPosition".to_owned()));
}

#[test]
fn a_stop_leaves_joints_alone_that_stand_where_they_were_put() {
    let mut cell = cell(world());
    cell.client.arm().stop().expect("calls");
    assert!(!cell.control.functions().contains(&"sim.setJointTargetPosition".to_owned()));
    // A joint that a target position moves gets its present position as the target.
    edit(&cell.world, |w| (w.joint_mode, w.targets, w.joints) = (5, [1.0; JOINTS], [0.5; JOINTS]));
    cell.client.arm().stop().expect("calls");
    assert_eq!(cell.world().targets, [0.5; JOINTS]);
}

#[test]
fn a_joint_that_takes_no_positions_is_freed_before_a_motion() {
    let world = world();
    edit(&world, |w| w.stuck = Some(2));
    let mut cell = cell(Arc::clone(&world));
    cell.client.arm().move_to_joints(&GOAL, &limits(), &CancelToken::default()).expect("arrived");
    assert_eq!(cell.client.arm().joint_values(), Ok(GOAL));
}

#[test]
fn a_joint_that_is_held_in_a_motion_is_named_with_where_it_stands() {
    let world = world();
    let mut cell = cell(Arc::clone(&world));
    // Something locks it after the first points.
    let holding = Arc::clone(&world);
    let held = std::thread::spawn(move || {
        while holding.lock().unwrap_or_else(PoisonError::into_inner).track.len() < 3 {
            std::thread::yield_now();
        }
        edit(&holding, |w| w.stuck = Some(4));
    });
    let slow = MotionLimits::uniform(JOINTS, 1e-3, 2.0, 1.0);
    let error = cell.client.arm().move_to_joints(&GOAL, &slow, &CancelToken::default()).expect_err("held");
    held.join().expect("no panic");
    let LinkError::JointElsewhere { joint: 5, at, goal } = error else { panic!("{error}") };
    assert!(at.value < goal.value && goal.value < GOAL[4], "{at} {goal}");
}

#[test]
fn a_motion_whose_account_breaks_off_is_made_in_one_call() {
    let world = world();
    // The vendor's encoding of a map with 17 numbers as keys, of which it writes a few.
    edit(&world, |w| w.motion_state = Some(b"\xa1\x63ret\x81\xa1\x62ik\x91\x0f\x01".to_vec()));
    let mut cell = cell(world);
    let here = cell.client.arm().base_from_tip().expect("a pose");
    cell.client
        .arm()
        .move_to_pose(&here, &pose_limits(), &MotionTolerance::default(), &CancelToken::default())
        .expect("there");
    assert!(cell.control.functions().contains(&"sim.moveToPose".to_owned()));
}

#[test]
fn a_server_that_dies_in_a_motion_is_reported_without_further_calls() {
    let world = world();
    let mut cell = cell(Arc::clone(&world));
    edit(&world, |w| w.die_in = Some("sim.step"));
    let error = cell.client.arm().move_to_joints(&GOAL, &limits(), &CancelToken::default()).expect_err("died");
    assert_eq!(error, LinkError::Disconnected { call: "sim.step".to_owned() });
    assert_eq!(cell.control.functions().last().map(String::as_str), Some("sim.step"));
}

#[test]
fn nothing_moves_while_the_simulation_does_not_run() {
    for (state, expected) in [(0, SimulationState::Stopped), (8, SimulationState::Paused)] {
        let world = world();
        edit(&world, |w| w.state = state);
        let mut cell = cell(world);
        let error =
            cell.client.arm().move_to_joints(&GOAL, &limits(), &CancelToken::default()).expect_err("not running");
        assert_eq!(error, LinkError::NotRunning { task: "moving the joints", state: expected });
    }
}

#[test]
fn a_goal_out_of_range_is_refused_with_joint_and_range() {
    let mut cell = cell(world());
    let mut goal = GOAL;
    goal[3] = 7.0;
    let error = cell.client.arm().move_to_joints(&goal, &limits(), &CancelToken::default()).expect_err("out of range");
    assert!(matches!(error, LinkError::JointOutOfRange { joint: 4, .. }), "{error}");
    goal[3] = f64::NAN;
    let error = cell.client.arm().move_to_joints(&goal, &limits(), &CancelToken::default()).expect_err("not a number");
    assert!(matches!(error, LinkError::BadMotion { .. }), "{error}");
}

#[test]
fn a_tip_that_did_not_arrive_is_an_error_with_the_distance() {
    let mut cell = cell(world());
    let (tolerance, cancel) = (MotionTolerance::default(), CancelToken::default());
    let here = cell.client.arm().base_from_tip().expect("a pose");
    cell.client.arm().move_to_pose(&here, &pose_limits(), &tolerance, &cancel).expect("already there");
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.1);
    let goal = Pose::from_isometry(nalgebra::Isometry3::from_parts(Vector3::new(0.1, 0.25, 0.9).into(), turn));
    let error =
        cell.client.arm().move_to_pose(&goal, &pose_limits(), &tolerance, &cancel).expect_err("inverse kinematics");
    let LinkError::Unreached { distance_mm, angle_deg } = error else { panic!("{error}") };
    assert_relative_eq!(distance_mm, 50.0, epsilon = 1e-9);
    assert_relative_eq!(angle_deg, 0.1_f64.to_degrees(), epsilon = 1e-9);
}

#[test]
fn settling_waits_for_the_joints_and_tells_how_long() {
    let world = world();
    edit(&world, |w| {
        w.targets = [0.1; JOINTS];
        w.follow = 0.5;
    });
    let mut cell = cell(world);
    let options = SettleOptions { rate_rad_s: 1e-3, limit_s: 5.0, ..SettleOptions::default() };
    let after_s = cell.client.arm().settle(&options, &CancelToken::default()).expect("settles");
    // The travel of pass n is 0.1 / 2ⁿ rad, which is under 5e-5 rad from pass 11 on; two more passes confirm it.
    assert_relative_eq!(after_s, 13.0 * 0.05, epsilon = 1e-9);
    let options = SettleOptions { limit_s: 0.2, ..options };
    cell.world().targets = [1.0; JOINTS];
    let error = cell.client.arm().settle(&options, &CancelToken::default()).expect_err("too short");
    assert!(matches!(error, LinkError::NotSettled { .. }), "{error}");
}

#[test]
fn a_frame_is_of_one_instant_because_the_simulation_is_held() {
    let world = world();
    edit(&world, |w| w.passes_per_image = 1);
    let mut cell = cell(world);
    let frame = cell.client.camera().grab().expect("a frame");
    assert_eq!(frame.sim_time_s, cell.world().time_s, "time stood still");
    assert_eq!(cell.world().held, 0, "and goes on");
    assert_eq!((cell.world().handled, frame.image_age_s), (1, 0.0), "the images show the joints of now");
    assert_eq!((frame.rgb.dimensions(), frame.depth.width, frame.depth.height), ((4, 2), 4, 2));
    assert_eq!(frame.rgb.get_pixel(0, 0).0, [12, 13, 14], "the second row of the buffer is the upper one");
}

#[test]
fn a_server_that_takes_no_images_on_request_is_asked_once() {
    let world = world();
    edit(&world, |w| w.missing.push("sim.handleVisionSensor"));
    let mut cell = cell(world);
    for _ in 0..2 {
        assert_eq!(cell.client.camera().grab().expect("a frame").image_age_s, 0.05);
    }
    let asked = cell.camera.functions().iter().filter(|f| *f == "sim.handleVisionSensor").count();
    assert_eq!(asked, 1);
}

#[test]
fn a_frame_that_fails_does_not_leave_the_simulation_held() {
    let world = world();
    let mut cell = cell(Arc::clone(&world));
    edit(&world, |w| w.missing.push("sim.getVisionSensorDepth"));
    assert!(cell.client.camera().grab().is_err());
    assert_eq!(cell.world().held, 0);

    edit(&world, |w| w.die_in = Some("sim.getVisionSensorImg"));
    let uuid = cell.client.camera().sim().connection().uuid().to_owned();
    assert!(matches!(cell.client.camera().grab(), Err(LinkError::Disconnected { .. })));
    assert_ne!(cell.client.camera().sim().connection().uuid(), uuid, "the record that holds is ended");
}

#[test]
fn frames_and_motions_go_over_two_connections() {
    let mut cell = cell(world());
    cell.client.camera().grab().expect("a frame");
    assert!(!cell.control.functions().contains(&"sim.getVisionSensorImg".to_owned()));
    assert!(cell.camera.functions().contains(&"sim.getVisionSensorImg".to_owned()));
    let (mut arm, mut camera) = cell.client.split();
    let moving = std::thread::spawn(move || arm.move_to_joints(&GOAL, &limits(), &CancelToken::default()));
    camera.grab().expect("a frame");
    moving.join().expect("no panic").expect("arrived");
}

#[test]
fn the_truth_of_the_reference_scene_is_in_opencv_axes() {
    let mut cell = cell(world());
    let truth = cell.client.camera().ground_truth().expect("a scene");
    // Rz(+90°) and 50 mm along x of the tip.
    let x_in_tip = truth.tip_from_camera.rotation() * Vector3::x();
    let ahead_in_tip = truth.tip_from_camera.rotation() * Vector3::z();
    assert_relative_eq!(x_in_tip, Vector3::y(), epsilon = 1e-12);
    assert_relative_eq!(ahead_in_tip, Vector3::z(), epsilon = 1e-12);
    assert_relative_eq!(truth.tip_from_camera.translation(), Vector3::new(0.05, 0.0, 0.0), epsilon = 1e-12);
    assert_eq!((truth.base_from_target, truth.intrinsics_published), (None, false));
    assert_eq!(truth.intrinsics, cell.client.info().camera_intrinsics_nominal());
}

#[test]
fn what_the_cell_publishes_goes_before_what_the_scene_shows() {
    let intrinsics = Intrinsics {
        distortion: handeye_geometry::camera::Distortion::BrownConrady([0.1, 0.0, 0.001, 0.0, 0.0]),
        ..Intrinsics::pinhole(4, 2, 3.7)
    };
    let base_from_target = Pose::from_translation_xyzw([0.0, -0.4, 0.8], [0.0, 0.0, 1.0, 0.0]);
    let published = wire::map([
        (
            "intrinsics",
            wire::map([
                ("width", Value::from(4)),
                ("height", Value::from(2)),
                ("fx", Value::Float(3.7)),
                ("fy", Value::Float(3.7)),
                ("cx", Value::Float(1.5)),
                ("cy", Value::Float(0.5)),
                ("model", Value::from("brown_conrady")),
                ("distortion", wire::floats([0.1, 0.0, 0.001, 0.0, 0.0])),
            ]),
        ),
        ("base_from_target", wire::floats([0.0, -0.4, 0.8, 0.0, 0.0, 1.0, 0.0])),
    ]);
    let world = world();
    edit(&world, |w| w.truth = Some(published));
    let mut cell = cell(Arc::clone(&world));
    let truth = cell.client.camera().ground_truth().expect("published");
    assert_eq!((truth.intrinsics, truth.intrinsics_published), (intrinsics, true));
    let (distance_m, angle_rad) = truth.base_from_target.expect("published").distance_to(&base_from_target);
    assert!(distance_m < 1e-15 && angle_rad < 1e-7);

    for bad in [
        wire::map([("intrinsics", Value::from(3))]),
        wire::map([("base_from_target", wire::floats([0.0, 1.0]))]),
        wire::map([("tip_from_camera", wire::floats([f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))]),
    ] {
        edit(&world, |w| w.truth = Some(bad));
        assert!(matches!(cell.client.camera().ground_truth(), Err(LinkError::BadTruth { .. })));
    }
}

#[path = "moment_tests.rs"]
mod moment;
#[path = "wait_tests.rs"]
mod wait;
