//! Following a moving goal, against the real cell over a socket.

use std::sync::mpsc::channel;

use handeye_arm::JointValues;
use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{
    Arm, ArmKinematics, CellPaths, FollowEnd, FollowGoal, FollowLimits, FollowMoment, FollowRequest, MotionTolerance,
    Workspace,
};
use handeye_coppeliasim::{
    CallOptions, CancelToken, ConnectionOptions, Endpoint, LinkError, MotionLimits, ObjectHandle, SimulationState,
};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_server::{CellConfig, CellServer};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const TIME_STEP_S: f64 = 0.05;

struct Bench {
    server: CellServer,
    arm: Arm,
    kinematics: ArmKinematics,
}

impl Bench {
    /// A cell whose passes come only when the arm's client steps: the same numbers on every machine.
    fn stepped() -> Self {
        let mut bench = Self::running();
        bench.arm.sim().set_stepping(true).expect("a call");
        bench
    }

    fn running() -> Self {
        let config = CellConfig { real_time: Some(false), ..CellConfig::new(Scene::reference().expect("valid")) };
        let server = CellServer::start(config).expect("a free port");
        let mut arm = connect(&server);
        arm.sim().start_simulation().expect("a call");
        let kinematics = arm.kinematics().expect("calls").expect("it is the UR5");
        Self { server, arm, kinematics }
    }

    fn tip(&mut self) -> Pose<Base, Tip> {
        self.arm.base_from_tip().expect("a call")
    }

    fn target(&mut self) -> Pose<Base, Tip> {
        let sim = self.arm.sim();
        let dummy = sim.get_object("/UR5/Target").expect("the scene has one");
        sim.get_object_pose(dummy, ObjectHandle::WORLD).expect("a call")
    }

    fn follow(&mut self, request: &mut dyn FnMut(&FollowMoment) -> FollowRequest) -> Result<FollowEnd, LinkError> {
        self.arm.follow(&self.kinematics, &FollowLimits::default(), request)
    }
}

fn connect(server: &CellServer) -> Arm {
    let endpoint: Endpoint = server.endpoint().parse().expect("an address");
    Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("the scene is whole")
}

fn still(base_from_tip: Pose<Base, Tip>) -> FollowGoal {
    FollowGoal { base_from_tip, velocity_m_s: Vector3::zeros(), angular_velocity_rad_s: Vector3::zeros() }
}

fn shifted(start: &Pose<Base, Tip>, by: Vector3<f64>) -> Pose<Base, Tip> {
    Pose::from_isometry(Translation3::from(by) * start.isometry())
}

/// A goal on an upright circle below `start`, swinging about the vertical by 0.2 rad meanwhile.
fn on_circle(start: &Pose<Base, Tip>, radius_m: f64, speed_m_s: f64, time_s: f64) -> FollowGoal {
    let (sin, cos) = (speed_m_s / radius_m * time_s).sin_cos();
    let at = start.translation() + Vector3::new(0.0, sin, cos - 1.0) * radius_m;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::z() * 0.2 * time_s.sin()) * start.rotation();
    FollowGoal {
        base_from_tip: Pose::from_isometry(Isometry3::from_parts(Translation3::from(at), rotation)),
        velocity_m_s: Vector3::new(0.0, cos, -sin) * speed_m_s,
        angular_velocity_rad_s: Vector3::z() * 0.2 * time_s.cos(),
    }
}

/// What a second client has seen, once per pass.
#[derive(Default)]
struct Seen {
    points: Vec<(f64, JointValues)>,
}

impl Seen {
    fn look(&mut self, watch: &mut Arm) -> (f64, JointValues) {
        let now = (watch.sim().get_simulation_time().expect("a call"), watch.joint_values().expect("a call"));
        self.points.push(now);
        now
    }

    /// That every pass was seen, that no limit was exceeded from one to the next, and that the arm is at rest in the
    /// end.
    fn check(&self, kinematics: &ArmKinematics, limits: &FollowLimits, what: &str) {
        let near = |value: f64, limit: f64| value <= limit * 1.00001 + 1e-6;
        let largest = |q: JointValues| q.iter().fold(0.0, |most: f64, q| most.max(q.abs()));
        let mut before = (JointValues::zeros(6), Vector3::zeros(), Vector3::zeros());
        for pair in self.points.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            assert!((to.0 - from.0 - TIME_STEP_S).abs() < 1e-9, "{what}: a pass was missed at {} s", from.0);
            let (tip_from, tip_to) = (kinematics.tip(&from.1), kinematics.tip(&to.1));
            let rates = JointValues::from_fn(6, |i| (to.1[i] - from.1[i]) / TIME_STEP_S);
            let velocity = (tip_to.translation() - tip_from.translation()) / TIME_STEP_S;
            let turn = (tip_to.rotation() * tip_from.rotation().inverse()).scaled_axis() / TIME_STEP_S;
            let joint_change = largest(JointValues::from_fn(6, |i| (rates[i] - before.0[i]) / TIME_STEP_S));
            let change = (velocity - before.1).norm() / TIME_STEP_S;
            let turn_change = (turn - before.2).norm() / TIME_STEP_S;
            let context = format!("{what}, {} s", to.0);
            assert!(near(largest(rates), limits.joint_speed_rad_s), "{context}: {rates:?} rad/s");
            assert!(near(joint_change, limits.joint_acceleration_rad_s2), "{context}: {joint_change} rad/s²");
            assert!(near(velocity.norm(), limits.speed_m_s), "{context}: {velocity:?} m/s");
            assert!(near(change, limits.acceleration_m_s2), "{context}: {change} m/s²");
            assert!(near(turn.norm(), limits.turn_rad_s), "{context}: {turn:?} rad/s");
            assert!(near(turn_change, limits.turn_acceleration_rad_s2), "{context}: {turn_change} rad/s²");
            before = (rates, velocity, turn);
        }
        assert!(before.0.iter().all(|rate| *rate == 0.0), "{what}: it stands in the end, {before:?}");
    }
}

#[test]
fn the_tip_moves_along_with_a_goal_on_a_circle() {
    let mut bench = Bench::stepped();
    let mut watch = connect(&bench.server);
    let (start, kinematics) = (bench.tip(), bench.kinematics.clone());
    let (mut seen, mut lags_mm) = (Seen::default(), Vec::new());
    let begin_s = bench.arm.sim().get_simulation_time().expect("a call");
    let circle = |sim_time_s: f64| on_circle(&start, 0.08, 0.05, sim_time_s - begin_s);
    let end = bench.follow(&mut |moment| {
        let (now_s, joints) = seen.look(&mut watch);
        let after_s = now_s - begin_s;
        let (lag_m, _) = kinematics.tip(&joints).distance_to(&circle(now_s).base_from_tip);
        // In the first second it catches up with a goal that did not wait.
        if after_s > 1.0 {
            lags_mm.push(lag_m * 1e3);
        }
        if after_s > 11.0 { FollowRequest::End } else { FollowRequest::Towards(circle(moment.sim_time_s)) }
    });
    assert_eq!(end, Ok(FollowEnd::Released));
    // Samples of the last second are after the release.
    let followed = &lags_mm[..200.min(lags_mm.len())];
    let rms_mm = (followed.iter().map(|lag| lag * lag).sum::<f64>() / followed.len() as f64).sqrt();
    let worst_mm = followed.iter().copied().fold(0.0, f64::max);
    println!("lag at 50 mm/s: RMS {rms_mm:.4} mm, at most {worst_mm:.4} mm in {} passes", followed.len());
    assert!(followed.len() >= 199 && worst_mm < 1.0, "{worst_mm} mm");
    seen.look(&mut watch);
    bench.arm.sim().step(&CallOptions::default()).expect("a pass");
    seen.look(&mut watch);
    seen.check(&kinematics, &FollowLimits::default(), "circle");
}

/// How a trial ends.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Taken {
    Rest,
    End,
    Stop,
}

#[test]
fn whenever_the_goal_is_taken_away_or_stop_is_pressed_the_arm_comes_to_rest_within_its_limits() {
    let mut bench = Bench::stepped();
    let mut other = connect(&bench.server);
    let (start, kinematics) = (bench.tip(), bench.kinematics.clone());
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut slowest_rest = 0;
    for trial in 0..36 {
        let taken = [Taken::Rest, Taken::End, Taken::Stop][trial % 3];
        let (until, again) = (rng.random_range(0..40), rng.random_range(1..12));
        let radius_m = rng.random_range(0.05..0.15);
        let speed_m_s = rng.random_range(0.02..0.3);
        let jump = Vector3::from_fn(|_, _| rng.random_range(-0.1..0.1));
        let jump_at = rng.random_range(0..40);
        let (mut seen, mut pass, mut since_taken) = (Seen::default(), 0, 0);
        let mut begin_s = None;
        let end = bench.follow(&mut |moment| {
            seen.look(&mut other);
            let after_s = moment.sim_time_s - *begin_s.get_or_insert(moment.sim_time_s);
            pass += 1;
            let mut goal = on_circle(&start, radius_m, speed_m_s, after_s);
            if pass > jump_at {
                goal.base_from_tip = shifted(&goal.base_from_tip, jump);
            }
            if pass <= until {
                return FollowRequest::Towards(goal);
            }
            since_taken += 1;
            match taken {
                // It rests for some passes, moves again, and then rests finally.
                Taken::Rest if since_taken <= again || (2 * again..2 * again + 15).contains(&since_taken) => {
                    FollowRequest::Rest
                }
                Taken::Rest if since_taken < 2 * again => FollowRequest::Towards(goal),
                Taken::Rest | Taken::End => FollowRequest::End,
                Taken::Stop => {
                    if since_taken == 1 {
                        other.stop().expect("a call");
                    }
                    FollowRequest::Towards(goal)
                }
            }
        });
        let expected = if taken == Taken::Stop { FollowEnd::Stopped } else { FollowEnd::Released };
        let what = format!("trial {trial}, {taken:?} after {until} passes");
        assert_eq!(end, Ok(expected), "{what}");
        if taken != Taken::Rest {
            slowest_rest = slowest_rest.max(since_taken);
        }
        seen.look(&mut other);
        bench.arm.sim().step(&CallOptions::default()).expect("a pass");
        seen.look(&mut other);
        seen.check(&kinematics, &FollowLimits::default(), &what);
        let (distance_m, angle_rad) = bench.tip().distance_to(&bench.target());
        assert!(distance_m < 1e-9 && angle_rad < 1e-7, "{what}: the target dummy is {distance_m} m from the tip");
    }
    println!("at rest after at most {slowest_rest} passes");
    assert!(slowest_rest <= 10, "{slowest_rest} passes");
}

#[test]
fn the_target_dummy_shows_the_goal_and_a_motion_to_a_pose_works_afterwards() {
    let mut bench = Bench::stepped();
    let mut other = connect(&bench.server);
    let dummy = other.sim().get_object("/UR5/Target").expect("the scene has one");
    let goal = shifted(&bench.tip(), Vector3::new(0.02, -0.05, 0.03));
    let (mut passes, mut shown) = (0, None);
    let end = bench.follow(&mut |_| {
        passes += 1;
        if passes == 2 {
            shown = Some(other.sim().get_object_pose(dummy, ObjectHandle::WORLD).expect("a call"));
        }
        if passes < 60 { FollowRequest::Towards(still(goal)) } else { FollowRequest::End }
    });
    assert_eq!(end, Ok(FollowEnd::Released));
    let (distance_m, angle_rad) = shown.expect("two passes").distance_to(&goal);
    assert!(distance_m < 1e-9 && angle_rad < 1e-7, "{distance_m} m, {angle_rad} rad");
    let (distance_m, angle_rad) = bench.tip().distance_to(&goal);
    assert!(distance_m < 1e-5 && angle_rad < 1e-5, "it has arrived: {distance_m} m, {angle_rad} rad");
    let back = shifted(&goal, Vector3::new(0.0, 0.05, 0.0));
    let limits = MotionLimits::uniform(4, 0.5, 2.0, 20.0);
    bench.arm.move_to_pose(&back, &limits, &MotionTolerance::default(), &CancelToken::default()).expect("it is near");
}

#[test]
fn a_goal_that_leaves_the_workspace_leaves_the_arm_standing_inside() {
    let mut bench = Bench::stepped();
    let start = bench.tip();
    let at = Point3::from(start.translation());
    let reach = Vector3::new(0.3, 0.3, 0.04);
    let workspace = Workspace { min: at - reach, max: at + reach };
    let limits = FollowLimits { workspace, ..FollowLimits::default() };
    let velocity_m_s = Vector3::new(0.0, 0.0, 0.1);
    let mut begin_s = None;
    let end = bench.arm.follow(&bench.kinematics, &limits, &mut |moment| {
        let after_s = moment.sim_time_s - *begin_s.get_or_insert(moment.sim_time_s);
        let goal = shifted(&start, velocity_m_s * after_s);
        FollowRequest::Towards(FollowGoal { velocity_m_s, ..still(goal) })
    });
    assert_eq!(end, Ok(FollowEnd::Workspace));
    let inside_m = (at.z + reach.z) - bench.tip().translation().z;
    assert!((0.0..0.02).contains(&inside_m), "{inside_m} m before the wall");
}

#[test]
fn following_gives_way_when_somebody_else_moves_a_joint() {
    let mut bench = Bench::stepped();
    let mut other = connect(&bench.server);
    let joint = other.sim().get_object_index("/UR5/joint", 3).expect("a joint");
    let goal = shifted(&bench.tip(), Vector3::new(0.0, 0.1, 0.0));
    let mut passes = 0;
    let end = bench.follow(&mut |_| {
        passes += 1;
        if passes == 5 {
            other.sim().set_joint_position(joint, -1.0).expect("a call");
        }
        FollowRequest::Towards(still(goal))
    });
    assert_eq!(end, Ok(FollowEnd::NotFollowing { joint: 4 }));
    assert!((bench.arm.joint_values().expect("a call")[3] + 1.0).abs() < 1e-9, "the other has its way");
}

#[test]
fn nothing_moves_for_another_tip_or_limits_without_sense() {
    let mut bench = Bench::stepped();
    let before = bench.arm.joint_values().expect("a call");
    let goal = shifted(&bench.tip(), Vector3::new(0.0, 0.1, 0.0));
    let limits = FollowLimits { joint_speed_rad_s: 0.0, ..FollowLimits::default() };
    let mut asked = 0;
    let mut request = |_: &FollowMoment| {
        asked += 1;
        FollowRequest::Towards(still(goal))
    };
    let error = bench.arm.follow(&bench.kinematics, &limits, &mut request).expect_err("no speed");
    assert!(matches!(error, LinkError::BadMotion { what: "the speed of the joints", .. }), "{error}");
    let tip = bench.arm.sim().get_object("/UR5/Tip").expect("the tip");
    let moved = Pose::<Base, Tip>::from_translation_xyzw([0.0, 0.0, 0.1], [0.0, 0.0, 0.0, 1.0]);
    bench.arm.sim().set_object_pose(tip, ObjectHandle::PARENT, &moved).expect("a call");
    assert_eq!(bench.follow(&mut request), Ok(FollowEnd::OtherTip));
    assert_eq!(asked, 0);
    assert_eq!(bench.arm.joint_values().expect("a call"), before);
}

#[test]
fn a_goal_that_is_no_pose_is_an_error_with_the_arm_at_rest() {
    let mut bench = Bench::stepped();
    let mut other = connect(&bench.server);
    let kinematics = bench.kinematics.clone();
    let goal = still(shifted(&bench.tip(), Vector3::new(0.0, 0.1, 0.0)));
    let mut seen = Seen::default();
    let end = bench.follow(&mut |_| {
        seen.look(&mut other);
        let velocity_m_s = Vector3::new(0.0, if seen.points.len() < 8 { 0.0 } else { f64::NAN }, 0.0);
        FollowRequest::Towards(FollowGoal { velocity_m_s, ..goal })
    });
    assert!(matches!(end, Err(LinkError::BadMotion { what: "the goal", .. })), "{end:?}");
    seen.look(&mut other);
    bench.arm.sim().step(&CallOptions::default()).expect("a pass");
    seen.look(&mut other);
    seen.check(&kinematics, &FollowLimits::default(), "no pose");
}

#[test]
fn following_ends_when_the_simulation_does() {
    let mut bench = Bench::running();
    let mut other = connect(&bench.server);
    let goal = still(shifted(&bench.tip(), Vector3::new(0.0, 0.1, 0.0)));
    let mut passes = 0;
    let end = bench.follow(&mut |_| {
        passes += 1;
        if passes == 5 {
            other.sim().stop_simulation().expect("a call");
        }
        FollowRequest::Towards(goal)
    });
    // The start is restored, and nothing is sent after it; nobody else moved the joints.
    assert!(matches!(end, Err(LinkError::NotRunning { state: SimulationState::Stopped, .. })), "{end:?}");
}

#[test]
fn a_client_that_misses_passes_takes_no_larger_steps() {
    // Passes follow each other as fast as they can, and this caller is slow.
    let mut bench = Bench::running();
    let mut other = connect(&bench.server);
    let start = bench.tip();
    let (mut points, mut times_s) = (Vec::new(), Vec::new());
    let end = bench.follow(&mut |moment| {
        for _ in 0..points.len() % 5 {
            other.sim().step(&CallOptions::default()).expect("a pass");
        }
        points.push(moment.joints);
        times_s.push(moment.sim_time_s);
        if points.len() < 80 {
            FollowRequest::Towards(on_circle(&start, 0.1, 0.2, moment.sim_time_s))
        } else {
            FollowRequest::End
        }
    });
    assert_eq!(end, Ok(FollowEnd::Released));
    assert!(times_s.windows(2).any(|pair| pair[1] - pair[0] > 1.5 * TIME_STEP_S), "no pass was missed");
    let limit = FollowLimits::default().joint_speed_rad_s * TIME_STEP_S;
    for pair in points.windows(2) {
        let step = (0..6).map(|i| (pair[1][i] - pair[0][i]).abs()).fold(0.0, f64::max);
        assert!(step <= limit * 1.00001, "{step} rad in a pass");
    }
}

#[test]
fn a_client_that_dies_leaves_a_standing_arm() {
    let Bench { server, mut arm, kinematics } = Bench::running();
    let mut watch = connect(&server);
    let start = arm.base_from_tip().expect("a call");
    let (died, death) = channel();
    let dying = std::thread::spawn(move || {
        let mut passes = 0;
        let goal = still(shifted(&start, Vector3::new(0.0, 0.2, 0.0)));
        let _never = arm.follow(&kinematics, &FollowLimits::default(), &mut |_| {
            passes += 1;
            if passes > 12 {
                died.send(()).expect("the test waits");
                // Its sockets are closed as the thread unwinds, without a message to the server.
                std::panic::resume_unwind(Box::new("this client dies"));
            }
            FollowRequest::Towards(goal)
        });
    });
    death.recv_timeout(std::time::Duration::from_mins(1)).expect("it moves and dies");
    assert!(dying.join().is_err());
    let stands = watch.joint_values().expect("a call");
    let moved_m = start.distance_to(&watch.base_from_tip().expect("a call")).0;
    assert!(moved_m > 1e-3, "it was on its way, {moved_m} m from its start");
    for _ in 0..20 {
        watch.sim().step(&CallOptions::default()).expect("a pass");
        assert_eq!(watch.joint_values().expect("a call"), stands);
    }
}
