//! Arms other than the UR5: seven joints, six without a closed form, a prismatic one, another of Universal Robots.

use std::path::Path;

use handeye_arm::{JointKind, JointValues};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};

use super::*;
use handeye_cell::render::Shape;
use handeye_cell::world::Chain;
use handeye_plan::{ViewOptions, ViewSetup, poses_looking_at};

const JOINT_REVOLUTE: i64 = 10;
const JOINT_PRISMATIC: i64 = 11;

fn shipped(name: &str) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/scenes").join(name);
    Scene::load(&file).unwrap_or_else(|error| panic!("{error}"))
}

/// An xArm 6 on a track: its first joint is prismatic.
fn on_track() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../core/arm/src/testing/arms/xarm6_on_track.urdf");
    let text = format!(
        "[robot]\nmodel = {{ urdf = {file:?}, tip = \"link6\" }}\nstart_joints_deg = [0.1, 0, -45, -35, 0, 80, 0]\n"
    );
    Scene::from_toml(&text).unwrap_or_else(|error| panic!("{error}"))
}

fn ur3e() -> Scene {
    let text = "[robot]\nmodel = \"ur3e\"\nstart_joints_deg = [0, -90, 90, -90, -90, 0]\n";
    Scene::from_toml(text).unwrap_or_else(|error| panic!("{error}"))
}

/// A UR5 as in ROS: its axes are not the z axes of its frames.
fn ur5_of_ros() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../core/arm/src/testing/arms/ur5.urdf");
    let text = format!(
        "[robot]\nmodel = {{ urdf = {file:?}, tip = \"tool0\" }}\nstart_joints_deg = [0, -90, 90, -90, -90, 0]\n"
    );
    Scene::from_toml(&text).unwrap_or_else(|error| panic!("{error}"))
}

fn scenes() -> [(&'static str, Scene, usize); 5] {
    [
        ("ur5 of ros", ur5_of_ros(), 6),
        ("panda", shipped("panda.toml"), 7),
        ("xarm6", shipped("xarm6.toml"), 6),
        ("xarm6 on a track", on_track(), 7),
        ("ur3e", ur3e(), 6),
    ]
}

/// Places in the ranges of all joints, the same in every run.
fn places(arm: &handeye_arm::Arm) -> impl Iterator<Item = JointValues> + '_ {
    (0..20_u32).map(|place| {
        JointValues::from_fn(arm.joint_count(), |i| {
            let range = arm.joints()[i].range;
            let (min, max) = if range.min.is_finite() { (range.min, range.max) } else { (-3.0, 3.0) };
            // Multiples of irrational numbers are spread evenly.
            min + (max - min) * (f64::from(place + 1) * f64::from(i as u32 + 2).sqrt()).fract()
        })
    })
}

fn pose_of(numbers: &Value) -> Isometry3<f64> {
    let p = numbers.numbers().expect("a pose");
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(p[6], p[3], p[4], p[5]));
    Isometry3::from_parts(Translation3::new(p[0], p[1], p[2]), turn)
}

#[test]
fn over_the_api_every_arm_has_its_joints_with_their_types_ranges_and_places() {
    for (name, scene, count) in scenes() {
        let truth = scene.resolve(1).expect("valid");
        let mut bench = Bench::with(&scene, false);
        let joints: Vec<Value> = (0..count)
            .map(|i| {
                let options = wire::map([("index", Value::from(i as u64))]);
                bench.get("sim.getObject", vec![Value::from("/UR5/joint"), options])
            })
            .collect();
        assert_eq!(Value::Array(joints.clone()), bench.arm(), "{name}");
        for (handle, joint) in joints.iter().zip(truth.arm.joints()) {
            let kind = if joint.kind == JointKind::Revolute { JOINT_REVOLUTE } else { JOINT_PRISMATIC };
            assert_eq!(bench.get("sim.getJointType", vec![handle.clone()]), Value::from(kind), "{name}");
            let reply = bench.call(A, "sim.getJointInterval", vec![handle.clone()]);
            let [cyclic, interval] = reply.list().expect("two values") else { panic!("{reply:?}") };
            let endless = joint.range.min.is_infinite();
            assert_eq!(cyclic, &Value::Bool(endless), "{name}: {}", joint.name);
            if !endless {
                let [min, span] = interval.numbers().expect("numbers")[..] else { panic!("{interval:?}") };
                assert_eq!((min, span), (joint.range.min, joint.range.max - joint.range.min), "{name}: {}", joint.name);
            }
        }
        let tip = bench.get("sim.getObject", vec![Value::from("/UR5/Tip")]);
        for values in places(&truth.arm) {
            for (handle, value) in joints.iter().zip(values.iter()) {
                bench.call(A, "sim.setJointPosition", vec![handle.clone(), Value::Float(*value)]);
            }
            let reported = pose_of(&bench.get("sim.getObjectPose", vec![tip.clone()]));
            let expected = truth.reported_tip(&values).expect("its joints");
            let off = expected.isometry().inverse() * reported;
            assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-7, "{name}: {values:?}");
        }
    }
}

#[test]
fn what_is_drawn_of_an_arm_hangs_together_from_its_foot_to_its_connection_wherever_it_goes() {
    for (name, scene, _) in scenes() {
        let truth = scene.resolve(1).expect("valid");
        let mut bench = Bench::with(&scene, false);
        for values in places(&truth.arm) {
            let cell = &mut bench.engine.cell;
            for (&handle, value) in cell.stage.joints.iter().zip(values.iter()) {
                cell.world.tree.joint_mut(handle).expect("joint").set_position(*value).expect("finite");
            }
            let tree = &cell.world.tree;
            let place = |pose: Isometry3<f64>| Point3::from(pose.translation.vector);
            let mut places: Vec<Point3<f64>> = cell
                .stage
                .joints
                .iter()
                .map(|&h| place(tree.world_pose(h, Chain::Reported).expect("a joint")))
                .collect();
            places.push(place(tree.world_pose(cell.stage.connection, Chain::Reported).expect("it is there")));
            places.push(place(truth.world_from_arm));
            let mut tubes = 0;
            for (handle, solid) in &cell.stage.solids {
                let Shape::Capsule { a, b, .. } = solid.shape else { continue };
                let pose = tree.world_pose(*handle, Chain::Reported).expect("a link") * solid.world_from_shape;
                for end in [pose * a, pose * b] {
                    let off = places.iter().map(|place| (place - end).norm()).fold(f64::INFINITY, f64::min);
                    // The rail of a prismatic joint is not drawn.
                    assert!(off < 1e-9 || truth.arm.joints()[0].kind == JointKind::Prismatic, "{name}: {off} m");
                }
                tubes += 1;
            }
            assert!(tubes >= 4, "{name}: {tubes} tubes");
        }
    }
}

#[test]
fn a_move_to_a_pose_takes_seven_joints_and_six_without_a_closed_form_there_within_their_ranges() {
    for (name, scene) in [("panda", shipped("panda.toml")), ("xarm6", shipped("xarm6.toml"))] {
        let truth = scene.resolve(1).expect("valid");
        let mut bench = Bench::with(&scene, false);
        bench.call(A, "sim.startSimulation", vec![]);
        let start = truth.reported_tip(&truth.start_joints).expect("its joints");
        let shift = Translation3::new(0.03, 0.08, 0.05);
        let turn = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.4);
        let goal =
            Isometry3::from_parts(Translation3::from(start.translation() + shift.vector), start.rotation() * turn);
        let (t, q) = (goal.translation.vector, goal.rotation.coords);
        let tip = bench.get("sim.getObject", vec![Value::from("/UR5/Tip")]);
        let target = bench.get("sim.getObject", vec![Value::from("/UR5/Target")]);
        let ik = wire::map([("tip", tip.clone()), ("target", target), ("joints", bench.arm())]);
        let four = |value: f64| floats(&[value; 4]);
        let params = wire::map([
            ("ik", ik),
            ("targetPose", floats(&[t.x, t.y, t.z, q.x, q.y, q.z, q.w])),
            ("maxVel", four(0.5)),
            ("maxAccel", four(1.0)),
            ("maxJerk", four(10.0)),
        ]);
        bench.call(A, "sim.moveToPose", vec![params]);
        let off = goal.inverse() * pose_of(&bench.get("sim.getObjectPose", vec![tip]));
        // The precision that the simulator asks of its inverse kinematics.
        let near = off.translation.vector.norm() < 1e-3 && off.rotation.angle() < 0.5_f64.to_radians();
        assert!(near, "{name}: {off}");
        assert_eq!(truth.arm.first_violation(&bench.joints()), None, "{name}");
    }
}

#[test]
fn a_joint_goes_to_its_target_as_fast_as_its_maker_says() {
    let mut bench = Bench::with(&shipped("panda.toml"), false);
    let joints = bench.engine.cell.stage.joints.clone();
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    for (index, fastest) in [(0, 2.175), (6, 2.61)] {
        let joint = Value::from(joints[index]);
        bench.call(A, "sim.setJointTargetPosition", vec![joint, Value::Float(-2.8)]);
        let (mut before, mut most) = (bench.joints()[index], 0.0_f64);
        for _ in 0..100 {
            bench.call(A, "sim.step", vec![]);
            let now = bench.joints()[index];
            most = most.max((now - before).abs() / 0.05);
            before = now;
        }
        assert!((before + 2.8).abs() < 1e-9, "joint {}: {before}", index + 1);
        assert!(most <= fastest + 1e-9 && most > 0.8 * fastest, "joint {}: {most} rad/s", index + 1);
    }
}

#[test]
fn views_of_the_board_are_found_for_the_arms_of_shipped_scenes() {
    for name in ["panda.toml", "xarm6.toml"] {
        let scene = shipped(name);
        let truth = scene.resolve(1).expect("valid");
        let start = truth.camera_from_target(&truth.reported_tip(&truth.start_joints).expect("its joints"));
        for point in truth.target.points() {
            let px = truth.intrinsics.project(&(start.isometry() * point)).expect("in front");
            assert!(truth.intrinsics.contains(&px), "{name}: at the start the board is at {px}");
        }
        let views = poses_looking_at(&ViewSetup::from(&truth), &ViewOptions::default());
        for view in views.unwrap_or_else(|error| panic!("{name}: {error}")) {
            assert_eq!(truth.arm.first_violation(&view.joints), None, "{name}");
            let (distance_m, angle_rad) =
                truth.reported_tip(&view.joints).expect("its joints").distance_to(&view.base_from_tip);
            assert!(distance_m < 1e-7 && angle_rad < 1e-7, "{name}: {distance_m} m");
        }
    }
}

#[test]
fn an_arm_that_is_folded_into_itself_or_lies_on_the_floor_is_in_the_way() {
    let truth = shipped("panda.toml").resolve(1).expect("valid");
    let setup = ViewSetup::from(&truth);
    let is_free = |joints_deg: [f64; 7]| setup.arm.is_free(&joints_deg.map(f64::to_radians), &setup.around, 0.02);
    assert!(is_free([0.0, -40.0, 0.0, -130.0, 0.0, 90.0, 45.0]));
    assert!(is_free([0.0, 0.0, 0.0, -90.0, 0.0, 90.0, 0.0]));
    // The hand is turned back to the upper arm.
    assert!(!is_free([0.0, 0.0, 0.0, -175.0, 0.0, 30.0, 0.0]));
    assert!(!is_free([0.0, 100.0, 0.0, -20.0, 0.0, 90.0, 0.0]), "it lies on the floor");
}

#[test]
fn an_arm_that_is_not_there_is_refused_with_file_line_and_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let panda = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/arms/panda.urdf");
    std::fs::copy(panda, folder.path().join("panda.urdf")).expect("copied");
    let refused = |robot: &str| {
        let file = folder.path().join("scene.toml");
        std::fs::write(&file, format!("[robot]\n{robot}\n")).expect("written");
        Scene::load(&file).expect_err(robot).to_string()
    };
    let start = "start_joints_deg = [0, -40, 0, -130, 0, 90, 45]";
    let good = "model = { urdf = \"panda.urdf\", tip = \"panda_link8\" }";
    let cases: [(&str, &[&str]); 9] = [
        ("model = { urdf = \"absent.urdf\" }", &["absent.urdf", "scene.toml, line 2", "Name a built-in arm"]),
        ("model = { urdf = \"panda.urdf\", tip = \"hand\" }", &["panda.urdf", "hand", "line 2"]),
        (
            "model = { urdf = \"panda.urdf\", base = \"panda_link4\", tip = \"panda_link2\" }",
            &["panda_link4", "panda_link2", "line 2"],
        ),
        ("model = \"ur6\"", &["`ur5e`", "urdf", "line 2"]),
        ("model = { urdf = \"panda.urdf\", tool = \"x\" }", &["no such arm", "line 2"]),
        (good, &["robot.start_joints_deg", "of 6 values", "7 values"]),
        (&format!("{good}\n{start}\nmin_joints_deg = [0, 0]"), &["robot.min_joints_deg", "2 values", "line 4"]),
        (&format!("{good}\n{}", start.replace("-130", "0")), &["start_joints_deg[3]", "panda_joint4", "line 3"]),
        (&format!("{good}\n{start}\njoint_offset_deg = [0, 0, 0, 11, 0, 0, 0]"), &["joint_offset_deg[3]", "line 4"]),
    ];
    for (robot, wanted) in cases {
        let message = refused(robot);
        assert!(wanted.iter().all(|part| message.contains(part)), "{robot}: {message}");
    }
    std::fs::write(folder.path().join("scene.toml"), format!("[robot]\n{good}\n{start}\n")).expect("written");
    let scene = Scene::load(&folder.path().join("scene.toml")).expect("the file is beside the scene");
    assert_eq!(scene.resolve(1).expect("valid").arm.joint_count(), 7);
    std::fs::remove_file(folder.path().join("panda.urdf")).expect("removed");
    let message = scene.resolve(1).expect_err("it is gone").to_string();
    assert!(message.contains("panda.urdf"), "{message}");
}
