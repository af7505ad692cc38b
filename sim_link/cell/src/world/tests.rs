use handeye_geometry::camera::Intrinsics;

use super::*;

fn world() -> (World, Handle, Handle) {
    let mut world = World::default();
    let joint = Kind::Joint(Box::new(Joint::new(-3.0, 3.0)));
    let joint = world.tree.add("joint", joint, None, Isometry3::identity()).expect("room");
    let sensor = VisionSensor::new(Intrinsics::pinhole(4, 2, 3.0), 0.01, 3.5);
    let sensor = Kind::VisionSensor(Box::new(sensor));
    let sensor = world.tree.add("camera", sensor, Some(joint), Isometry3::translation(1.0, 0.0, 0.0)).expect("room");
    (world, joint, sensor)
}

fn states(world: &mut World, passes: usize) -> Vec<i64> {
    (0..passes)
        .map(|_| {
            world.run_pass();
            world.simulation().state() as i64
        })
        .collect()
}

#[test]
fn a_simulation_starts_runs_pauses_resumes_and_ends_in_the_documented_states() {
    let (mut world, ..) = world();
    assert_eq!(states(&mut world, 1), [0]);
    world.start_simulation();
    assert_eq!(world.simulation().state() as i64, 16);
    assert_eq!(states(&mut world, 2), [17, 17]);
    world.pause_simulation();
    assert_eq!(states(&mut world, 4), [19, 8, 8, 8]);
    world.start_simulation();
    assert_eq!(world.simulation().state() as i64, 20);
    assert_eq!(states(&mut world, 1), [17]);
    world.stop_simulation();
    assert_eq!(world.simulation().state() as i64, 17);
    assert_eq!(states(&mut world, 4), [21, 22, 0, 0]);
}

#[test]
fn a_paused_simulation_can_be_stopped() {
    let (mut world, ..) = world();
    world.start_simulation();
    world.pause_simulation();
    assert_eq!(states(&mut world, 2), [19, 8]);
    world.stop_simulation();
    assert!(states(&mut world, 3).ends_with(&[0]));
}

#[test]
fn time_advances_at_the_end_of_a_pass_and_stays_after_the_end() {
    let (mut world, ..) = world();
    world.start_simulation();
    assert_eq!(world.simulation().time_s(), 0.0);
    let mut passes = 0;
    while world.simulation().time_s() < 5.0 {
        world.run_pass();
        passes += 1;
        assert!((world.simulation().time_s() - f64::from(passes) * 0.05).abs() < 1e-12);
    }
    assert_eq!(passes, 101, "steps are added up, rounding and all");
    world.stop_simulation();
    while world.simulation().is_advancing() {
        world.run_pass();
    }
    assert!((world.simulation().time_s() - 5.2).abs() < 1e-12, "{}", world.simulation().time_s());
    world.start_simulation();
    assert_eq!(world.simulation().time_s(), 0.0);
}

#[test]
fn poses_and_joints_are_restored_at_the_end_and_buffers_cleared() {
    let (mut world, joint, sensor) = world();
    world.tree.joint_mut(joint).expect("joint").set_position(0.25).expect("finite");
    world.start_simulation();
    world.tree.joint_mut(joint).expect("joint").set_position(1.0).expect("finite");
    world.tree.set_world_pose(sensor, &Isometry3::identity()).expect("exists");
    world.run_pass();
    assert!(world.tree.sensor(sensor).expect("sensor").shown().is_some());
    world.stop_simulation();
    while world.simulation().is_advancing() {
        world.run_pass();
    }
    assert_eq!(world.tree.joint(joint).expect("joint").position_rad(), 0.25);
    assert_eq!(world.tree.get(sensor).expect("exists").local(), &Isometry3::translation(1.0, 0.0, 0.0));
    assert!(world.tree.sensor(sensor).expect("sensor").shown().is_none());
}

#[test]
fn what_was_hung_elsewhere_meanwhile_stays_there() {
    let (mut world, _, sensor) = world();
    world.start_simulation();
    world.tree.set_parent(sensor, None, true).expect("exists");
    let moved = Isometry3::translation(0.0, 0.0, 2.0);
    world.tree.set_world_pose(sensor, &moved).expect("exists");
    world.stop_simulation();
    while world.simulation().is_advancing() {
        world.run_pass();
    }
    assert_eq!(world.tree.world_pose(sensor, Chain::Reported), Ok(moved));
}

#[test]
fn sensors_show_what_was_there_in_the_last_pass_and_nothing_later() {
    let (mut world, joint, sensor) = world();
    world.start_simulation();
    world.run_pass();
    let first = world.tree.sensor(sensor).expect("sensor").shown().cloned().expect("a pass was run");
    world.tree.joint_mut(joint).expect("joint").set_position(1.0).expect("finite");
    assert_eq!(world.tree.sensor(sensor).expect("sensor").shown(), Some(&first));
    world.run_pass();
    let second = world.tree.sensor(sensor).expect("sensor").shown().cloned().expect("a pass was run");
    assert_ne!(first.moment, second.moment);
    world.run_pass();
    let third = world.tree.sensor(sensor).expect("sensor").shown().cloned().expect("a pass was run");
    assert!(Arc::ptr_eq(&second.moment, &third.moment), "nothing moved, so nothing need be drawn again");
    assert_eq!(third.pass, second.pass + 1);
}

#[test]
fn sensors_show_a_joint_that_was_moved_within_a_pass_when_they_are_handled() {
    let (mut world, joint, sensor) = world();
    world.start_simulation();
    world.run_pass();
    let shown = |world: &World| world.tree.sensor(sensor).expect("sensor").shown().cloned().expect("a pass was run");
    let before = shown(&world);
    world.handle_sensors(Sensors::AllButExplicit).expect("no sensor is missing");
    assert!(Arc::ptr_eq(&before.moment, &shown(&world).moment), "nothing moved, so nothing need be drawn again");
    world.tree.joint_mut(joint).expect("joint").set_position(1.0).expect("finite");
    world.handle_sensors(Sensors::AllButExplicit).expect("no sensor is missing");
    let now = shown(&world);
    assert_ne!(now.moment, before.moment);
    assert_eq!(now.time_s, world.simulation().time_s());
}

#[test]
fn explicitly_handled_sensors_wait_for_the_request() {
    let (mut world, _, sensor) = world();
    assert_eq!(world.handle_sensors(Sensors::One(sensor)), Err(WorldError::NotExplicitlyHandled));
    let Kind::VisionSensor(handled) = &mut world.tree.get_mut(sensor).expect("there").kind else { panic!("a sensor") };
    handled.explicit = true;
    world.start_simulation();
    world.run_pass();
    assert!(world.tree.sensor(sensor).expect("sensor").shown().is_none());
    world.handle_sensors(Sensors::One(sensor)).expect("explicit");
    assert!(world.tree.sensor(sensor).expect("sensor").shown().is_some());
}

#[derive(Debug)]
struct Bent(Handle);

impl Faults for Bent {
    fn apply(&mut self, tree: &mut Tree) {
        tree.get_mut(self.0).expect("exists").displacement = turn_z(0.1);
    }
}

#[test]
fn cameras_see_the_robot_with_its_faults_and_clients_without() {
    let (mut world, joint, sensor) = world();
    world.set_faults(Box::new(Bent(joint)));
    world.start_simulation();
    world.run_pass();
    let shown = world.tree.sensor(sensor).expect("sensor").shown().cloned().expect("a pass was run");
    let seen_from = shown.moment.pose(sensor).expect("was there").translation.vector;
    assert!((seen_from.y - 0.1_f64.sin()).abs() < 1e-12);
    assert_eq!(poses::get(&world.tree, Flagged::parse(sensor), -1).expect("exists").translation.vector.y, 0.0);
}

#[test]
fn the_time_step_is_fixed_while_a_simulation_runs() {
    let (mut world, ..) = world();
    assert_eq!(world.set_time_step(f64::NAN), Err(WorldError::InvalidArguments));
    world.set_time_step(0.01).expect("stopped");
    world.start_simulation();
    world.run_pass();
    assert_eq!(world.simulation().time_s(), 0.01);
    assert_eq!(world.set_time_step(0.05), Err(WorldError::SimulationNotStopped));
}
