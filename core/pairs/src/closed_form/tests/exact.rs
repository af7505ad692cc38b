//! Noise-free sessions: every method finds the truth, however the session is arranged.

use std::f64::consts::PI;

use nalgebra::{Unit, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;
use crate::Mode;
use crate::closed_form::all;
use handeye_geometry::frames::{Base, Tip};

fn assert_all_find(truth: &Truth, views: &[PosePair]) -> Result<(), TestCaseError> {
    for method in all() {
        let solution = method.solve(views).map_err(|e| TestCaseError::fail(e.to_string()))?;
        let error = truth.error_of(&solution);
        prop_assert!(error < EXACT, "{} is off by {error:e}", method.name());
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn every_method_finds_the_links_of_an_eye_in_hand_session(truth in any_truth(), poses in robot_poses()) {
        let base_from_tip: Vec<Pose<Base, Tip>> = poses.iter().map(Pose::relabel).collect();
        let views: Vec<_> = base_from_tip
            .iter()
            .map(|pose| {
                let base_from_camera = *pose * truth.mount_from_camera.relabel::<Tip, Camera>();
                PosePair {
                    anchor_from_mount: Mode::EyeInHand.anchor_from_mount(pose),
                    camera_from_target: base_from_camera.inverse() * truth.anchor_from_target.relabel(),
                }
            })
            .collect();
        assert_all_find(&truth, &views)?;
    }

    #[test]
    fn every_method_finds_the_links_of_an_eye_to_hand_session(truth in any_truth(), poses in robot_poses()) {
        let camera_from_base = truth.mount_from_camera.relabel::<Base, Camera>().inverse();
        let tip_from_target = truth.anchor_from_target.relabel::<Tip, Target>();
        let views: Vec<_> = poses
            .iter()
            .map(|pose| {
                let base_from_tip = pose.relabel::<Base, Tip>();
                PosePair {
                    anchor_from_mount: Mode::EyeToHand.anchor_from_mount(&base_from_tip),
                    camera_from_target: camera_from_base * base_from_tip * tip_from_target,
                }
            })
            .collect();
        assert_all_find(&truth, &views)?;
    }

    #[test]
    fn repeated_views_change_nothing(truth in any_truth(), poses in robot_poses(), copies in 1..5usize) {
        let mut views = truth.views(&poses);
        views.extend(vec![views[1]; copies]);
        views.extend(vec![views[0]; copies]);
        assert_all_find(&truth, &views)?;
    }

    #[test]
    fn the_order_of_the_views_changes_nothing(truth in any_truth(), poses in robot_poses(), turn in 0..9usize) {
        let mut views = truth.views(&poses);
        let by = turn % views.len();
        views.rotate_left(by);
        views.reverse();
        assert_all_find(&truth, &views)?;
    }

    #[test]
    fn a_half_turn_between_two_views_changes_nothing(
        truth in any_truth(),
        poses in robot_poses(),
        axis in prop::array::uniform3(-1.0..1.0f64),
        off_rad in prop::sample::select(vec![0.0, 1e-15, -1e-15, 1e-9, -1e-9, 1e-4, -1e-4, 0.03, -0.03]),
    ) {
        let axis = Unit::try_new(Vector3::from(axis), 1e-3).unwrap_or(Vector3::y_axis());
        let turn = UnitQuaternion::from_axis_angle(&axis, PI + off_rad);
        let mut poses = poses;
        poses.push(poses[0] * Pose::from_isometry(Isometry3::from_parts([0.1, 0.2, -0.1].into(), turn)));
        assert_all_find(&truth, &truth.views(&poses))?;
    }

    #[test]
    fn a_camera_mounted_at_a_half_turn_is_found(
        truth in any_truth(),
        poses in robot_poses(),
        axis in prop::sample::select(vec![Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(0.6, 0.0, -0.8)]),
    ) {
        let rotation = UnitQuaternion::from_axis_angle(&Unit::new_normalize(axis), PI);
        let mount_from_camera = Isometry3::from_parts(truth.mount_from_camera.translation().into(), rotation);
        let truth = Truth { mount_from_camera: Pose::from_isometry(mount_from_camera), ..truth };
        assert_all_find(&truth, &truth.views(&poses))?;
    }
}

#[test]
fn three_views_are_enough_for_every_method() {
    let truth = Truth {
        mount_from_camera: Pose::from_isometry(isometry([0.1, -0.2, 0.05], [0.3, -1.2, 2.0])),
        anchor_from_target: Pose::from_isometry(isometry([1.0, 0.4, 0.0], [2.5, 0.1, 0.6])),
    };
    let poses = [
        isometry([0.3, 0.1, 0.5], [0.1, 0.2, 0.3]),
        isometry([0.4, 0.0, 0.4], [0.9, 0.1, 0.2]),
        isometry([0.2, 0.3, 0.6], [0.0, -0.7, 0.5]),
    ];
    assert_all_find(&truth, &truth.views(&poses.map(Pose::from_isometry))).expect("exact");
}
