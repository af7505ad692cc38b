//! The workers with the real cell, over sockets.

use std::path::Path;
use std::thread::JoinHandle;

use handeye_arm::{JointKind, JointValues};
use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{Arm, CellPaths};
use handeye_coppeliasim::{CallOptions, ConnectionOptions, Endpoint, Sim, SimulationState};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_geometry::frames::Base;
use handeye_plan::Obstacle;
use handeye_server::{CellConfig, CellServer};
use handeye_wire as wire;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::motion_tests::Bench;
use super::*;
use crate::model::{Axis, JogFrame, Link, LinkState, MotionGoal, MotionOutcome};
use crate::motion::jog_line::HELD_S;
use crate::text::Language;
use crate::worker::fake::FakeCell;
use handeye_link::{CameraPort, Connected, ControlPort, MotionPort, PortError, RemoteCell};

/// Only a failure takes this long.
const PATIENCE: Duration = Duration::from_mins(1);

struct Live {
    server: CellServer,
    bench: Bench,
    /// Another client, to look with.
    watch: Arm,
}

fn server(real_time: bool) -> CellServer {
    let scene = Scene::reference().expect("valid");
    CellServer::start(CellConfig { real_time: Some(real_time), ..CellConfig::new(scene) }).expect("a free port")
}

fn source(server: &CellServer) -> CellSource {
    CellSource::Address(server.endpoint())
}

fn arm(server: &CellServer) -> Arm {
    let endpoint: Endpoint = server.endpoint().parse().expect("an address");
    Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("the scene is whole")
}

impl Live {
    fn new(real_time: bool) -> Self {
        let server = server(real_time);
        let connector: Arc<dyn Cell> = Arc::new(RemoteCell::at(server.endpoint(), CellPaths::default()));
        Self::with(server, &connector)
    }

    fn with(server: CellServer, connector: &Arc<dyn Cell>) -> Self {
        let mut watch = arm(&server);
        watch.sim().start_simulation().expect("a call");
        let bench = Bench::start(&source(&server), connector);
        Self { server, bench, watch }
    }

    fn joints(&mut self) -> JointValues {
        self.watch.joint_values().expect("a call")
    }

    fn tip(&mut self) -> Pose<Base, Tip> {
        self.watch.base_from_tip().expect("a call")
    }

    /// Waits until the first joint is past a position.
    fn wait_until_moving(&mut self, start: &JointValues) {
        let deadline = Instant::now() + PATIENCE;
        while self.joints() == *start {
            assert!(Instant::now() < deadline, "nothing moves");
        }
    }

    /// Whether nothing moves over a few passes.
    fn is_at_rest(&mut self) -> bool {
        let before = self.joints();
        for _ in 0..5 {
            self.watch.sim().step(&CallOptions::default()).expect("a pass");
        }
        self.joints() == before
    }
}

/// Another client's long motion: one call that returns when it is over.
fn long_motion(server: &CellServer) -> JoinHandle<()> {
    let endpoint: Endpoint = server.endpoint().parse().expect("an address");
    std::thread::spawn(move || {
        let mut sim = Sim::connect(&endpoint, ConnectionOptions::default()).expect("a socket");
        let joints = (0..6).map(|i| sim.get_object_index("/UR5/joint", i).expect("a joint").0).collect::<Vec<_>>();
        let motion = wire::map([
            ("joints", wire::integers(joints)),
            ("targetPos", wire::floats([3.0, 0.8, -1.0, 0.0, 1.5, 0.0])),
            ("maxVel", wire::floats([1e-3; 6])),
            ("maxAccel", wire::floats([1.0; 6])),
            ("maxJerk", wire::floats([10.0; 6])),
        ]);
        let patient = CallOptions::long(PATIENCE, &CancelToken::default());
        sim.connection().call_with("sim.moveToConfig", vec![motion], &patient).expect("it ends");
    })
}

#[test]
fn a_cell_of_this_project_is_called_so_and_its_facts_are_known() {
    let mut live = Live::new(false);
    let facts = live.bench.facts();
    assert!(facts.arm.is_some());
    let truth = facts.truth.expect("the cell publishes it");
    assert!((truth.tip_from_camera.translation().x - 0.05).abs() < 1e-12);
    let turn = crate::model::JointFacts {
        kind: JointKind::Revolute,
        range: Some([-std::f64::consts::TAU, std::f64::consts::TAU]),
    };
    assert_eq!(facts.joints, [turn; 6]);
    let connector = RemoteCell::at(live.server.endpoint(), CellPaths::default());
    let connected = connector.motion(&CancelToken::default()).expect("it is there");
    assert_eq!(connected.server, "Handeye cell");
}

#[test]
fn what_is_out_of_reach_is_refused_with_the_reason_and_nothing_moves() {
    let mut live = Live::new(false);
    let before = live.joints();
    let mut far = live.tip();
    far = Pose::from_isometry(nalgebra::Translation3::new(2.0, 0.0, 0.0) * far.isometry());
    live.bench.move_to(1, MotionGoal::Tip(far), 1.0);
    let MotionOutcome::Refused(why) = live.bench.moved(1) else { panic!("it was not refused") };
    let why = why.in_language(Language::English);
    assert!(why.contains("cannot go there") && why.contains("closer to the robot"), "{why}");
    let mut turned = before;
    turned[2] = 7.0;
    live.bench.move_to(2, MotionGoal::Joints(turned), 1.0);
    let MotionOutcome::Refused(why) = live.bench.moved(2) else { panic!("it was not refused") };
    assert!(why.in_language(Language::English).contains("Joint 3"), "{why:?}");
    live.bench.move_to(3, MotionGoal::Joints(before), 1.5);
    assert!(matches!(live.bench.moved(3), MotionOutcome::Refused(_)), "150 % is no speed");
    assert_eq!(live.joints(), before);
}

#[test]
fn nothing_moves_while_the_simulation_rests_and_the_reason_is_told() {
    let mut live = Live::new(false);
    live.watch.sim().stop_simulation().expect("a call");
    while live.watch.sim().get_simulation_state().expect("a call") != SimulationState::Stopped {}
    live.bench.move_to(1, MotionGoal::Joints([0.0; 6].into()), 1.0);
    // No other pose would work better: a sequence ends with it.
    let MotionOutcome::Failed(why) = live.bench.moved(1) else { panic!("it did not fail") };
    assert!(why.in_language(Language::English).contains("stopped"), "{why:?}");
    live.bench.workers.hold_jog(Jog::Joint { index: 0, forward: true }, 0.5, None);
    assert!(live.bench.jog_ended().expect("a reason").contains("stopped"));
}

#[test]
fn a_stop_brings_the_motion_of_another_client_to_rest() {
    let mut live = Live::new(true);
    let start = live.joints();
    let other = long_motion(&live.server);
    live.wait_until_moving(&start);
    live.bench.workers.press_stop();
    live.bench.stopped();
    other.join().expect("its call returns, an hour before its time");
    assert!(live.is_at_rest());
}

#[test]
fn a_stop_ends_our_own_motion_where_it_is() {
    let mut live = Live::new(true);
    let start = live.joints();
    let mut goal = start;
    goal[0] += 3.0;
    live.bench.move_to(1, MotionGoal::Joints(goal), 0.5);
    live.wait_until_moving(&start);
    live.bench.workers.press_stop();
    assert_eq!(live.bench.moved(1), MotionOutcome::Stopped);
    assert!(live.is_at_rest());
    assert!((live.joints()[0] - goal[0]).abs() > 1.0);
}

#[test]
fn the_arm_does_not_go_into_a_box_that_a_person_keeps_it_out_of() {
    let mut live = Live::new(false);
    let (start, tip) = (live.joints(), live.tip());
    let mut goal = start;
    goal[0] += 1.0;
    let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.0) * tip.translation();
    let post = Obstacle::new("post", Isometry3::translation(turned.x, turned.y, turned.z), [0.1; 3]);
    live.bench.workers.keep_out(Arc::new(Surroundings::of(vec![post])));
    live.bench.move_to(1, MotionGoal::Joints(goal), 0.5);
    let MotionOutcome::Refused(why) = live.bench.moved(1) else { panic!("it goes into the post") };
    assert!(why.in_language(Language::English).contains("post"), "{}", why.in_language(Language::English));
    assert_eq!(live.joints(), start);
    live.bench.workers.keep_out(Arc::default());
    live.bench.move_to(3, MotionGoal::Joints(goal), 1.0);
    assert_eq!(live.bench.moved(3), MotionOutcome::Arrived);
}

#[test]
fn a_stop_works_while_the_connection_for_motions_hangs() {
    /// Control is real, motions hang for ever.
    struct Half {
        live: RemoteCell,
        fake: FakeCell,
    }
    impl Cell for Half {
        fn control(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn ControlPort>>, PortError> {
            self.live.control(shutdown)
        }
        fn camera(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn CameraPort>>, PortError> {
            self.live.camera(shutdown)
        }
        fn motion(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn MotionPort>>, PortError> {
            self.fake.motion(shutdown)
        }
    }
    let server = server(true);
    let (fake, release) = FakeCell::that_never_answers();
    let connector: Arc<dyn Cell> =
        Arc::new(Half { live: RemoteCell::at(server.endpoint(), CellPaths::default()), fake });
    let mut live = Live::with(server, &connector);
    live.bench.move_to(1, MotionGoal::Joints([0.0; 6].into()), 1.0);
    let start = live.joints();
    let other = long_motion(&live.server);
    live.wait_until_moving(&start);
    live.bench.workers.press_stop();
    live.bench.stopped();
    other.join().expect("its call returns");
    assert!(live.is_at_rest());
    drop(release);
}

#[test]
fn a_held_joint_moves_and_stands_when_it_is_let_go() {
    let mut live = Live::new(true);
    let start = live.joints();
    live.bench.workers.hold_jog(Jog::Joint { index: 0, forward: true }, 0.5, None);
    live.wait_until_moving(&start);
    live.bench.workers.release_jog();
    assert_eq!(live.bench.jog_ended(), None);
    assert!(live.is_at_rest());
    let now = live.joints();
    assert!(now[0] > start[0] && now[1..] == start[1..]);
}

#[test]
fn a_window_that_dies_leaves_an_arm_that_stands() {
    let mut live = Live::new(true);
    let start = live.joints();
    live.bench.workers.hold_jog(Jog::Joint { index: 0, forward: true }, 0.5, None);
    live.wait_until_moving(&start);
    live.bench.set_clock(HELD_S + 0.1);
    assert!(live.bench.jog_ended().is_some(), "with a reason");
    assert!(live.is_at_rest());
}

#[test]
fn a_stop_ends_a_jog() {
    let mut live = Live::new(true);
    let start = live.joints();
    live.bench.workers.hold_jog(Jog::Joint { index: 0, forward: true }, 0.5, None);
    live.wait_until_moving(&start);
    live.bench.workers.press_stop();
    assert_eq!(live.bench.jog_ended().as_deref(), Some("The arm was stopped"));
    assert!(live.is_at_rest());
}

#[test]
fn a_step_goes_exactly_as_far_as_it_was_asked_to() {
    let mut live = Live::new(false);
    let before = live.tip();
    let camera = live.bench.facts().truth.expect("published").tip_from_camera;
    let jog = Jog::Translate { frame: JogFrame::Camera, axis: Axis::Z, forward: false };
    live.bench.workers.jog_step(MotionId(1), jog, 0.01, 0.25, Some(camera)).expect("the worker is there");
    assert_eq!(live.bench.moved(1), MotionOutcome::Arrived);
    let moved = live.tip().translation() - before.translation();
    let back = before.rotation() * (camera.rotation() * nalgebra::Vector3::new(0.0, 0.0, -0.01));
    assert!((moved - back).norm() < 1e-7, "{moved} instead of {back}");

    let jog = Jog::Rotate { frame: JogFrame::Camera, axis: Axis::X, forward: true };
    live.bench.workers.jog_step(MotionId(2), jog, 0.1, 0.25, None).expect("the worker is there");
    let MotionOutcome::Refused(why) = live.bench.moved(2) else { panic!("nobody knows the camera") };
    assert!(why.in_language(Language::English).contains("calibrate first"), "{why:?}");
}

#[test]
fn a_server_that_ends_between_two_calls_is_noticed_at_once() {
    let mut live = Live::new(true);
    let Live { server, bench, .. } = &mut live;
    bench.facts();
    drop(std::mem::replace(server, self::server(true)));
    let began = Instant::now();
    let before = bench.next;
    for link in [Link::Control, Link::Motion] {
        bench.next = before;
        bench.until_link(link, |state| matches!(state, LinkState::Lost { .. }));
    }
    // The next call would wait for five seconds for a server to come back.
    assert!(began.elapsed() < Duration::from_secs(3), "{:?}", began.elapsed());
}

/// Moves in real time.
mod slow {
    use super::*;

    /// From a stop to an arm at rest, by the clock of the cell \[s\], on a machine that is not busy.
    const AT_REST_S: f64 = 0.3;

    /// How many stops by the workbench. After every third one, another client requests a stop from the cell: the differences among
    /// those show how late a stop is on a machine that is busy with other things.
    const STOPS: usize = 100;

    /// As the window moves the built-in cell. From twice this speed the arm needs those 0.3 s to brake as hard as it
    /// may.
    const SPEED: f64 = 0.5;

    impl Live {
        fn time_s(&mut self) -> f64 {
            self.watch.sim().get_simulation_time().expect("a call")
        }

        /// Time and joints of one and the same pass.
        fn seen(&mut self) -> (f64, JointValues) {
            let deadline = Instant::now() + PATIENCE;
            let mut before_s = self.time_s();
            loop {
                assert!(Instant::now() < deadline, "no call is answered within a pass");
                let (joints, after_s) = (self.joints(), self.time_s());
                if after_s <= before_s {
                    return (after_s, joints);
                }
                before_s = after_s;
            }
        }

        /// When the arm last moved, once it has been at rest for ten passes.
        fn last_moved_s(&mut self) -> f64 {
            let (mut moved_s, mut joints) = self.seen();
            loop {
                let (now_s, now) = self.seen();
                if now != joints {
                    (moved_s, joints) = (now_s, now);
                }
                if now_s - moved_s > 0.5 {
                    return moved_s;
                }
            }
        }
    }

    /// The worst frame is one that does not end: nothing here takes in what the workers report, draws, or handles a stop
    /// before the arm is at rest.
    #[test]
    fn a_stop_at_any_instant_brings_the_arm_to_rest_in_time_while_the_window_is_in_a_frame() {
        let mut live = Live::new(true);
        let start = live.joints();
        let stop = Arc::clone(live.bench.workers.stop_line());
        // Steele and Vigna's SplitMix64; the same instants every time.
        let mut state = 35_u64;
        let mut random = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut took, mut direct) = (Vec::new(), Vec::new());
        for trial in 0..(STOPS + STOPS / 3) as u64 {
            let at = live.joints();
            let mut goal = start;
            goal[0] += if at[0] > start[0] { -1.2 } else { 1.2 };
            if trial % 8 == 5 {
                let jog = Jog::Joint { index: 0, forward: goal[0] > at[0] };
                live.bench.workers.hold_jog(jog, SPEED, None);
            } else {
                live.bench.move_to(trial, MotionGoal::Joints(goal), SPEED);
            }
            live.wait_until_moving(&at);
            let until_s = live.time_s() + random();
            while live.time_s() < until_s {}
            let pressed_s = live.time_s();
            if trial % 4 == 3 {
                live.watch.sim().connection().call("handeye.stop", Vec::new()).expect("it brakes");
                direct.push(live.last_moved_s() - pressed_s);
                live.bench.moved(trial);
                continue;
            }
            let number = stop.press_outside();
            took.push(live.last_moved_s() - pressed_s);
            // What the window still requests was requested before the stop.
            let stood = live.joints();
            live.bench.move_to(1000 + trial, MotionGoal::Joints(start), 1.0);
            live.bench.workers.hold_jog(Jog::Joint { index: 0, forward: true }, 1.0, None);
            assert!(live.is_at_rest() && live.joints() == stood, "trial {trial}");
            live.bench.workers.release_jog();
            live.bench.moved(1000 + trial);
            stop.note(number);
            while stop.is_barred() {}
        }
        let [took, direct] = [took, direct].map(|mut times: Vec<f64>| {
            times.sort_by(f64::total_cmp);
            times
        });
        let [of_window, of_client] = [&took, &direct].map(|times| (times[times.len() / 2], times[times.len() - 1]));
        println!(
            "at rest after (median, most) {of_window:.3?} s of the cell's time; asked for directly {of_client:.3?} s"
        );
        assert_eq!((took.len(), direct.len()), (STOPS, STOPS / 3));
        // Times are sums of passes, which rounds them.
        let bound_s = AT_REST_S + of_client.1 - of_client.0 + 1e-6;
        assert!(of_window.1 <= bound_s, "{took:?}\ndirectly: {direct:?}");
    }

    #[test]
    fn every_pose_of_the_reference_sequence_is_reached_at_full_and_at_a_quarter_of_the_speed() {
        let mut live = Live::new(false);
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/poses/seed10.toml");
        let sequence = TaughtPoses::read(Path::new(file)).expect("the taught poses");
        let start = JointValues::try_from(&sequence.start_joints_rad.expect("a start")[..]).expect("six joints");
        let mut id = 0;
        for speed in [1.0, 0.25] {
            let goals = sequence.poses.iter().map(|pose| match &pose.goal {
                Goal::Tip(pose) => MotionGoal::Tip(*pose),
                Goal::Joints(joints) => MotionGoal::Joints(JointValues::try_from(&joints[..]).expect("six joints")),
            });
            for goal in std::iter::once(MotionGoal::Joints(start)).chain(goals) {
                id += 1;
                live.bench.move_to(id, goal, speed);
                assert_eq!(live.bench.moved(id), MotionOutcome::Arrived, "{goal:?} at {speed}");
                if let MotionGoal::Tip(pose) = goal {
                    let (distance_m, angle_rad) = live.tip().distance_to(&pose);
                    assert!(distance_m < 1e-3 && angle_rad < 0.01, "{distance_m} m, {angle_rad} rad");
                }
            }
        }
    }
}
