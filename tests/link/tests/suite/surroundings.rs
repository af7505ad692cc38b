//! The obstacles, read from a running cell, and motions that end before them.

use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{ArmJog, Contact, JogAxes, JogEnd, JogObstacle, MotionTolerance};
use handeye_coppeliasim::{CancelToken, LinkError, MotionLimits};
use handeye_geometry::frames::Pose;
use handeye_plan::{Obstacle, SpeedLimits, Surroundings};
use nalgebra::{Isometry3, Translation3, Vector3};

use crate::other_arms::Bench;

fn realistic() -> Bench {
    Bench::start(Scene::realistic().expect("valid"))
}

#[test]
fn the_shapes_of_the_scene_stand_around_but_not_the_arm_and_not_the_board() {
    let mut bench = realistic();
    let kinematics = bench.kinematics();
    let obstacles_found = bench.arm.surroundings(&kinematics).expect("calls");
    let names = |boxes: &[Obstacle]| boxes.iter().map(|it| it.name.clone()).collect::<Vec<_>>();
    let around = names(&obstacles_found.around.obstacles);
    for name in ["Table", "Floor", "Post", "MountingPlate", "Wall"] {
        assert!(around.iter().any(|known| known == name), "{name} is not among {around:?}");
    }
    for name in ["UR5", "link", "Gripper", "Plane"] {
        assert!(!around.iter().any(|known| known == name), "{name} is among {around:?}");
    }
    let mut on_board = names(&obstacles_found.on_board);
    on_board.sort();
    assert_eq!(on_board, ["Panel", "Stand"]);
    assert_eq!(obstacles_found.all().obstacles.len(), around.len() + 2);
    // As in the scene.
    let table = obstacles_found.around.obstacles.iter().find(|it| it.name == "Table").expect("it was found");
    let truth = bench.truth.solids.iter().find(|it| it.name == "table").expect("it is there");
    for axis in 0..3 {
        assert!((table.size_m[axis] - truth.size_m[axis]).abs() < 1e-9);
    }
    let off = (table.world_from_centre.translation.vector - truth.world_from_solid.translation.vector).norm();
    assert!(off < 1e-9, "{off} m");
}

#[test]
fn a_box_that_the_foot_of_the_arm_stands_in_is_hollow_and_one_out_of_reach_does_not_count() {
    let text = "[[solids]]\nname = \"cage\"\nsize_m = [3, 3, 3]\nposition_m = [0, 0, 1]\n[[solids]]\nname = \"far\"\n\
                size_m = [1, 1, 1]\nposition_m = [8, 0, 0]\n[[solids]]\nname = \"near\"\nsize_m = [0.1, 0.1, 0.1]\n\
                position_m = [0.6, 0, 0.1]\n";
    let mut bench = Bench::start(Scene::from_toml(text).expect("valid"));
    let kinematics = bench.kinematics();
    let obstacles_found = bench.arm.surroundings(&kinematics).expect("calls");
    let names: Vec<&str> = obstacles_found.around.obstacles.iter().map(|it| it.name.as_str()).collect();
    // What the arm is mounted on may be within the cage.
    assert_eq!(names, ["plane under the arm", "Near"]);
}

/// A plate next to the tip, where a jog along x of the base leads.
fn plate(bench: &mut Bench, beside_m: f64) -> Surroundings {
    let at = bench.tip().translation() + Vector3::new(beside_m, 0.0, 0.0);
    Surroundings::of(vec![Obstacle::new("plate", Isometry3::from(at), [0.02, 0.12, 0.12])])
}

#[test]
fn a_jog_ends_before_a_box_names_it_and_gets_away_again() {
    let mut bench = realistic();
    let kinematics = bench.kinematics();
    let around = plate(&mut bench, 0.22);
    let among = kinematics.among(around.clone(), None);
    bench.arm.keep_clear(Some(among.clone()));
    let start = bench.arm.joint_values().expect("a call");
    assert!(among.guard(&start).contact(&start).is_none());
    let line = |along| ArmJog::Line { kinematics: &kinematics, axes: JogAxes::Base, along };
    let named = JogEnd::Obstacle(JogObstacle::Contact(Contact::Box { name: "plate".to_owned() }));
    // With too long a step nothing moves.
    let refused = bench.arm.jog(&line(Vector3::x()), Some(0.3), &mut || Some(1.0)).expect("calls");
    assert_eq!(refused, named);
    assert_eq!(bench.arm.joint_values().expect("a call"), start);
    let before = bench.tip();
    let end = bench.arm.jog(&line(Vector3::x()), None, &mut || Some(1.0)).expect("calls");
    assert_eq!(end, named);
    let here = bench.arm.joint_values().expect("a call");
    assert!(among.arm.is_free(&here, &around, among.clearance_m - 1e-6), "it came too near");
    assert!(!among.arm.is_free(&here, &around, among.clearance_m + 0.02), "it ended long before");
    assert!(bench.tip().distance_to(&before).0 > 0.01, "it moved");
    // Held with the arm too close, as if something had been placed there: it may move away, but no nearer.
    let mut nearer = around;
    nearer.obstacles[0].size_m[0] += 0.01;
    bench.arm.keep_clear(Some(kinematics.among(nearer, None)));
    assert_eq!(bench.arm.jog(&line(Vector3::x()), None, &mut || Some(1.0)), Ok(named));
    assert_eq!(bench.arm.jog(&line(-Vector3::x()), Some(0.05), &mut || Some(1.0)), Ok(JogEnd::Arrived));
}

#[test]
fn a_goal_behind_a_box_is_refused_before_anything_moves_and_limits_of_speed_are_kept() {
    let mut bench = realistic();
    let kinematics = bench.kinematics();
    let start = bench.arm.joint_values().expect("a call");
    let mut goal = start;
    goal[0] += 0.8;
    let middle = {
        let mut half = start;
        half[0] += 0.4;
        kinematics.tip(&half).translation()
    };
    let post = Obstacle::new("post in the way", Isometry3::from(middle), [0.03, 0.03, 0.4]);
    bench.arm.keep_clear(Some(kinematics.among(Surroundings::of(vec![post]), None)));
    let limits = MotionLimits::uniform(6, 3.0, 9.0, 90.0);
    let none = CancelToken::default();
    let refused = bench.arm.move_to_joints(&goal, &limits, &none);
    let Err(LinkError::InTheWay { contact: Contact::Box { name } }) = refused else { panic!("{refused:?}") };
    assert_eq!(name, "post in the way");
    assert_eq!(bench.arm.joint_values().expect("a call"), start);

    let speed = SpeedLimits { tip_m_s: Some(0.1), joint_rad_s: None };
    let slow = Surroundings { limits: speed, ..Surroundings::default() };
    bench.arm.keep_clear(Some(kinematics.among(slow, None)));
    let began_s = bench.arm.sim().get_simulation_time().expect("a call");
    bench.arm.move_to_joints(&goal, &limits, &none).expect("nothing is in the way");
    let took_s = bench.arm.sim().get_simulation_time().expect("a call") - began_s;
    let radius_m = kinematics.tip(&start).translation().xy().norm();
    let least_s = 0.8 * radius_m / 0.1;
    assert!(took_s >= least_s, "{took_s} s for a way of at least {least_s} s");
}

/// Out of reach the tip leaves its line and ends as near as it can: an obstacle there is in the way as well.
#[test]
fn a_line_that_leads_out_of_reach_is_gone_through_to_its_end_before_anything_moves() {
    let mut bench = realistic();
    let kinematics = bench.kinematics();
    let start = bench.arm.joint_values().expect("a call");
    let far = Pose::from_isometry(Translation3::new(1.5, 0.0, 0.0) * bench.tip().isometry());
    let (limits, none) = (MotionLimits::uniform(4, 0.5, 2.0, 20.0), CancelToken::default());
    let go = |bench: &mut Bench| bench.arm.move_to_pose(&far, &limits, &MotionTolerance::default(), &none);
    let unreached = go(&mut bench);
    assert!(matches!(unreached, Err(LinkError::Unreached { .. })), "{unreached:?}");
    let end = bench.tip().translation();
    bench.arm.move_to_joints(&start, &MotionLimits::uniform(6, 1.0, 3.0, 30.0), &none).expect("back again");
    let post = Obstacle::new("post", Isometry3::from(end), [0.02; 3]);
    bench.arm.keep_clear(Some(kinematics.among(Surroundings::of(vec![post]), None)));
    let before = bench.arm.joint_values().expect("a call");
    let refused = go(&mut bench);
    assert!(matches!(refused, Err(LinkError::InTheWay { .. })), "{refused:?}");
    assert_eq!(bench.arm.joint_values().expect("a call"), before);
}
