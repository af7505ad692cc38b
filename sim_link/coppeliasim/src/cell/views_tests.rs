use super::*;
use handeye_arm::ArmKind;
use handeye_cell::scene::Scene;

fn arm_and_board(scene: &Scene) -> (ArmKinematics, BoardInView, JointValues) {
    let scene = scene.resolve(scene.seed).expect("valid");
    let arm = ArmKinematics::ur5(scene.world_from_arm, scene.connection_from_tip, &ArmKind::Ur5Coppeliasim.ranges())
        .expect("limits with room");
    let board = BoardInView {
        base_from_target: scene.base_from_target,
        target: scene.target,
        intrinsics: scene.intrinsics,
        tip_from_camera: scene.tip_from_camera,
    };
    (arm, board, scene.start_joints)
}

#[test]
fn views_to_verify_at_show_the_whole_board_and_differ_from_those_of_the_fit_and_from_each_other() {
    for scene in [Scene::reference().expect("the scene"), Scene::realistic().expect("the scene")] {
        let (arm, board, start) = arm_and_board(&scene);
        // A fit from views that the same planner chose, so that the best ones are taken already.
        let fitted = arm.views_unlike(&board, &[], &start, &arm.plane(), 10, 1).expect("views");
        let taken: Vec<_> = fitted.iter().map(|joints| arm.tip(joints)).collect();
        let views = arm.views_unlike(&board, &taken, &start, &arm.plane(), 5, 1).expect("views");
        assert_eq!(views.len(), 5);
        for (index, joints) in views.iter().enumerate() {
            let tip = arm.tip(joints);
            let others = taken.iter().copied().chain(views[..index].iter().map(|joints| arm.tip(joints)));
            let nearest_rad =
                others.map(|other| tip.rotation().angle_to(&other.rotation())).fold(f64::INFINITY, f64::min);
            assert!(nearest_rad > 10.0_f64.to_radians(), "{}°", nearest_rad.to_degrees());
            let camera_from_target = (tip * board.tip_from_camera).inverse() * board.base_from_target;
            for point in board.target.points() {
                let px = board.intrinsics.project(&(camera_from_target.isometry() * point)).expect("in front");
                assert!(board.intrinsics.contains(&px), "{px}");
            }
            assert_eq!(arm.arm().first_violation(joints), None);
        }
    }
}

#[test]
fn views_are_taken_from_distances_like_those_of_the_fit() {
    let (arm, board, start) = arm_and_board(&Scene::reference().expect("the scene"));
    let fitted = arm.views_unlike(&board, &[], &start, &arm.plane(), 6, 1).expect("views");
    let taken: Vec<_> = fitted.iter().map(|joints| arm.tip(joints)).collect();
    let distances =
        |poses: &[Pose<Base, Tip>]| -> Vec<f64> { poses.iter().map(|pose| board.distance_m(pose)).collect() };
    let [least, most] = [f64::min, f64::max].map(|choose| distances(&taken).into_iter().reduce(choose).expect("some"));
    let views = arm.views_unlike(&board, &taken, &start, &arm.plane(), 5, 1).expect("views");
    let planned: Vec<_> = views.iter().map(|joints| arm.tip(joints)).collect();
    for distance_m in distances(&planned) {
        // The line of sight meets the board up to 4 cm from its middle.
        assert!((0.9 * least - 0.05..1.1 * most + 0.05).contains(&distance_m), "{distance_m} m");
    }
}

#[test]
fn an_arm_that_touches_its_table_is_not_sent_anywhere() {
    let (arm, board, _) = arm_and_board(&Scene::reference().expect("the scene"));
    let lying = [0.0, 100.0_f64.to_radians(), 0.0, 0.0, 0.0, 0.0];
    let blocked = arm.views_unlike(&board, &[], &lying.into(), &arm.plane(), 5, 1);
    assert!(matches!(blocked, Err(PlanError::StartBlocked { .. })), "{blocked:?}");
}
