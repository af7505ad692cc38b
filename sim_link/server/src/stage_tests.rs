use super::*;
use std::path::Path;

use handeye_cell::scene::{ArmErrorsSpec, ShippedScene};
use handeye_cell::world::{Chain, paths};

fn cell(scene: &Scene) -> (World, Stage, ResolvedScene) {
    let resolved = scene.resolve(7).expect("valid scene");
    let (world, stage) = build(scene, &resolved).expect("fits");
    (world, stage, resolved)
}

fn near(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-12 && a.rotation.angle_to(&b.rotation) < 1e-7
}

#[test]
fn the_objects_that_scripts_look_for_are_there() {
    let (world, stage, _) = cell(&Scene::default());
    for path in [
        "/UR5",
        "/UR5/Tip",
        "/UR5/Target",
        "/UR5/3D_camera",
        "/UR5/3D_camera/depth",
        "/Plane",
        "/UR5/connection",
        "/Floor",
        "/MountingPlate",
        "/UR5/joint/link/joint/link",
    ] {
        assert!(paths::find(&world.tree, path, None, None).is_ok(), "{path}");
    }
    for (index, joint) in stage.joints.iter().copied().enumerate() {
        assert_eq!(paths::find(&world.tree, "/UR5/joint", Some(index), None), Ok(joint));
    }
}

#[test]
fn the_tree_of_the_arm_is_its_kinematics() {
    let (mut world, stage, resolved) = cell(&Scene::default());
    for q in [[0.0; 6], [0.3, -1.2, 0.8, 2.0, -0.7, 1.1], [-3.0, 0.4, -2.2, 0.1, 1.5, -4.0]] {
        for (joint, position) in stage.joints.iter().copied().zip(q) {
            world.tree.joint_mut(joint).expect("joint").set_position(position).expect("finite");
        }
        let tip = world.tree.world_pose(stage.tip, Chain::Reported).expect("exists");
        assert!(near(&tip, resolved.reported_tip(&q.into()).expect("six joints").isometry()));
    }
}

#[test]
fn without_faults_the_robot_is_where_it_says() {
    let (mut world, stage, _) = cell(&Scene::default());
    world.start_simulation();
    world.run_pass();
    let reported = world.tree.world_pose(stage.camera, Chain::Reported).expect("exists");
    let actual = world.tree.world_pose(stage.camera, Chain::Actual).expect("exists");
    assert!(near(&reported, &actual));
}

#[test]
fn a_faulty_arm_stands_still_differently_after_every_move_and_not_while_it_stands() {
    let mut scene = Scene::default();
    scene.robot.repeatability_mm = 0.1;
    scene.robot.repeatability_deg = 0.01;
    scene.robot.joint_offset_deg = Some([0.1, 0.2, -0.1, 0.0, 0.3, 0.0].into());
    let (mut world, stage, resolved) = cell(&scene);
    world.start_simulation();
    let actual = |world: &World| world.tree.world_pose(stage.tip, Chain::Actual).expect("exists");
    let home = resolved.start_joints;
    for visit in 0..3 {
        for _ in 0..3 {
            world.run_pass();
            assert!(
                near(&actual(&world), resolved.true_tip(&home, 2 * visit).expect("six joints").isometry()),
                "visit {visit}"
            );
        }
        for position in [home[0] + 0.1, home[0] + 0.2, home[0] + 0.2, home[0] + 0.1, home[0]] {
            world.tree.joint_mut(stage.joints[0]).expect("joint").set_position(position).expect("finite");
            world.run_pass();
        }
        world.run_pass();
    }
}

#[test]
fn the_arm_stands_as_its_true_chain_does_and_reports_as_the_nominal_one_whatever_arm_it_is() {
    let on_track = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../core/arm/src/testing/arms/xarm6_on_track.urdf");
    let of_ros = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../core/arm/src/testing/arms/ur5.urdf");
    let on_track = format!(
        "[robot]\nmodel = {{ urdf = {on_track:?}, tip = \"link6\" }}\nstart_joints_deg = [0.1, 0, -45, -35, 0, 80, 0]\n"
    );
    let of_ros = format!(
        "[robot]\nmodel = {{ urdf = {of_ros:?}, tip = \"tool0\" }}\nstart_joints_deg = [0, -90, 90, -90, -90, 0]\n\
         joint_offset_deg = [0, 0.1, 0, -0.2, 0, 0.3]\n"
    );
    let mut scenes = [
        ShippedScene::Nominal.scene().expect("it is shipped"),
        ShippedScene::Panda.scene().expect("it is shipped"),
        Scene::from_toml(&on_track).expect("valid"),
        Scene::from_toml(&of_ros).expect("valid"),
    ];
    for scene in &mut scenes {
        scene.robot.arm_errors = ArmErrorsSpec { angle_deg: 0.5, length_mm: 3.0, compliance_deg: 0.3 };
        let (mut world, stage, resolved) = cell(scene);
        let name = &resolved.arm_model;
        world.start_simulation();
        let shift = |i: usize, by: f64| resolved.start_joints[i] + by * (0.1 + 0.03 * i as f64);
        for by in [0.0, 0.5, 1.0] {
            let joints = JointValues::from_fn(stage.joints.len(), |i| shift(i, by));
            for (joint, position) in stage.joints.iter().zip(&joints) {
                world.tree.joint_mut(*joint).expect("joint").set_position(*position).expect("finite");
            }
            world.run_pass();
            let place = |object: Handle, chain: Chain| world.tree.world_pose(object, chain).expect("exists");
            let [reported, actual] = [Chain::Reported, Chain::Actual].map(|chain| place(stage.tip, chain));
            assert!(near(&reported, resolved.reported_tip(&joints).expect("its joints").isometry()), "{name:?}");
            assert!(near(&actual, resolved.true_tip(&joints, 0).expect("its joints").isometry()), "{name:?}");
            // The camera goes with the tip, and the links that are drawn with their joints.
            assert!(near(&place(stage.camera, Chain::Actual), &(actual * resolved.tip_from_sensor.isometry())));
            let off = |object: Handle| place(object, Chain::Reported).inv_mul(&place(object, Chain::Actual));
            assert!(near(&off(stage.joints[0]), &Isometry3::identity()), "{name:?}");
            for (joint, value) in stage.joints.iter().zip(&joints).skip(1) {
                assert!(off(*joint).translation.vector.norm() > 1e-4, "{name:?}");
                let link = world.tree.get(*joint).expect("exists").children()[0];
                let turn = world.tree.joint(*joint).expect("a joint").motion(*value);
                assert!(near(&place(link, Chain::Actual), &(place(*joint, Chain::Actual) * turn)), "{name:?}");
            }
        }
    }
}

#[test]
fn a_board_slips_once_when_the_arm_comes_to_rest_for_the_time_that_the_scene_names() {
    let mut scene = Scene::default();
    scene.board.slip = Some(SlipSpec { at_stop: 2, by_mm: [3.0, -4.0, 0.0] });
    let (mut world, stage, resolved) = cell(&scene);
    world.start_simulation();
    let from_start = |world: &World| {
        let plane = world.tree.world_pose(stage.plane, Chain::Actual).expect("exists");
        resolved.world_from_plane.inv_mul(&plane).translation.vector
    };
    for visit in 1..=4 {
        for position in [0.1, 0.2, 0.1 * f64::from(visit)] {
            assert_eq!(from_start(&world).norm() > 1e-9, visit > 2, "on the way to visit {visit}");
            world.tree.joint_mut(stage.joints[0]).expect("joint").set_position(position).expect("finite");
            world.run_pass();
        }
        world.run_pass();
        let expected = if visit < 2 { Vector3::zeros() } else { Vector3::new(3e-3, -4e-3, 0.0) };
        assert!((from_start(&world) - expected).norm() < 1e-12, "visit {visit}: {}", from_start(&world));
    }
}

#[test]
fn names_of_a_scene_become_names_of_a_path() {
    assert_eq!(alias("mounting plate"), "MountingPlate");
    assert_eq!(alias("board/stand [2]"), "BoardStand2");
}
