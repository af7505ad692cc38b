use nalgebra::Vector3;

use super::*;
use crate::scene::{BoardMotionSpec, BoardPath};
use crate::world::{Chain, Kind, World, turn_z};

const TIME_STEP_S: f64 = 0.02;

fn course(path: BoardPath) -> Course {
    Course::new(&BoardMotionSpec { path, ..BoardMotionSpec::default() }, 1)
}

/// A world with a sheet that hangs on the wall and begins with a path.
fn world(path: BoardPath) -> (World, Handle) {
    let mut world = World::default();
    world.set_time_step(TIME_STEP_S).expect("in range");
    let pose = turn_z(0.7) * Isometry3::translation(1.0, 2.0, 3.0);
    let sheet = world.tree.add("sheet", Kind::Shape, None, pose).expect("room");
    world.carrier = Some(Carrier::new(sheet, course(path)));
    world.start_simulation();
    (world, sheet)
}

fn place(world: &World, sheet: Handle) -> Vector3<f64> {
    world.tree.world_pose(sheet, Chain::Actual).expect("exists").translation.vector
}

/// Places after each of some passes, the present one first.
fn run(world: &mut World, sheet: Handle, passes: usize) -> Vec<Vector3<f64>> {
    let mut places = vec![place(world, sheet)];
    for _ in 0..passes {
        world.run_pass();
        places.push(place(world, sheet));
    }
    places
}

/// Largest change of velocity from pass to pass, m/s.
fn roughness(places: &[Vector3<f64>]) -> f64 {
    places.windows(3).map(|p| (p[2] - 2.0 * p[1] + p[0]).norm() / TIME_STEP_S).fold(0.0, f64::max)
}

fn follow(world: &mut World, path: BoardPath) {
    world.carrier.as_mut().expect("there").follow(course(path));
}

#[test]
fn the_object_is_where_the_course_has_it_at_the_end_of_each_pass() {
    let (mut world, sheet) = world(BoardPath::RandomWalk);
    let start = world.tree.world_pose(sheet, Chain::Actual).expect("exists");
    for pass in 1..=200_u32 {
        world.run_pass();
        let expected = start * course(BoardPath::RandomWalk).offset(f64::from(pass) * TIME_STEP_S);
        let found = world.tree.world_pose(sheet, Chain::Actual).expect("exists");
        assert!((found.translation.vector - expected.translation.vector).norm() < 1e-12);
        assert!(found.rotation.angle_to(&expected.rotation) < 1e-7);
    }
}

#[test]
fn what_hangs_on_the_object_goes_along() {
    let (mut world, sheet) = world(BoardPath::Circle);
    let held = world.tree.add("panel", Kind::Shape, Some(sheet), Isometry3::translation(0.0, 0.0, -0.1)).expect("room");
    let relative = |world: &World| {
        let pose = |handle| world.tree.world_pose(handle, Chain::Actual).expect("exists");
        pose(sheet).inv_mul(&pose(held)).translation.vector
    };
    let before = place(&world, held);
    run(&mut world, sheet, 100);
    assert!((place(&world, held) - before).norm() > 0.03);
    assert!((relative(&world) - Vector3::new(0.0, 0.0, -0.1)).norm() < 1e-12);
}

#[test]
fn a_board_that_is_told_to_stand_comes_to_rest_without_a_jump() {
    let (mut world, sheet) = world(BoardPath::Circle);
    let mut places = run(&mut world, sheet, 200);
    follow(&mut world, BoardPath::Still);
    let braking = run(&mut world, sheet, 60);
    places.extend(&braking[1..]);
    // A jerk would be 0.1 m/s at once; the circle itself turns its velocity by 5 mm/s per pass.
    assert!(roughness(&places) < 0.01, "{} m/s", roughness(&places));
    let at_rest = &braking[31..];
    assert!(at_rest.windows(2).all(|pair| (pair[1] - pair[0]).norm() < 1e-12));
    let way: f64 = braking.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    assert!((way - 0.1 * 0.3).abs() < 0.001, "half of its speed for 0.6 s, not {way} m");
}

#[test]
fn going_over_from_one_path_to_another_is_smooth_however_often() {
    let (mut world, sheet) = world(BoardPath::Still);
    let mut places = vec![place(&world, sheet)];
    for (path, passes) in [
        (BoardPath::Circle, 90),
        (BoardPath::FigureEight, 7),
        (BoardPath::RandomWalk, 3),
        (BoardPath::Circle, 11),
        (BoardPath::RandomWalk, 300),
        (BoardPath::Still, 50),
    ] {
        follow(&mut world, path);
        places.extend(&run(&mut world, sheet, passes)[1..]);
    }
    assert!(roughness(&places) < 0.03, "{} m/s", roughness(&places));
    let last = &places[places.len() - 10..];
    assert!(last.iter().all(|place| (place - last[0]).norm() < 1e-12), "it stands");
}

#[test]
fn the_end_of_the_simulation_brings_back_place_path_and_sight() {
    let (mut world, sheet) = world(BoardPath::Circle);
    let start = place(&world, sheet);
    let first = run(&mut world, sheet, 100);
    follow(&mut world, BoardPath::RandomWalk);
    world.tree.get_mut(sheet).expect("there").hidden = true;
    run(&mut world, sheet, 50);
    world.stop_simulation();
    run(&mut world, sheet, 5);
    assert_eq!(place(&world, sheet), start);
    assert!(!world.tree.get(sheet).expect("there").hidden);
    world.start_simulation();
    assert_eq!(run(&mut world, sheet, 100), first, "the next run begins as the first did");
}

#[test]
fn a_path_asked_for_before_the_start_is_the_one_of_that_run() {
    let (mut world, sheet) = world(BoardPath::Circle);
    world.stop_simulation();
    run(&mut world, sheet, 5);
    follow(&mut world, BoardPath::Still);
    world.start_simulation();
    let start = place(&world, sheet);
    assert!(run(&mut world, sheet, 100).iter().all(|place| *place == start));
}

#[test]
fn a_board_that_somebody_puts_elsewhere_goes_on_from_there() {
    let (mut moved, sheet) = world(BoardPath::Circle);
    let (mut unmoved, _) = world(BoardPath::Circle);
    run(&mut moved, sheet, 100);
    run(&mut unmoved, sheet, 100);
    let sideways = Vector3::new(0.2, -0.1, 0.05);
    let mut pose = moved.tree.world_pose(sheet, Chain::Reported).expect("there");
    pose.translation.vector += sideways;
    moved.tree.set_world_pose(sheet, &pose).expect("there");
    for (a, b) in run(&mut moved, sheet, 200).iter().zip(run(&mut unmoved, sheet, 200)) {
        assert!((a - b - sideways).norm() < 1e-12, "{a} and {b}");
    }
}

#[test]
fn a_stepping_board_that_is_told_to_stand_stays_where_it_is() {
    let (mut world, sheet) = world(BoardPath::Step);
    run(&mut world, sheet, 210);
    let before = place(&world, sheet);
    follow(&mut world, BoardPath::Still);
    assert!(run(&mut world, sheet, 300).iter().all(|place| (place - before).norm() < 1e-12));
}

#[test]
fn a_client_that_asks_in_every_pass_fills_no_memory() {
    let (mut world, sheet) = world(BoardPath::Circle);
    for _ in 0..500 {
        follow(&mut world, BoardPath::RandomWalk);
        world.run_pass();
    }
    assert!(world.carrier.as_ref().expect("there").legs.len() <= MAX_LEGS);
    assert!(place(&world, sheet).iter().all(|v| v.is_finite()));
}

#[test]
fn an_object_that_was_removed_is_not_missed() {
    let (mut world, sheet) = world(BoardPath::Circle);
    world.tree.remove(sheet).expect("there");
    world.run_pass();
    assert!(!world.tree.contains(sheet));
}
