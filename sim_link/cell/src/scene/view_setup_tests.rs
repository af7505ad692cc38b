use handeye_arm::JointValues;
use handeye_plan::{PlanError, PlannedView, ViewOptions, order_by_travel, poses_looking_at, travel};
use nalgebra::{Isometry3, Point3};

use super::*;
use crate::scene::Scene;
use handeye_geometry::frames::PointIn;
use handeye_motion::{JointMotion, MotionLimits, MotionState, Sync};

fn setup(scene: &Scene) -> ViewSetup {
    ViewSetup::from(&scene.resolve(scene.seed).unwrap())
}

fn scenes() -> [ViewSetup; 2] {
    [setup(&Scene::reference().unwrap()), setup(&Scene::realistic().unwrap())]
}

fn smallest_angle(views: &[PlannedView]) -> f64 {
    let mut smallest = f64::INFINITY;
    for (i, a) in views.iter().enumerate() {
        for b in &views[..i] {
            smallest = smallest.min(a.base_from_tip.rotation().angle_to(&b.base_from_tip.rotation()));
        }
    }
    smallest
}

#[test]
fn every_view_shows_the_whole_board_from_its_front_and_from_the_distance_asked_for() {
    let options = ViewOptions::default();
    for setup in scenes() {
        let views = poses_looking_at(&setup, &options).unwrap();
        assert_eq!(views.len(), options.count);
        for view in views {
            let target_from_camera = setup.base_from_target.inverse() * view.base_from_tip * setup.tip_from_camera;
            for point in setup.target.points() {
                let px = setup.intrinsics.project(&(target_from_camera.inverse() * PointIn::new(point)).point());
                assert!(setup.intrinsics.contains(&px.unwrap()));
            }
            let eye = target_from_camera.translation() - setup.target.centre().coords;
            let tilt = (-eye.z / eye.norm()).acos();
            // Aiming off the middle shifts both a little.
            let sideways = options.aim_m * std::f64::consts::SQRT_2;
            assert!(eye.norm() > options.distance_m[0] - sideways && eye.norm() < options.distance_m[1] + sideways);
            assert!(tilt < options.cone_rad + (sideways / options.distance_m[0]).atan(), "{}°", tilt.to_degrees());
        }
    }
}

#[test]
fn joints_and_pose_of_a_view_agree_and_keep_the_limits() {
    let scene = Scene::realistic().unwrap().resolve(5).unwrap();
    let setup = ViewSetup::from(&scene);
    for view in poses_looking_at(&setup, &ViewOptions::default()).unwrap() {
        let (distance_m, angle_rad) = scene.reported_tip(&view.joints).unwrap().distance_to(&view.base_from_tip);
        assert!(distance_m < 1e-9 && angle_rad < 1e-9);
        assert_eq!(scene.arm.first_violation(&view.joints), None);
    }
}

/// The moves that the cell will really make: straight in joint space, sampled more finely than the planner does, and
/// judged by where tip and camera are rather than by the planner's own shapes.
#[test]
fn moves_between_any_two_views_keep_tip_and_camera_out_of_floor_and_board() {
    for setup in scenes() {
        let views = poses_looking_at(&setup, &ViewOptions { count: 12, ..ViewOptions::default() }).unwrap();
        let limits = MotionLimits::uniform(6, 5.4, 1.75, 1.4);
        let mut stops: Vec<JointValues> = views.iter().map(|view| view.joints).collect();
        stops.push(setup.start_joints);
        for (i, from) in stops.iter().enumerate() {
            for to in &stops[i + 1..] {
                let start = MotionState::at_rest(from.to_vec());
                let mut motion = JointMotion::new(start, to, &[0.0; 6], Some(&limits), Sync::Phase).unwrap();
                loop {
                    let step = motion.step(0.02);
                    assert_keeps_away(&setup, &step.pos);
                    if step.finished {
                        break;
                    }
                }
            }
        }
    }
}

/// A rod that hangs into the room in front of the board: it blocks some ways, not all.
#[test]
fn an_obstacle_is_driven_around_between_all_views() {
    let [free, _] = scenes();
    let rod = Obstacle::new("rod", Isometry3::translation(-0.35, -0.05, 1.2), [0.03, 0.03, 0.8]);
    let mut blocked = free.clone();
    blocked.around.obstacles.push(rod.clone());
    let options = ViewOptions { count: 12, ..ViewOptions::default() };
    // Pairs between which the tip or the camera would come within a centimetre of the rod.
    let hits = |setup: &ViewSetup| {
        let views = poses_looking_at(setup, &options).unwrap();
        let mut hits = 0;
        for (i, from) in views.iter().enumerate() {
            for to in &views[i + 1..] {
                let touched = (0..=400).any(|step| {
                    let part = f64::from(step) / 400.0;
                    let between = |k: usize| from.joints[k] + part * (to.joints[k] - from.joints[k]);
                    let joints = JointValues::from_fn(from.joints.len(), between);
                    let tip = setup.arm.world_from_arm
                        * setup.arm.chain.forward(&joints).unwrap().isometry()
                        * setup.arm.connection_from_tip;
                    [tip, tip * setup.tip_from_camera.isometry()].iter().any(|place| {
                        let beside = (rod.world_from_centre.inverse() * place).translation.vector.abs();
                        beside.x < 0.025 && beside.y < 0.025 && beside.z < 0.41
                    })
                });
                hits += usize::from(touched);
            }
        }
        hits
    };
    assert!(hits(&free) > 0, "the rod is in nobody's way: this test asserts nothing");
    assert_eq!(hits(&blocked), 0);
}

fn assert_keeps_away(setup: &ViewSetup, joints: &[f64]) {
    let connection = setup.arm.world_from_arm * setup.arm.chain.forward(joints).unwrap().isometry();
    let tip = connection * setup.arm.connection_from_tip;
    let camera = tip * setup.tip_from_camera.isometry();
    for place in [tip, camera] {
        let in_world = Point3::from(place.translation.vector);
        assert!(in_world.z > 0.02, "{in_world} is in the floor");
        let in_target = setup.base_from_target.inverse().isometry() * in_world;
        let centre = setup.target.centre();
        let beside_sheet = (in_target.x - centre.x).abs() > 0.12 || (in_target.y - centre.y).abs() > 0.10;
        assert!(beside_sheet || in_target.z.abs() > 0.02, "{in_target} of the target is in the board");
    }
}

#[test]
fn views_are_spread_far_better_than_random_ones() {
    for setup in scenes() {
        let spread = poses_looking_at(&setup, &ViewOptions::default()).unwrap();
        // Twenty of twenty candidates that pass: what a random choice gives.
        let random = (1..20).find_map(|seed| {
            let options = ViewOptions { count: 20, candidates: 90, seed, ..ViewOptions::default() };
            poses_looking_at(&setup, &options).ok()
        });
        let (spread, random) = (smallest_angle(&spread), smallest_angle(&random.unwrap()));
        assert!(spread > 40_f64.to_radians(), "{}°", spread.to_degrees());
        assert!(spread > 1.5 * random, "{}° against {}°", spread.to_degrees(), random.to_degrees());
    }
}

#[test]
fn the_first_views_of_a_list_are_the_list_of_a_smaller_count() {
    let [setup, _] = scenes();
    let ten = poses_looking_at(&setup, &ViewOptions { count: 10, ..ViewOptions::default() }).unwrap();
    let twenty = poses_looking_at(&setup, &ViewOptions::default()).unwrap();
    assert_eq!(ten, twenty[..10]);
}

#[test]
fn a_seed_gives_the_same_views_again_and_another_seed_others() {
    let [setup, _] = scenes();
    let plan = |seed| poses_looking_at(&setup, &ViewOptions { seed, ..ViewOptions::default() }).unwrap();
    assert_eq!(plan(3), plan(3));
    assert_ne!(plan(3), plan(4));
}

#[test]
fn every_seed_finds_twenty_views_in_both_scenes() {
    for setup in scenes() {
        for seed in 0..12 {
            poses_looking_at(&setup, &ViewOptions { seed, ..ViewOptions::default() }).unwrap();
        }
    }
}

#[test]
fn a_board_out_of_reach_is_an_error_that_says_so() {
    let mut scene = Scene::reference().unwrap();
    scene.board.plane.position_m = [-0.125, -2.0, 0.8];
    let error =
        poses_looking_at(&setup(&scene), &ViewOptions { candidates: 200, ..ViewOptions::default() }).unwrap_err();
    let PlanError::TooFewViews { found, wanted, unreachable, not_in_view, .. } = error else { panic!("{error}") };
    assert_eq!((found, wanted), (0, 20));
    assert_eq!(unreachable + not_in_view, 200);
    assert!(error.to_string().contains("out of the arm's reach"), "{error}");
}

#[test]
fn an_arm_that_starts_inside_something_is_an_error() {
    let mut scene = Scene::reference().unwrap();
    scene.robot.start_joints_deg = [0.0, 95.0, 0.0, 0.0, 0.0, 0.0].into();
    let blocked = poses_looking_at(&setup(&scene), &ViewOptions::default()).unwrap_err();
    assert!(matches!(blocked, PlanError::StartBlocked { .. }), "{blocked}");
}

#[test]
fn ordering_by_travel_shortens_the_way_and_keeps_every_view() {
    let [setup, _] = scenes();
    let spread = poses_looking_at(&setup, &ViewOptions::default()).unwrap();
    let mut ordered = spread.clone();
    order_by_travel(&setup.start_joints, &mut ordered);
    let way = |views: &[PlannedView]| views.windows(2).map(|w| travel(&w[0].joints, &w[1].joints)).sum::<f64>();
    assert!(way(&ordered) < 0.75 * way(&spread), "{} against {}", way(&ordered), way(&spread));
    assert!(spread.iter().all(|view| ordered.contains(view)));
}
