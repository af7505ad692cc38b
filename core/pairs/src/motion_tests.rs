use std::f64::consts::PI;

use approx::assert_relative_eq;
use nalgebra::{Isometry3, Translation3};
use proptest::prelude::*;

use super::*;

fn pose(translation_m: [f64; 3], rotation_vector: [f64; 3]) -> Pose<Anchor, Mount> {
    Pose::from_isometry(Isometry3::from_parts(
        Translation3::from(translation_m),
        UnitQuaternion::from_scaled_axis(Vector3::from(rotation_vector)),
    ))
}

fn about(axis: Vector3<f64>, angles_deg: &[f64]) -> Vec<Pose<Anchor, Mount>> {
    let anchor_from_first = pose([0.3, -0.2, 0.9], [0.4, 1.0, -0.7]);
    angles_deg
        .iter()
        .enumerate()
        .map(|(i, angle)| {
            let turn = axis.normalize() * angle.to_radians();
            anchor_from_first * pose([0.1 * i as f64, 0.05, -0.02 * i as f64], turn.into()).relabel::<Mount, Mount>()
        })
        .collect()
}

/// Turns by 40° about x and by 90° about z of the mount.
fn two_axes() -> Vec<Pose<Anchor, Mount>> {
    let mut poses = about(Vector3::z(), &[0.0, 90.0]);
    poses.extend(about(Vector3::x(), &[40.0]));
    poses
}

#[test]
fn two_views_are_too_few() {
    let error = analyse(&two_axes()[..2]).expect_err("degenerate");
    assert_eq!(error, HandEyeError::TooFewViews { got: 2, need: MIN_VIEWS });
    assert_eq!(analyse(&[]).expect_err("degenerate"), HandEyeError::TooFewViews { got: 0, need: MIN_VIEWS });
}

#[test]
fn the_first_pose_that_is_not_finite_is_named() {
    let mut poses = two_axes();
    poses[1] = pose([0.0, f64::NAN, 0.0], [0.0; 3]);
    poses[2] = pose([f64::INFINITY, 0.0, 0.0], [0.0; 3]);
    assert_eq!(analyse(&poses).expect_err("degenerate"), HandEyeError::NotFinite { index: 1 });
}

#[test]
fn translations_alone_are_no_rotation_and_the_largest_turn_is_reported() {
    let error = analyse(&about(Vector3::new(0.2, 0.9, -0.3), &[0.0, 0.3, 0.8])).expect_err("degenerate");
    let HandEyeError::NoRotation { largest_deg } = error else { panic!("{error}") };
    assert_relative_eq!(largest_deg, 0.8, epsilon = 1e-9);
}

#[test]
fn parallel_axes_are_named_in_the_mount_frame_wherever_the_anchor_is() {
    let axis = Vector3::new(1.0, -2.0, 0.5).normalize();
    // 180° and 200° are on both sides of the half turn, where rotation vectors change direction.
    let error = analyse(&about(axis, &[0.0, 30.0, 90.0, 180.0, 200.0])).expect_err("degenerate");
    let HandEyeError::ParallelAxes { axis: found, frame, spread_deg } = error else { panic!("{error}") };
    assert_relative_eq!(Vector3::from(found), -axis, epsilon = 1e-7);
    assert_eq!(frame, "mount");
    assert!(spread_deg < 1e-5, "{spread_deg}");
}

#[test]
fn axes_that_differ_only_by_joint_noise_still_count_as_parallel() {
    let mut poses = about(Vector3::z(), &[0.0, 25.0, 50.0, 75.0, -40.0]);
    for (i, pose_of_view) in poses.iter_mut().enumerate() {
        let wobble_rad = 0.1f64.to_radians() * if i % 2 == 0 { 1.0 } else { -1.0 };
        *pose_of_view = *pose_of_view * pose([0.0; 3], [wobble_rad, 0.0, 0.0]).relabel::<Mount, Mount>();
    }
    assert!(matches!(analyse(&poses), Err(HandEyeError::ParallelAxes { .. })));
}

#[test]
fn repeated_poses_do_not_hide_that_one_axis_is_missing() {
    let mut poses = about(Vector3::y(), &[0.0, 60.0]);
    poses.extend(poses.clone());
    poses.extend(poses.clone());
    assert!(matches!(analyse(&poses), Err(HandEyeError::ParallelAxes { .. })));
}

#[test]
fn the_summary_tells_how_far_and_about_what_the_robot_turned() {
    let poses =
        [pose([0.0; 3], [0.0; 3]), pose([0.0, 0.3, 0.4], [0.0, 0.0, PI]), pose([0.1, 0.0, 0.0], [0.5, 0.0, 0.0])];
    let summary = analyse(&poses).expect("two axes");
    assert_eq!(summary.views, 3);
    assert_relative_eq!(summary.largest_rotation_rad, PI, epsilon = 1e-9);
    assert_relative_eq!(summary.median_rotation_rad, PI, epsilon = 1e-9);
    // Between the second and the third view.
    assert_relative_eq!(summary.largest_translation_m, 0.1f64.hypot(0.5), epsilon = 1e-12);
    let [strong, middle, weak] = summary.principal_rotations_rad;
    assert!(strong > middle && middle > weak);
    assert_relative_eq!(summary.axis_spread_rad, middle.atan2(strong), epsilon = 1e-12);
    assert!(summary.principal_axes[0].z > 0.9, "{}", summary.principal_axes[0]);
    // A half turn and a turn of 0.5 about x give chords 2 and 2 sin(0.25), and 2 again for the half turn between them
    // about an axis tilted by 0.25: the squares sum up to 4 + 4 + 4 sin²(0.25).
    let sum: f64 = summary.principal_rotations_rad.iter().map(|r| 3.0 * r * r).sum();
    assert_relative_eq!(sum, 8.0 + 4.0 * 0.25f64.sin().powi(2), epsilon = 1e-9);
}

proptest! {
    #[test]
    fn the_anchor_frame_changes_nothing_and_the_mount_frame_turns_the_axes(
        anchor in (prop::array::uniform3(-2.0..2.0f64), prop::array::uniform3(-1.5..1.5f64)),
        mount in (prop::array::uniform3(-2.0..2.0f64), prop::array::uniform3(-1.5..1.5f64)),
    ) {
        let original = analyse(&two_axes()).expect("two axes");
        let new_from_mount = pose(mount.0, mount.1).relabel::<Mount, Mount>();
        let moved: Vec<_> = two_axes()
            .iter()
            .map(|p| pose(anchor.0, anchor.1).relabel::<Anchor, Anchor>() * *p * new_from_mount.inverse())
            .collect();
        let summary = analyse(&moved).expect("two axes");
        prop_assert!((summary.axis_spread_rad - original.axis_spread_rad).abs() < 1e-9);
        prop_assert!((summary.largest_rotation_rad - original.largest_rotation_rad).abs() < 1e-9);
        for (axis, original_axis) in summary.principal_axes.iter().zip(&original.principal_axes) {
            // Axes have no sign.
            let cosine = axis.dot(&(new_from_mount.rotation() * original_axis)).abs();
            prop_assert!((cosine - 1.0).abs() < 1e-9);
        }
    }
}
