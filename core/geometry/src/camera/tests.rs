use super::*;
use proptest::prelude::*;

fn models() -> Vec<Intrinsics> {
    let base = Intrinsics { fx: 912.4, fy: 880.8, cx: 640.7, cy: 361.2, ..Intrinsics::pinhole(1280, 720, 900.0) };
    [
        Distortion::None,
        Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.031]),
        Distortion::BrownConrady([-0.31, 0.12, 0.001, -0.002, -0.02]),
        Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
        Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
    ]
    .into_iter()
    .map(|distortion| Intrinsics { distortion, ..base })
    .collect()
}

proptest! {
    #[test]
    fn unproject_undoes_project(x in -0.6..0.6f64, y in -0.35..0.35f64, z in 0.2..4.0f64) {
        for camera in models() {
            let point = Point3::new(x * z, y * z, z);
            let px = camera.project(&point).expect("in front");
            let ray = camera.unproject(&px).expect("inside the model");
            prop_assert!((ray.into_inner() - point.coords.normalize()).norm() < 1e-9, "{camera:?}");
        }
    }

    #[test]
    fn analytic_jacobians_match_central_differences(x in -0.6..0.6f64, y in -0.35..0.35f64, z in 0.2..4.0f64) {
        const STEP: f64 = 1e-6;
        for camera in models() {
            let point = Point3::new(x * z, y * z, z);
            let full = camera.project_with_jacobians(&point).expect("in front");
            prop_assert!((full.px - camera.project(&point).expect("in front")).norm() < 1e-9);
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = STEP;
                let numeric = (camera.project(&(point + step)).expect("in front")
                    - camera.project(&(point - step)).expect("in front")) / (2.0 * STEP);
                let error = (numeric - full.px_by_point.column(axis)).norm();
                prop_assert!(error < 1e-5 * (1.0 + numeric.norm()), "{camera:?} point {axis}: {error}");
            }
            for i in 0..camera.parameter_count() {
                let shifted = |sign: f64| {
                    let mut p = camera.parameters();
                    p[i] += sign * STEP;
                    camera.with_parameters(&p).project(&point).expect("in front")
                };
                let numeric = (shifted(1.0) - shifted(-1.0)) / (2.0 * STEP);
                let error = (numeric - full.px_by_parameters.column(i)).norm();
                prop_assert!(error < 1e-5 * (1.0 + numeric.norm()), "{camera:?} parameter {i}: {error}");
            }
        }
    }
}

#[test]
fn points_behind_a_pinhole_have_no_image() {
    let camera = models()[0];
    assert_eq!(camera.project(&Point3::new(0.0, 0.0, -1.0)), Err(CameraError::BehindCamera { z_m: -1.0 }));
    assert_eq!(camera.project(&Point3::new(0.1, 0.0, 0.0)), Err(CameraError::BehindCamera { z_m: 0.0 }));
}

#[test]
fn a_fisheye_sees_beside_its_plane() {
    let camera = models()[4];
    let px = camera.project(&Point3::new(1.0, 0.0, -0.1)).expect("fisheye sees past 90 degrees");
    let ray = camera.unproject(&px).expect("inside");
    assert!((ray.into_inner() - Vector3::new(1.0, 0.0, -0.1).normalize()).norm() < 1e-9);
}

#[test]
fn a_pixel_past_the_fold_of_the_lens_is_refused() {
    // Barrel distortion k1 = -0.5 folds at r = 0.816, where the distorted radius peaks at 0.544.
    let camera = Intrinsics {
        distortion: Distortion::BrownConrady([-0.5, 0.0, 0.0, 0.0, 0.0]),
        ..Intrinsics::pinhole(640, 480, 300.0)
    };
    let at_radius = |r: f64| camera.unproject(&Vector2::new(camera.cx + 300.0 * r, camera.cy));
    assert!(at_radius(0.54).is_ok());
    assert!(matches!(at_radius(0.56), Err(CameraError::OutsideModel { .. })));
}

#[test]
fn view_angle_of_the_reference_sensor_gives_its_focal_length() {
    let camera = Intrinsics::from_view_angle(640, 480, 57f64.to_radians());
    assert!((camera.fx - 589.3667).abs() < 1e-3);
    assert_eq!((camera.cx, camera.cy), (319.5, 239.5));
}

#[test]
fn unusable_parameters_are_named() {
    let mut camera = Intrinsics::pinhole(640, 480, 500.0);
    camera.fy = f64::NAN;
    assert!(matches!(camera.validate(), Err(CameraError::BadParameter { name: "fy", .. })));
}
