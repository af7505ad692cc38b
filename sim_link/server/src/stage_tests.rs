use super::*;
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
