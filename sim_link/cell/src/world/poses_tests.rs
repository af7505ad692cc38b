use std::f64::consts::FRAC_PI_2;

use super::super::joint::Joint;
use super::*;

fn pose(x: f64, y: f64, z: f64, r: [f64; 3]) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(x, y, z), Vector3::from(r))
}

fn near(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-9 && a.rotation.angle_to(&b.rotation) < 1e-7
}

#[test]
fn euler_angles_are_rx_ry_rz() {
    let angles = [0.3, -0.7, 2.1];
    let rotation = rotation_from_euler(&angles).expect("finite");
    let (s, c) = (0.3_f64.sin(), 0.3_f64.cos());
    // Element (1, 2) of Rx·Ry·Rz is −sin α cos β.
    let m = rotation.to_rotation_matrix();
    assert!((m[(1, 2)] + s * (-0.7_f64).cos()).abs() < 1e-12);
    assert!((m[(2, 2)] - c * (-0.7_f64).cos()).abs() < 1e-12);
    for (a, b) in euler_from_rotation(&rotation).iter().zip(angles) {
        assert!((a - b).abs() < 1e-12);
    }
}

#[test]
fn euler_angles_at_the_pole_still_describe_the_rotation() {
    let rotation = rotation_from_euler(&[0.4, FRAC_PI_2, 0.3]).expect("finite");
    let angles = euler_from_rotation(&rotation);
    assert_eq!(angles[0], 0.0);
    assert!(rotation_from_euler(&angles).expect("finite").angle_to(&rotation) < 1e-7);
}

#[test]
fn matrices_are_made_orthonormal_with_z_kept() {
    let original = pose(0.1, 0.2, 0.3, [0.4, -0.5, 0.6]);
    let mut m = to_matrix(&original);
    for row in 0..3 {
        m[4 * row] += 0.2 * m[4 * row + 2];
        m[4 * row + 2] *= 3.0;
    }
    assert!(near(&from_matrix(&m).expect("spans a frame"), &original));
    assert_eq!(from_matrix(&[0.0; 12]), Err(WorldError::InvalidData));
    m[7] = f64::NAN;
    assert_eq!(from_matrix(&m), Err(WorldError::InvalidData));
}

#[test]
fn quaternions_are_normalised_and_come_in_either_order() {
    let p = from_numbers(&[1.0, 2.0, 3.0, 0.0, 0.0, 2.0, 2.0], false).expect("a rotation");
    assert!((p.rotation.angle() - FRAC_PI_2).abs() < 1e-12);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (a, b) in to_numbers(&p, true).iter().zip([1.0, 2.0, 3.0, half, 0.0, 0.0, half]) {
        assert!((a - b).abs() < 1e-12);
    }
    assert_eq!(from_numbers(&[0.0; 7], false), Err(WorldError::InvalidData));
    assert_eq!(from_numbers(&[0.0, 0.0, f64::INFINITY, 0.0, 0.0, 0.0, 1.0], false), Err(WorldError::InvalidData));
}

#[test]
fn poses_relative_to_a_joint_are_in_the_frame_that_moves_unless_the_flag_says_otherwise() {
    let mut tree = Tree::default();
    let joint = tree
        .add("j", Kind::Joint(Box::new(Joint::new(-3.0, 3.0))), None, pose(0.0, 0.0, 1.0, [0.1, 0.0, 0.0]))
        .expect("room");
    let tip = tree.add("t", Kind::Shape, Some(joint), pose(0.5, 0.0, 0.0, [0.0; 3])).expect("room");
    tree.joint_mut(joint).expect("joint").set_position(0.7).expect("finite");
    let moving = get(&tree, Flagged::parse(tip), joint).expect("both exist");
    assert!(near(&moving, &pose(0.5, 0.0, 0.0, [0.0; 3])));
    assert_eq!(get(&tree, Flagged::parse(tip), HANDLE_PARENT).expect("both exist"), moving);
    let fixed = get(&tree, Flagged::parse(tip + FLAG_JOINT_BASE), joint).expect("both exist");
    assert!(near(&fixed, &(pose(0.0, 0.0, 0.0, [0.0, 0.0, 0.7]) * pose(0.5, 0.0, 0.0, [0.0; 3]))));
}

#[test]
fn what_is_set_relative_to_anything_is_read_back_from_there() {
    let mut tree = Tree::default();
    let joint = tree
        .add("j", Kind::Joint(Box::new(Joint::new(-3.0, 3.0))), None, pose(0.0, 0.0, 1.0, [0.1, 0.0, 0.0]))
        .expect("room");
    let object = tree.add("o", Kind::Shape, Some(joint), pose(0.5, 0.0, 0.0, [0.0; 3])).expect("room");
    let other = tree.add("p", Kind::Shape, None, pose(0.5, -2.0, 0.0, [0.0, 1.0, 0.3])).expect("room");
    tree.joint_mut(joint).expect("joint").set_position(-1.3).expect("finite");
    let wanted = pose(0.2, 0.3, -0.4, [0.5, 0.6, -0.7]);
    for relative_to in [HANDLE_WORLD, HANDLE_PARENT, HANDLE_INVERSE, joint, other] {
        set(&mut tree, Flagged::parse(object), relative_to, &wanted).expect("valid");
        let read = get(&tree, Flagged::parse(object), relative_to).expect("both exist");
        assert!(near(&read, &wanted), "relative to {relative_to}");
    }
    assert_eq!(set(&mut tree, Flagged::parse(object), 4711, &wanted), Err(WorldError::NoSuchReference));
    assert_eq!(set(&mut tree, Flagged::parse(4711), -1, &wanted), Err(WorldError::NoSuchObject));
}

#[test]
fn interpolation_goes_the_short_way() {
    let from = pose(0.0, 0.0, 0.0, [0.0, 0.0, 3.0]);
    let to = pose(1.0, 0.0, 0.0, [0.0, 0.0, -3.0]);
    let middle = interpolate(&from, &to, 0.5);
    assert!((middle.translation.vector.x - 0.5).abs() < 1e-12);
    assert!((middle.rotation.angle() - std::f64::consts::PI).abs() < 1e-9);
    assert!(near(&interpolate(&from, &to, 1.0), &to));
}
