use nalgebra::{Isometry3, Translation3, Vector3};

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::Pose;
use handeye_geometry::observations::KnownLens;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{Setup, session};

use crate::diagnose::findings::{Finding, FindingCode};
use crate::diagnose::{Calibration, calibrate};
use crate::handeye::Mode;
use crate::{CalibrateError, CameraKnowledge, Method, Noise, Observations};

/// A robot that repeats well, as industrial ones do.
const NOISE: Noise = Noise { corner_px: 0.1, robot_m: 2e-5, robot_rad: 1e-4, ..Noise::EXACT };

/// The calibration by views of a camera with this knowledge, and the true place of a point that it saw.
fn solved(mode: Mode, seed: u64, camera: impl Fn(Intrinsics) -> CameraKnowledge) -> (Calibration, f64) {
    let truth = session(&Setup { noise: NOISE, ..Setup::new(mode, 20, seed) });
    let observations = Observations { camera: camera(truth.intrinsics), ..truth.observations(false) };
    let calibration = calibrate(&observations, Method::Joint, &CancelToken::default()).expect("solves");
    let point = calibration.joint.as_ref().expect("joint").reference_point;
    let found = calibration.hand_eye.expect("an answer").mount_from_camera();
    let off_m = (found.isometry() * point - truth.mount_from_camera.isometry() * point).norm();
    (calibration, off_m)
}

fn find(calibration: &Calibration, code: FindingCode) -> Option<Finding> {
    calibration.diagnosis().findings.iter().find(|finding| finding.code == code).cloned()
}

fn half_a_pixel_off(lens: Intrinsics, azimuth: f64) -> Intrinsics {
    Intrinsics { cx: lens.cx + 0.5 * azimuth.cos(), cy: lens.cy + 0.5 * azimuth.sin(), ..lens }
}

#[test]
fn the_error_of_a_lens_that_is_known_to_half_a_pixel_is_counted_and_the_views_make_it_smaller() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (sessions, mut within, mut squares, mut stated) = (20, 0, [0.0; 2], 0.0);
        for seed in 0..sessions {
            let given = |lens| half_a_pixel_off(lens, seed as f64);
            let near = |lens| CameraKnowledge::Near(KnownLens { intrinsics: given(lens), accuracy_px: 0.5 });
            let (calibration, off_m) = solved(mode, 40 + seed, near);
            let stated_m = calibration.tip_error_95_m().expect("stated");
            within += usize::from(off_m <= stated_m);
            stated += stated_m.powi(2);
            let (_, exact_m) = solved(mode, 40 + seed, |lens| CameraKnowledge::Fixed(given(lens)));
            squares = [squares[0] + off_m.powi(2), squares[1] + exact_m.powi(2)];
            assert!(find(&calibration, FindingCode::WrongIntrinsics).is_none(), "{mode:?} {seed}");
        }
        println!("{mode:?}: {within} of {sessions} within, {:?} mm", squares.map(|s: f64| (s / 20.0).sqrt() * 1e3));
        // 17 or fewer of 20 come about by chance once in 40.
        assert!(within > 17, "{mode:?}: {within}");
        assert!(squares[0] < squares[1], "{mode:?}: {squares:?}");
        // For a Gaussian in space 95 % are within 1.6 (a ball) to 2 times (a line) of the RMS.
        assert!(squares[0] > stated / 9.0, "{mode:?}: {squares:?} {stated}");
    }
}

#[test]
fn what_a_lens_taken_as_exact_leaves_out_is_said() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (calibration, _) = solved(mode, 60, CameraKnowledge::Fixed);
        let expected_m =
            calibration.joint.as_ref().and_then(|joint| joint.error_at_half_a_pixel_95_m).expect("it was given");
        let near = |lens| CameraKnowledge::Near(KnownLens { intrinsics: lens, accuracy_px: 0.5 });
        let (estimated, _) = solved(mode, 60, near);
        let stated_m = estimated.tip_error_95_m().expect("stated");
        println!("{mode:?}: {expected_m} m by the finding, {stated_m} m stated");
        // Noise levels and reference point are those of another fit.
        assert!((expected_m / stated_m - 1.0).abs() < 0.25, "{mode:?}: {expected_m} {stated_m}");
        assert!(expected_m > 2.0 * calibration.tip_error_95_m().expect("stated"), "{mode:?}");
        let finding = find(&calibration, FindingCode::LensTakenAsExact).expect("more than what is stated");
        assert!((finding.value("expected_error_at_half_a_pixel").expect("a number") - expected_m * 1e3).abs() < 1e-9);
        assert!(find(&estimated, FindingCode::LensTakenAsExact).is_none(), "{mode:?}");
    }
}

#[test]
fn a_lens_that_is_farther_off_than_is_said_of_it_is_named() {
    let longer = |lens: Intrinsics| Intrinsics { fx: 1.03 * lens.fx, fy: 1.03 * lens.fy, ..lens };
    let near = |lens| CameraKnowledge::Near(KnownLens { intrinsics: longer(lens), accuracy_px: 0.5 });
    let (calibration, off_m) = solved(Mode::EyeInHand, 70, near);
    let finding = find(&calibration, FindingCode::WrongIntrinsics).expect("it does not fit");
    assert!(finding.value("lens_off").expect("pixels") > 3.0, "{finding}");
    let joint = calibration.joint.as_ref().expect("joint");
    assert!(joint.known_lens.is_none() && !calibration.camera.expect("a lens").fixed, "the views alone say what it is");
    assert!(off_m <= calibration.tip_error_95_m().expect("stated"), "{off_m}");
    // From an accuracy stated as firm to one stated as loose.
    for accuracy_px in [0.01, 0.1, 1.0] {
        let near = |lens| CameraKnowledge::Near(KnownLens { intrinsics: longer(lens), accuracy_px });
        let (calibration, _) = solved(Mode::EyeInHand, 71, near);
        assert!(find(&calibration, FindingCode::WrongIntrinsics).is_some(), "{accuracy_px}");
    }
}

/// By how much the place of the tip is off at a pose, metres.
type ErrorOfRobot = fn(&Isometry3<f64>) -> Vector3<f64>;

#[test]
fn robot_poses_that_no_model_follows_do_not_pull_an_estimated_lens_beyond_its_stated_error() {
    // Waves of 5 mm, and a place that errs with the square of its height by up to centimetres.
    let wrong: [ErrorOfRobot; 2] = [
        |pose| pose.translation.vector.yxz().component_mul(&Vector3::new(10.0, 15.0, 12.0)).map(|x| 0.005 * x.sin()),
        |pose| pose.rotation * Vector3::z() * (0.25 * pose.translation.z.powi(2)),
    ];
    let (mut outside, mut count) = (0, 0);
    for (mode, seed) in [Mode::EyeInHand, Mode::EyeToHand].into_iter().flat_map(|m| (110..118).map(move |s| (m, s))) {
        for off in wrong {
            let mut truth = session(&Setup { noise: NOISE, ..Setup::new(mode, 20, seed) });
            for view in &mut truth.views {
                let pose = *view.base_from_tip.isometry();
                let shifted = Translation3::from(pose.translation.vector + off(&pose));
                view.base_from_tip = Pose::from_isometry(Isometry3::from_parts(shifted, pose.rotation));
            }
            let calibration =
                calibrate(&truth.observations(true), Method::Joint, &CancelToken::default()).expect("solves");
            let lens = calibration.camera.expect("estimated");
            let parameters = lens.intrinsics.parameters().into_iter().zip(truth.intrinsics.parameters());
            for ((found, is), sigma) in parameters.zip(lens.sigma_px.expect("stated")) {
                outside += usize::from((found - is).abs() > 1.96 * sigma);
                count += 1;
            }
        }
    }
    println!("{outside} of {count}");
    // 15 or more of 128 independent ones come about by chance twice in a thousand.
    assert_eq!(count, 128);
    assert!(outside < 15, "{outside} of {count}");
}

#[test]
fn an_accuracy_that_is_none_is_refused() {
    let truth = session(&Setup::new(Mode::EyeInHand, 6, 80));
    for accuracy_px in [0.0, -1.0, f64::NAN] {
        let camera = CameraKnowledge::Near(KnownLens { intrinsics: truth.intrinsics, accuracy_px });
        let observations = Observations { camera, ..truth.observations(false) };
        let refused = calibrate(&observations, Method::Joint, &CancelToken::default()).expect_err("no accuracy");
        assert!(matches!(refused, CalibrateError::LensAccuracy { .. }), "{refused}");
    }
}
