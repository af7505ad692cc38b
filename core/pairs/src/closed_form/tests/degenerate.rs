//! Sessions that do not determine an answer: a typed error that states why, never a panic and never a number.

use std::f64::consts::PI;

use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;
use crate::HandEyeError;
use crate::closed_form::{ClosedForm, all, by_name};

fn truth() -> Truth {
    Truth {
        mount_from_camera: Pose::from_isometry(isometry([0.1, -0.2, 0.05], [0.3, -1.2, 2.0])),
        anchor_from_target: Pose::from_isometry(isometry([1.0, 0.4, 0.0], [2.5, 0.1, 0.6])),
    }
}

fn views(poses: &[([f64; 3], [f64; 3])]) -> Vec<PosePair> {
    let poses: Vec<_> = poses.iter().map(|(t, r)| Pose::from_isometry(isometry(*t, *r))).collect();
    truth().views(&poses)
}

fn good_views() -> Vec<PosePair> {
    views(&[([0.0; 3], [0.0; 3]), ([0.2, 0.1, 0.0], [0.7, 0.0, 0.0]), ([0.0, -0.1, 0.2], [0.0, 0.7, 0.0])])
}

fn errors_of_all(views: &[PosePair]) -> Vec<HandEyeError> {
    all().iter().map(|method| method.solve(views).expect_err(method.name())).collect()
}

fn no_solution_of(name: &str, views: &[PosePair]) -> &'static str {
    match by_name(name).expect("a method of that name").solve(views) {
        Err(HandEyeError::NoSolution { method, views: count, reason }) => {
            assert_eq!((method, count), (name, views.len()));
            reason
        }
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn every_method_has_a_name_of_its_own_and_is_found_by_it() {
    let names = all().map(ClosedForm::name);
    assert_eq!(names, ["tsai_lenz", "park_martin", "horaud", "andreff", "daniilidis", "shah", "li"]);
    for name in names {
        assert_eq!(by_name(name).map(ClosedForm::name), Some(name));
    }
    assert!(by_name("Tsai").is_none());
}

#[test]
fn fewer_than_three_views_are_refused() {
    for count in 0..3 {
        for error in errors_of_all(&good_views()[..count]) {
            assert_eq!(error, HandEyeError::TooFewViews { got: count, need: 3 });
        }
    }
}

#[test]
fn a_pose_that_is_not_finite_is_refused_on_either_side() {
    let mut robot = good_views();
    robot[2].anchor_from_mount = Pose::from_isometry(isometry([f64::NAN, 0.0, 0.0], [0.0; 3]));
    let mut camera = good_views();
    camera[1].camera_from_target = Pose::from_isometry(isometry([0.0, f64::INFINITY, 0.0], [0.0; 3]));
    assert!(errors_of_all(&robot).iter().all(|e| *e == HandEyeError::NotFinite { index: 2 }));
    assert!(errors_of_all(&camera).iter().all(|e| *e == HandEyeError::NotFinite { index: 1 }));
}

#[test]
fn a_robot_that_only_translates_is_refused() {
    let views = views(&[([0.0; 3], [0.1; 3]), ([0.3, 0.1, 0.0], [0.1; 3]), ([0.0, -0.2, 0.4], [0.1; 3])]);
    assert!(errors_of_all(&views).iter().all(|e| matches!(e, HandEyeError::NoRotation { .. })));
}

#[test]
fn a_robot_that_turns_about_one_axis_is_refused_with_that_axis() {
    let z = |angle| [0.0, 0.0, angle];
    let views = views(&[([0.0; 3], z(0.0)), ([0.3, 0.1, 0.0], z(0.5)), ([0.1, 0.1, 0.2], z(-1.0)), ([0.0; 3], z(1.5))]);
    for error in errors_of_all(&views) {
        let HandEyeError::ParallelAxes { axis, frame: "mount", .. } = error else { panic!("{error}") };
        assert!((Vector3::from(axis) - Vector3::z()).norm() < EXACT);
    }
}

#[test]
fn tsai_lenz_refuses_turns_too_small_for_it_that_others_solve() {
    let views = views(&[([0.0; 3], [0.0; 3]), ([0.2, 0.1, 0.0], [0.2, 0.0, 0.0]), ([0.0, -0.1, 0.2], [0.0, 0.2, 0.0])]);
    assert!(no_solution_of("tsai_lenz", &views).contains("17°"));
    let error = truth().error_of(&by_name("park_martin").expect("exists").solve(&views).expect("small but enough"));
    assert!(error < EXACT, "{error:e}");
}

#[test]
fn turns_about_the_mount_origin_leave_andreff_and_li_without_scale() {
    let t = [0.4, 0.1, 0.3];
    let views = views(&[(t, [0.0; 3]), (t, [0.7, 0.0, 0.0]), (t, [0.0, 0.7, 0.0]), (t, [0.3, 0.2, 0.9])]);
    for name in ["andreff", "li"] {
        assert!(no_solution_of(name, &views).contains("scale open"), "{name}");
        // With noise there is a scale, but it is that of the noise.
        assert!(no_solution_of(name, &with_noise(&views, 1, 1e-3)).contains("scale against the noise"), "{name}");
    }
    let error = truth().error_of(&by_name("daniilidis").expect("exists").solve(&views).expect("needs no translation"));
    assert!(error < EXACT, "{error:e}");
}

/// Half turns about x, y and z look the same when two of the axes are reversed, so the rotations cannot be
/// distinguished.
#[test]
fn half_turns_alone_are_refused_by_the_methods_that_take_axes() {
    let views = views(&[([0.0; 3], [0.0; 3]), ([0.2, 0.1, 0.0], [PI, 0.0, 0.0]), ([0.0, -0.1, 0.2], [0.0, PI, 0.0])]);
    for name in ["park_martin", "horaud", "daniilidis"] {
        assert!(no_solution_of(name, &views).contains("half turns"), "{name}");
    }
    assert!(no_solution_of("tsai_lenz", &views).contains("116°"));
    assert!(no_solution_of("shah", &views).contains("more than one rotation"));
    for name in ["andreff", "li"] {
        // The translations determine the answer.
        let error = truth().error_of(&by_name(name).expect("exists").solve(&views).expect("determined"));
        assert!(error < EXACT, "{name}: {error:e}");
    }
}

#[test]
fn a_camera_that_saw_no_turn_gives_an_error_or_a_finite_answer() {
    let mut views = good_views();
    let still = views[0].camera_from_target;
    for view in &mut views {
        view.camera_from_target = still;
    }
    assert!(no_solution_of("tsai_lenz", &views).contains("turns between"));
    assert!(no_solution_of("park_martin", &views).contains("camera did not turn"));
    for method in all() {
        if let Ok(solution) = method.solve(&views) {
            assert!(solution.mount_from_camera.is_finite(), "{}", method.name());
        }
    }
}

fn extreme_poses() -> impl Strategy<Value = Vec<(Isometry3<f64>, Isometry3<f64>)>> {
    let length =
        prop::sample::select(vec![0.0, 1.0, -0.3, 1e-300, 1e-9, 1e3, 1e150, -1e200, f64::MAX, f64::MIN_POSITIVE]);
    let angle = prop::sample::select(vec![0.0, 1e-300, 1e-9, 1e-3, 0.02, 0.5, 1.0, 2.0, PI, -PI, 3.1]);
    let pose = (prop::array::uniform3(length), prop::array::uniform3(angle)).prop_map(|(t, r)| isometry(t, r));
    prop::collection::vec((pose.clone(), pose), 0..7)
}

proptest! {
    /// The half turns show their axes but not the axes' signs, so the answer could be turned by 180° about z.
    #[test]
    fn half_turns_and_turns_about_one_other_axis_are_refused_too(truth in any_truth(), centre in any_pose()) {
        let turns = [([0.0; 3], [0.0; 3]), ([0.2, 0.1, 0.0], [PI, 0.0, 0.0]), ([0.0, -0.1, 0.2], [0.0, 0.0, 0.7])];
        let views = truth.views(&turns.map(|(t, r)| Pose::from_isometry(centre * isometry(t, r))));
        for name in ["park_martin", "horaud", "daniilidis"] {
            prop_assert!(no_solution_of(name, &views).contains("half turns"), "{name}");
        }
        prop_assert!(no_solution_of("tsai_lenz", &views).contains("fewer than two axes"));
        prop_assert!(no_solution_of("shah", &views).contains("more than one rotation"));
    }

    #[test]
    fn no_finite_input_makes_a_method_panic_or_return_a_number_that_is_not_finite(poses in extreme_poses()) {
        let views: Vec<_> = poses
            .into_iter()
            .map(|(h, c)| PosePair { anchor_from_mount: h.into(), camera_from_target: c.into() })
            .collect();
        for method in all() {
            if let Ok(solution) = method.solve(&views) {
                prop_assert!(solution.mount_from_camera.is_finite(), "{}", method.name());
                prop_assert!(solution.anchor_from_target.is_finite(), "{}", method.name());
            }
        }
    }
}
