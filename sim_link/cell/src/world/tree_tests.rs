use std::f64::consts::{FRAC_PI_2, TAU};

use super::*;

fn joint() -> Kind {
    Kind::Joint(Box::new(Joint::new(-TAU, TAU)))
}

fn dummy() -> Kind {
    Kind::Dummy { size_m: 0.01 }
}

/// A joint one metre up with a dummy one metre along its x.
fn arm() -> (Tree, Handle, Handle) {
    let mut tree = Tree::default();
    let joint = tree.add("joint", joint(), None, Isometry3::translation(0.0, 0.0, 1.0)).expect("room");
    let tip = tree.add("tip", dummy(), Some(joint), Isometry3::translation(1.0, 0.0, 0.0)).expect("room");
    (tree, joint, tip)
}

#[test]
fn what_hangs_on_a_joint_turns_with_it_and_the_joint_itself_does_not() {
    let (mut tree, joint, tip) = arm();
    tree.joint_mut(joint).expect("joint").set_position(FRAC_PI_2).expect("finite");
    let tip_pose = tree.world_pose(tip, Chain::Reported).expect("exists");
    assert!((tip_pose.translation.vector - Vector3::new(0.0, 1.0, 1.0)).norm() < 1e-12);
    let fixed = tree.world_pose(joint, Chain::Reported).expect("exists");
    assert_eq!(fixed, Isometry3::translation(0.0, 0.0, 1.0));
    let moving = tree.moving_pose(joint, Chain::Reported).expect("exists");
    assert!((moving.rotation.angle() - FRAC_PI_2).abs() < 1e-12);
}

#[test]
fn displacements_move_the_actual_chain_and_leave_the_reported_one() {
    let (mut tree, joint, tip) = arm();
    tree.get_mut(joint).expect("exists").displacement = turn_z(0.01);
    let reported = tree.world_pose(tip, Chain::Reported).expect("exists");
    let actual = tree.world_pose(tip, Chain::Actual).expect("exists");
    assert_eq!(reported.translation.vector, Vector3::new(1.0, 0.0, 1.0));
    assert!((actual.translation.vector.y - 0.01_f64.sin()).abs() < 1e-15);
}

#[test]
fn a_world_pose_set_under_a_turned_joint_is_the_one_read_back() {
    let (mut tree, joint, tip) = arm();
    tree.joint_mut(joint).expect("joint").set_position(1.0).expect("finite");
    let pose = Isometry3::new(Vector3::new(0.3, -0.2, 0.7), Vector3::new(0.1, 0.2, -0.3));
    tree.set_world_pose(tip, &pose).expect("exists");
    let read = tree.world_pose(tip, Chain::Reported).expect("exists");
    assert!((read.translation.vector - pose.translation.vector).norm() < 1e-12);
    assert!(read.rotation.angle_to(&pose.rotation) < 1e-7);
}

#[test]
fn removing_an_object_leaves_its_children_in_place() {
    let (mut tree, joint, tip) = arm();
    let before = tree.world_pose(tip, Chain::Reported).expect("exists");
    tree.remove(joint).expect("exists");
    assert_eq!(tree.get(joint).expect_err("removed"), WorldError::NoSuchObject);
    assert_eq!(tree.get(tip).expect("stays").parent(), None);
    assert!(
        (tree.world_pose(tip, Chain::Reported).expect("stays").translation.vector - before.translation.vector).norm()
            < 1e-12
    );
    assert_eq!(tree.roots(), [tip]);
}

#[test]
fn an_object_cannot_hang_under_itself() {
    let (mut tree, joint, tip) = arm();
    assert_eq!(tree.set_parent(joint, Some(tip), true), Err(WorldError::CyclicParent));
    assert_eq!(tree.set_parent(joint, Some(joint), true), Err(WorldError::CyclicParent));
    assert_eq!(tree.get(tip).expect("exists").parent(), Some(joint));
}

#[test]
fn nesting_and_number_of_objects_are_bounded() {
    let mut tree = Tree::default();
    let mut parent = None;
    let refused = (0..2 * MAX_DEPTH).find_map(|_| match tree.add("d", dummy(), parent, Isometry3::identity()) {
        Ok(handle) => {
            parent = Some(handle);
            None
        }
        Err(error) => Some(error),
    });
    assert_eq!(refused, Some(WorldError::TooMany { what: "levels of objects", limit: MAX_DEPTH }));
    // A chain that is as deep as may be cannot be hung under something else either.
    let top = tree.roots()[0];
    let other = tree.add("other", dummy(), None, Isometry3::identity()).expect("room");
    assert!(matches!(tree.set_parent(top, Some(other), false), Err(WorldError::TooMany { .. })));
    let refused = (0..=MAX_OBJECTS).find_map(|_| tree.add("d", dummy(), None, Isometry3::identity()).err());
    assert_eq!(refused, Some(WorldError::TooMany { what: "objects", limit: MAX_OBJECTS }));
}

#[test]
fn a_subtree_comes_breadth_first() {
    let mut tree = Tree::default();
    let mut add = |alias, parent| tree.add(alias, dummy(), parent, Isometry3::identity()).expect("room");
    let base = add("base", None);
    let a = add("a", Some(base));
    let below_a = add("below a", Some(a));
    let b = add("b", Some(base));
    assert_eq!(tree.subtree(base), Ok(vec![base, a, b, below_a]));
}
