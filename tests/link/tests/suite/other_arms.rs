//! Arms other than the UR5: their chain is read from the running simulation and used to move the tip.

use std::path::Path;

use handeye_arm::JointValues;
use handeye_cell::scene::{ResolvedScene, Scene};
use handeye_coppeliasim::cell::{
    Arm, ArmJog, ArmKinematics, BoardInView, CameraFeed, CellPart, CellPaths, JogAxes, JogEnd, MotionTolerance,
    UnknownKinematics,
};
use handeye_coppeliasim::{CallOptions, CancelToken, ConnectionOptions, LinkError, MotionLimits, ObjectHandle};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_server::{CellConfig, CellServer};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Accuracy of a chain that was read as `f64`; searched joint values agree with a pose to 1e-8.
const READ_M: f64 = 1e-9;
const SEARCHED_M: f64 = 1e-7;

pub struct Bench {
    pub server: CellServer,
    pub arm: Arm,
    pub truth: ResolvedScene,
}

impl Bench {
    pub fn start(scene: Scene) -> Self {
        let truth = scene.resolve(scene.seed).expect("valid");
        let config = CellConfig { real_time: Some(false), ..CellConfig::new(scene) };
        let server = CellServer::start(config).expect("a free port");
        let endpoint = server.endpoint().parse().expect("an address");
        let mut arm =
            Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("it is whole");
        arm.sim().start_simulation().expect("a call");
        arm.sim().set_stepping(true).expect("a call");
        Self { server, arm, truth }
    }

    pub fn shipped(name: &str) -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/scenes").join(name);
        Self::start(Scene::load(&file).unwrap_or_else(|error| panic!("{error}")))
    }

    pub fn kinematics(&mut self) -> ArmKinematics {
        self.arm.kinematics().expect("calls").unwrap_or_else(|unknown| panic!("{unknown}"))
    }

    fn unknown(&mut self) -> UnknownKinematics {
        self.arm.kinematics().expect("calls").expect_err("it is not to be driven along lines")
    }

    pub fn tip(&mut self) -> Pose<Base, Tip> {
        self.arm.base_from_tip().expect("a call")
    }

    pub fn move_joints(&mut self, goal: &[f64]) {
        let limits = MotionLimits::uniform(goal.len(), 3.0, 9.0, 90.0);
        self.arm.move_to_joints(goal, &limits, &CancelToken::default()).expect("there");
    }

    /// The tip is where it is stated to be, also after a motion of all joints away from where the chain was read.
    pub fn assert_known(&mut self, kinematics: &ArmKinematics) {
        let now = self.arm.joint_values().expect("a call");
        let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        self.move_joints(&JointValues::from_fn(now.len(), |i| now[i] + 0.05 * (i as f64 + 1.0) * sign(i)));
        let joints = self.arm.joint_values().expect("a call");
        let (distance_m, angle_rad) = kinematics.tip(&joints).distance_to(&self.tip());
        assert!(distance_m < READ_M && angle_rad < 1e-7, "{distance_m} m, {angle_rad} rad");
    }
}

#[test]
fn an_arm_with_another_upper_arm_than_a_ur5_is_taken_as_it_is() {
    let mut bench = Bench::start(Scene::reference().expect("valid"));
    assert!(bench.kinematics().is_ur5());
    let sim = bench.arm.sim();
    let elbow = sim.get_object_index("/UR5/joint", 2).expect("a joint");
    let in_parent: Pose<Base, Tip> = sim.get_object_pose(elbow, ObjectHandle::PARENT).expect("a pose");
    let longer = Pose::<Base, Tip>::from_isometry(in_parent.isometry() * Translation3::new(0.007, 0.0, 0.0));
    sim.set_object_pose(elbow, ObjectHandle::PARENT, &longer).expect("it can be moved");
    let kinematics = bench.kinematics();
    assert!(!kinematics.is_ur5(), "7 mm are no UR5");
    bench.assert_known(&kinematics);
}

#[test]
fn the_chain_of_an_xarm_is_read_with_its_ranges_and_says_where_the_tip_goes() {
    let mut bench = Bench::shipped("xarm6.toml");
    let kinematics = bench.kinematics();
    assert!(!kinematics.is_ur5());
    for (i, joint) in bench.truth.arm.joints().iter().enumerate() {
        let read = kinematics.arm().joints()[i].range;
        assert!((read.min - joint.range.min).abs() < 1e-12, "joint {}", i + 1);
        assert!((read.max - joint.range.max).abs() < 1e-12, "joint {}", i + 1);
    }
    bench.assert_known(&kinematics);
}

#[test]
fn joints_that_turn_without_end_have_no_ends() {
    let text = "[robot]\nmodel = \"ur3e\"\nstart_joints_deg = [0, -90, 90, -90, -90, 0]\n";
    let mut bench = Bench::start(Scene::from_toml(text).expect("valid"));
    let kinematics = bench.kinematics();
    let ranges = kinematics.arm().ranges();
    assert_eq!((ranges[5].min, ranges[5].max), (f64::NEG_INFINITY, f64::INFINITY));
    assert!(ranges[4].max.is_finite());
    bench.assert_known(&kinematics);
}

#[test]
fn the_tip_of_an_xarm_is_jogged_along_and_about_axes_and_stops_where_it_can_go_no_further() {
    let mut bench = Bench::shipped("xarm6.toml");
    let kinematics = bench.kinematics();
    let before = bench.tip();
    let line = ArmJog::Line { kinematics: &kinematics, axes: JogAxes::Base, along: Vector3::y() };
    assert_eq!(bench.arm.jog(&line, Some(0.05), &mut || Some(1.0)), Ok(JogEnd::Arrived));
    let after = bench.tip();
    assert!((after.translation() - before.translation() - Vector3::y() * 0.05).norm() < SEARCHED_M);
    assert!(before.distance_to(&after).1 < 1e-6);
    let turn = ArmJog::Turn { kinematics: &kinematics, axes: JogAxes::Tip, about: Vector3::z() };
    assert_eq!(bench.arm.jog(&turn, Some(0.3), &mut || Some(1.0)), Ok(JogEnd::Arrived));
    let turned = after.rotation().inverse() * bench.tip().rotation();
    assert!((turned.scaled_axis() - Vector3::z() * 0.3).norm() < 1e-6);
    let up = ArmJog::Line { kinematics: &kinematics, axes: JogAxes::Base, along: Vector3::z() };
    let end = bench.arm.jog(&up, None, &mut || Some(1.0)).expect("calls");
    assert!(matches!(end, JogEnd::Obstacle(_)), "{end:?}");
    // It is indeed the limit: a little higher there is no solution, from wherever the search starts.
    let here = bench.tip();
    assert!(here.translation().z > after.translation().z + 0.05, "{here:?}");
    let arm_from_tip = bench.truth.world_from_arm.inverse() * Translation3::new(0.0, 0.0, 0.05) * here.isometry();
    let connection = Pose::from_isometry(arm_from_tip * bench.truth.connection_from_tip.inverse());
    for near in [[0.0; 6], [0.0, -0.5, -1.0, 0.0, 1.6, 0.0], [3.0, -1.0, -2.0, 2.0, -1.0, 1.0]] {
        assert!(bench.truth.arm.inverse(&connection, &near).is_err(), "from {near:?}");
    }
}

#[test]
fn a_typed_goal_of_an_xarm_is_checked_and_reached_along_a_line() {
    let mut bench = Bench::shipped("xarm6.toml");
    let kinematics = bench.kinematics();
    let start = bench.tip();
    let turn = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3);
    let goal = Pose::from_isometry(Isometry3::from_parts(
        Translation3::from(start.translation() + Vector3::new(0.05, 0.08, -0.06)),
        start.rotation() * turn,
    ));
    let joints = bench.arm.joint_values().expect("a call");
    let found = kinematics.reach(&goal, &joints).expect("it is in reach");
    assert_eq!(bench.truth.arm.first_violation(&found), None);
    let limits = MotionLimits::uniform(4, 0.5, 2.0, 20.0);
    // Tighter than any server's inverse kinematics.
    let tolerance = MotionTolerance { distance_m: SEARCHED_M, angle_rad: 1e-6 };
    bench.arm.sim().set_stepping(false).expect("a call");
    bench.arm.move_to_pose(&goal, &limits, &tolerance, &CancelToken::default()).expect("there");
    let far = Pose::from_isometry(Translation3::new(1.5, 0.0, 0.0) * goal.isometry());
    let refused = kinematics.reach(&far, &joints).expect_err("nobody reaches so far").to_string();
    assert!(refused.contains("mm"), "{refused}");
}

#[test]
fn views_of_a_board_are_planned_for_an_xarm() {
    let mut bench = Bench::shipped("xarm6.toml");
    let kinematics = bench.kinematics();
    let start = bench.arm.joint_values().expect("a call");
    let truth = &bench.truth;
    let board = BoardInView {
        base_from_target: truth.base_from_target,
        target: truth.target,
        intrinsics: truth.intrinsics,
        tip_from_camera: truth.tip_from_camera,
    };
    let views = kinematics
        .views_unlike(&board, &[], &start, &kinematics.plane(), 5, 1)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(views.len(), 5);
    for joints in views {
        let camera_from_target = truth.camera_from_target(&truth.reported_tip(&joints).expect("six joints"));
        for point in truth.target.points() {
            let px = truth.intrinsics.project(&(camera_from_target.isometry() * point)).expect("in front");
            assert!(truth.intrinsics.contains(&px), "{px}");
        }
    }
}

/// Its joints are published with every image.
#[test]
fn the_camera_of_an_arm_with_seven_joints_is_seen() {
    let mut bench = Bench::shipped("panda.toml");
    let endpoint = bench.server.endpoint().parse().expect("an address");
    let mut camera =
        CameraFeed::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("whole");
    for _ in 0..5 {
        bench.arm.sim().step(&CallOptions::default()).expect("a call");
    }
    let frame = camera.grab().expect("an image");
    let (distance_m, _) = frame.base_from_tip.distance_to(&bench.tip());
    assert!(distance_m < READ_M, "{distance_m} m");
    assert_eq!(frame.joints, bench.arm.joint_values().expect("a call"));
    let grey = |p: &[u8]| p.iter().map(|v| f64::from(*v)).sum::<f64>();
    let levels = frame.rgb.as_raw().chunks_exact(3).map(grey);
    let (dark, bright) = levels.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), v| (low.min(v), high.max(v)));
    assert!(bright > 2.0 * dark + 100.0, "the board's squares: {dark} to {bright}");
}

/// A foreign scene: the arm has a name of its own, and one sensor provides colour and depth.
#[test]
fn an_arm_of_another_name_is_found_by_its_object_paths_and_without_them_the_scene_says_what_it_has() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/scenes/panda.toml");
    let mut scene = Scene::load(&file).expect("valid");
    scene.robot.name = "Franka".to_owned();
    let server = CellServer::start(CellConfig { real_time: Some(false), ..CellConfig::new(scene) }).expect("a port");
    let endpoint = server.endpoint().parse().expect("an address");
    let connect = |paths: &CellPaths| Arm::connect(&endpoint, &ConnectionOptions::default(), paths);
    let missing = |paths: &CellPaths| match connect(paths).err() {
        Some(LinkError::NoSuchObject { part, there, .. }) => (part, there),
        other => panic!("{other:?}"),
    };
    let (part, there) = missing(&CellPaths::default());
    assert_eq!((part, there), (CellPart::Tip, vec!["/Target".to_owned(), "/Tip".to_owned()]));
    let whole = CellPaths::below("Franka");
    let (part, there) = missing(&CellPaths { camera: "/Franka/eye".to_owned(), ..whole.clone() });
    assert_eq!((part, there), (CellPart::Camera, vec!["/3D_camera".to_owned(), "/depth".to_owned()]));

    let mut arm =
        connect(&CellPaths { depth: String::new(), target: String::new(), ..whole }).expect("all that it needs");
    assert_eq!((arm.info().joints.len(), arm.info().depth_optics), (7, arm.info().optics));
    let kinematics = arm.kinematics().expect("calls").unwrap_or_else(|unknown| panic!("{unknown}"));
    let (joints, tip) = (arm.joint_values().expect("a call"), arm.base_from_tip().expect("a call"));
    assert!(kinematics.tip(&joints).distance_to(&tip).0 < READ_M);
    let here = connect(&CellPaths { tip: "/Tip".to_owned(), ..CellPaths::below("Franka") }).expect("as it was listed");
    assert_eq!(here.info().joints.len(), 7);
}

/// The joints that carry the named tip are driven, not those of the arm with the usual names.
#[test]
fn of_two_arms_the_one_with_the_named_tip_is_driven_and_a_named_base_that_is_not_there_is_an_error() {
    let mut bench = Bench::start(Scene::reference().expect("valid"));
    let start = bench.arm.joint_values().expect("a call");
    let sim = bench.arm.sim();
    // The wrist is separate: three joints of the usual names are left on /UR5.
    let fourth = sim.get_object_index("/UR5/joint", 3).expect("a joint");
    let args = vec![fourth.0.into(), (-1).into(), true.into()];
    sim.connection().call("sim.setObjectParent", args).expect("a call");
    let endpoint = bench.server.endpoint().parse().expect("an address");
    let connect = |paths: &CellPaths| Arm::connect(&endpoint, &ConnectionOptions::default(), paths);
    let of_wrist = CellPaths {
        tip: "/Tip".to_owned(),
        camera: "/3D_camera".to_owned(),
        depth: String::new(),
        target: String::new(),
        ..CellPaths::default()
    };
    let mut wrist = connect(&of_wrist).expect("a tip and its camera");
    let joints = wrist.joint_values().expect("a call");
    assert_eq!(joints[..], start[3..], "those of the column are {:?}", &start[..3]);
    match connect(&CellPaths { arm: "/UR10".to_owned(), ..of_wrist }).err() {
        Some(LinkError::NoSuchObject { part: CellPart::Arm, there, .. }) => {
            assert!(there.contains(&"/UR5".to_owned()), "{there:?}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_arm_that_cannot_be_driven_along_lines_says_why() {
    let mut loose = Bench::shipped("xarm6.toml");
    let sim = loose.arm.sim();
    let first = sim.get_object_index("/UR5/joint", 0).expect("a joint");
    let args = vec![first.0.into(), (-1).into(), true.into()];
    sim.connection().call("sim.setObjectParent", args).expect("a call");
    let unknown = loose.unknown();
    assert!(matches!(&unknown, UnknownKinematics::Elsewhere { path } if path == "/UR5"), "{unknown}");
}
