use nalgebra::Isometry3;

use super::super::tree::Kind;
use super::*;

struct Scene {
    tree: Tree,
    robot: Handle,
    joints: Vec<Handle>,
    links: Vec<Handle>,
    tip: Handle,
}

/// A model of six nested joints and links with a tip at the end, and two boxes.
fn scene() -> Scene {
    let mut tree = Tree::default();
    let mut add = |alias, parent| tree.add(alias, Kind::Shape, parent, Isometry3::identity()).expect("room");
    let robot = add("UR5", None);
    let (mut joints, mut links) = (Vec::new(), Vec::new());
    let mut parent = robot;
    for _ in 0..6 {
        joints.push(add("joint", Some(parent)));
        links.push(add("link", joints.last().copied()));
        parent = *links.last().expect("just added");
    }
    let connection = add("connection", Some(parent));
    let tip = add("Tip", Some(connection));
    add("box", None);
    add("box", None);
    tree.get_mut(robot).expect("exists").model_base = true;
    Scene { tree, robot, joints, links, tip }
}

fn at(scene: &Scene, path: &str) -> Result<Handle, WorldError> {
    find(&scene.tree, path, None, None)
}

#[test]
fn an_index_walks_down_the_chain_of_equal_names() {
    let scene = scene();
    for (index, &joint) in scene.joints.iter().enumerate() {
        assert_eq!(find(&scene.tree, "/UR5/joint", Some(index), None), Ok(joint));
        assert_eq!(at(&scene, &format!("/UR5/joint{{{index}}}")), Ok(joint));
    }
    assert_eq!(find(&scene.tree, "/UR5/joint", Some(6), None), Err(WorldError::NoSuchPath));
}

#[test]
fn explicit_paths_and_skipped_levels_both_match() {
    let scene = scene();
    assert_eq!(at(&scene, "/UR5/joint/link/joint/link"), Ok(scene.links[1]));
    assert_eq!(at(&scene, "/UR5/Tip"), Ok(scene.tip));
    assert_eq!(at(&scene, "/Tip"), Ok(scene.tip));
    assert_eq!(at(&scene, "/UR5"), Ok(scene.robot));
}

#[test]
fn a_number_in_brackets_counts_siblings_and_goes_no_deeper() {
    let scene = scene();
    let boxes: Vec<Handle> = scene.tree.roots()[1..].to_vec();
    assert_eq!(at(&scene, "/box[0]"), Ok(boxes[0]));
    assert_eq!(at(&scene, "/box[1]"), Ok(boxes[1]));
    assert_eq!(at(&scene, "/box[2]"), Err(WorldError::NoSuchPath));
    assert_eq!(at(&scene, "/UR5/joint[1]"), Err(WorldError::NoSuchPath));
    // The second joint in order, and then the first link below it.
    assert_eq!(at(&scene, "/UR5/joint{1}/link"), Ok(scene.links[1]));
}

#[test]
fn wildcards_match_names_and_case_counts() {
    let scene = scene();
    assert_eq!(at(&scene, "/UR?/T*"), Ok(scene.tip));
    assert_eq!(at(&scene, "/*5/*n*tion/T?p"), Ok(scene.tip));
    assert_eq!(at(&scene, "/ur5"), Err(WorldError::NoSuchPath));
    assert!(matches_wildcards("a*b*c", "a_b_b_c") && !matches_wildcards("a*b*c", "a_c_b"));
}

#[test]
fn relative_paths_start_at_the_proxy() {
    let scene = scene();
    let find = |path, proxy| find(&scene.tree, path, None, Some(proxy));
    assert_eq!(find("./Tip", scene.robot), Ok(scene.tip));
    assert_eq!(find(".", scene.tip), Ok(scene.tip));
    assert_eq!(find(":", scene.tip), Ok(scene.robot));
    assert_eq!(find(":/joint", scene.tip), Ok(scene.joints[0]));
    assert_eq!(find("../../link", scene.links[1]), Ok(scene.links[1]));
    assert_eq!(find("::", scene.tip), Err(WorldError::NoSuchPath));
    assert_eq!(find("./Tip", 99_999), Err(WorldError::NoSuchProxy));
    assert_eq!(at(&scene, "./Tip"), Ok(scene.tip));
}

#[test]
fn what_is_no_path_is_an_error_and_not_a_panic() {
    let scene = scene();
    for path in
        ["", "UR5", "/", "//", "/UR5//Tip", "/UR5/", "/[0]", "/box[", "/box]", "/box[x]", "/box{-1}", ".", ":", "é[0"]
    {
        assert_eq!(at(&scene, path), Err(WorldError::NoSuchPath), "{path}");
    }
}

#[test]
fn a_path_made_to_explode_gives_up() {
    let mut tree = Tree::default();
    let mut parent = None;
    for _ in 0..100 {
        parent = Some(tree.add("a", Kind::Shape, parent, Isometry3::identity()).expect("room"));
    }
    assert_eq!(find(&tree, &"/*".repeat(31), Some(usize::MAX), None), Err(WorldError::NoSuchPath));
}

#[test]
fn every_alias_form_with_a_path_leads_back_to_its_object() {
    let scene = scene();
    for (handle, _) in scene.tree.iter() {
        for options in [1, 2, 5, 7, 9] {
            let path = alias(&scene.tree, handle, options).expect("exists");
            assert_eq!(at(&scene, &path), Ok(handle), "option {options}: {path}");
        }
    }
    assert_eq!(alias(&scene.tree, scene.joints[2], -1).as_deref(), Ok("joint"));
    assert_eq!(alias(&scene.tree, scene.tip, 1).as_deref(), Ok("/Tip"));
    assert_eq!(alias(&scene.tree, scene.joints[2], 7).as_deref(), Ok("/UR5/joint{2}"));
    assert_eq!(alias(&scene.tree, scene.tree.roots()[1], 0).as_deref(), Ok("box[0]"));
    assert_eq!(alias(&scene.tree, scene.tip, 77), Err(WorldError::InvalidArguments));
}
