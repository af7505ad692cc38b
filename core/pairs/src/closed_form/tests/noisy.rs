//! Sessions with noise: what must not depend on the choice of frames, on the order of the views or on the side of a
//! half turn that noise puts a motion on.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;
use crate::HandEyeError;
use crate::closed_form::{all, by_name};

/// Metres and radians: as bad as poses of real sessions get.
const NOISE: f64 = 0.005;

/// Rounding, 1e-16 on metres and radians, times a condition number of up to 1e5.
const SAME: f64 = 1e-11;

/// Largest error of a method when poses are off by up to `NOISE`: the translation along an axis about which the two sure
/// tilts of [`robot_poses`] do not turn is worse than the poses by one over the sine of the tilt, on arms of metres. A
/// wrong sign at the half turn is off by a radian.
const STABLE: f64 = 20.0 * NOISE;

/// Changes of frame that a method follows, by the documentation of the methods: any change of the frame, a change of
/// its axes only, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Follows {
    Any,
    Axes,
    Nothing,
}
use Follows::{Any, Axes, Nothing};

/// For anchor, mount, camera and target.
const FRAMES: [(&str, [Follows; 4]); 7] = [
    ("tsai_lenz", [Any, Nothing, Nothing, Any]),
    ("park_martin", [Any, Any, Axes, Any]),
    ("horaud", [Any, Any, Axes, Any]),
    ("andreff", [Any, Any, Axes, Any]),
    ("daniilidis", [Any, Nothing, Nothing, Any]),
    ("shah", [Axes, Any, Any, Any]),
    ("li", [Axes, Axes, Any, Any]),
];

fn solve(name: &str, views: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
    by_name(name).expect("a method of that name").solve(views)
}

fn allowed(follows: Follows, change: &Isometry3<f64>) -> Isometry3<f64> {
    match follows {
        Any => *change,
        Axes => Isometry3::from_parts(Translation3::identity(), change.rotation),
        Nothing => Isometry3::identity(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_answer_follows_the_promised_changes_of_frame(
        truth in any_truth(),
        poses in robot_poses(),
        changes in [any_pose(), any_pose(), any_pose(), any_pose()],
        seed in any::<u64>(),
    ) {
        let views = with_noise(&truth.views(&poses), seed, NOISE);
        for (name, follows) in FRAMES {
            let [anchor, mount, camera, target] = std::array::from_fn(|k| allowed(follows[k], &changes[k]));
            let changed: Vec<_> = views
                .iter()
                .map(|view| PosePair {
                    anchor_from_mount: (anchor * view.anchor_from_mount.isometry() * mount.inverse()).into(),
                    camera_from_target: (camera * view.camera_from_target.isometry() * target.inverse()).into(),
                })
                .collect();
            let (Ok(before), Ok(after)) = (solve(name, &views), solve(name, &changed)) else {
                return Err(TestCaseError::fail(format!("{name} found no solution")));
            };
            let back = mount.inverse() * after.mount_from_camera.isometry() * camera;
            let moved = before.mount_from_camera.distance_to(&back.into());
            prop_assert!(moved.0.max(moved.1) < SAME, "{name} moved by {moved:?}");
        }
    }

    #[test]
    fn the_order_of_the_views_matters_only_where_promised(
        truth in any_truth(),
        poses in robot_poses(),
        seed in any::<u64>(),
    ) {
        let views = with_noise(&truth.views(&poses), seed, NOISE);
        let reversed: Vec<_> = views.iter().rev().copied().collect();
        for (name, translation_too) in [
            ("tsai_lenz", false), ("park_martin", false), ("horaud", false),
            ("daniilidis", true), ("shah", true), ("li", true),
        ] {
            let (Ok(one), Ok(other)) = (solve(name, &views), solve(name, &reversed)) else {
                return Err(TestCaseError::fail(format!("{name} found no solution")));
            };
            let (metres, radians) = one.mount_from_camera.distance_to(&other.mount_from_camera);
            prop_assert!(radians < SAME, "{name} turned by {radians:e}");
            prop_assert!(!translation_too || metres < SAME, "{name} moved by {metres:e}");
        }
    }

    #[test]
    fn the_sign_of_a_quaternion_means_nothing(
        truth in any_truth(),
        poses in robot_poses(),
        seed in any::<u64>(),
        flips in prop::collection::vec(any::<[bool; 2]>(), 9),
    ) {
        fn flipped(isometry: &Isometry3<f64>, flip: bool) -> Isometry3<f64> {
            let q = isometry.rotation.into_inner();
            Isometry3::from_parts(isometry.translation, UnitQuaternion::new_unchecked(if flip { -q } else { q }))
        }
        let views = with_noise(&truth.views(&poses), seed, NOISE);
        let same: Vec<_> = views
            .iter()
            .zip(&flips)
            .map(|(view, flip)| PosePair {
                anchor_from_mount: flipped(view.anchor_from_mount.isometry(), flip[0]).into(),
                camera_from_target: flipped(view.camera_from_target.isometry(), flip[1]).into(),
            })
            .collect();
        for method in all() {
            let (Ok(one), Ok(other)) = (method.solve(&views), method.solve(&same)) else {
                return Err(TestCaseError::fail(format!("{} found no solution", method.name())));
            };
            prop_assert!(difference(&one, &other) < SAME, "{}", method.name());
        }
    }

    /// Robot and camera then disagree about the direction of the axis.
    #[test]
    fn noise_across_a_half_turn_does_not_upset_the_answer(
        truth in any_truth(),
        poses in robot_poses(),
        axis in prop::array::uniform3(-1.0..1.0f64),
        seed in any::<u64>(),
    ) {
        let axis = nalgebra::Unit::try_new(Vector3::from(axis), 1e-3).unwrap_or(Vector3::y_axis());
        let half_turned = |angle| {
            let turn = Isometry3::from_parts([0.1, 0.2, -0.1].into(), UnitQuaternion::from_axis_angle(&axis, angle));
            poses[0] * Pose::from_isometry(turn)
        };
        let mut views = with_noise(&truth.views(&poses), seed, NOISE / 10.0);
        let robot_short_of_it = half_turned(PI - NOISE);
        let camera_beyond_it = truth.view(half_turned(PI + NOISE)).camera_from_target;
        views.push(PosePair { anchor_from_mount: robot_short_of_it, camera_from_target: camera_beyond_it });
        for name in ["tsai_lenz", "park_martin", "horaud", "daniilidis", "shah"] {
            let solution = solve(name, &views).map_err(|e| TestCaseError::fail(e.to_string()))?;
            let error = solution.mount_from_camera.distance_to(&truth.mount_from_camera);
            prop_assert!(error.0.max(error.1) < STABLE, "{name} is off by {error:?}");
        }
    }
}
