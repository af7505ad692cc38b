//! Our camera models against OpenCV's.

use nalgebra::{Point3, Vector2};
use opencv::calib3d;
use opencv::core::{Mat, Point2d, Vector, no_array};
use opencv::prelude::*;

use super::bridge_for_tests::{camera_matrix, coefficients, numbers, to_points2d, to_points3d};
use handeye_geometry::camera::{Distortion, Intrinsics};

fn cameras() -> Vec<Intrinsics> {
    let base = Intrinsics { fx: 912.4, fy: 880.8, cx: 640.7, cy: 361.2, ..Intrinsics::pinhole(1280, 720, 900.0) };
    [
        Distortion::None,
        Distortion::BrownConrady([-0.31, 0.12, 0.001, -0.002, -0.02]),
        Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
        Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
    ]
    .into_iter()
    .map(|distortion| Intrinsics { distortion, ..base })
    .collect()
}

fn points() -> Vec<Point3<f64>> {
    let mut out = Vec::new();
    for i in -5..=5i32 {
        for j in -3..=3i32 {
            let z = 0.5 + 0.1 * f64::from((i + 2 * j).rem_euclid(7));
            out.push(Point3::new(0.11 * f64::from(i) * z, 0.1 * f64::from(j) * z + 0.003, z));
        }
    }
    out
}

/// Pixels and the Jacobian, row-major with two rows a point, by OpenCV.
fn by_opencv(camera: &Intrinsics, points: &[Point3<f64>]) -> (Vec<Vector2<f64>>, Mat) {
    let mut pixels = Vector::<Point2d>::new();
    let mut jacobian = Mat::default();
    let (k, d) = (camera_matrix(camera).expect("K"), coefficients(camera));
    let zero = Vector::<f64>::from_slice(&[0.0; 3]);
    let objects = to_points3d(points);
    if let Distortion::Fisheye(_) = camera.distortion {
        calib3d::fisheye_project_points_vec(&objects, &mut pixels, &zero, &zero, &k, &d, 0.0, &mut jacobian)
            .expect("projects");
    } else {
        calib3d::project_points(&objects, &zero, &zero, &k, &d, &mut pixels, &mut jacobian, 0.0).expect("projects");
    }
    (pixels.iter().map(|p| Vector2::new(p.x, p.y)).collect(), jacobian)
}

#[test]
fn projections_equal_those_of_opencv() {
    for camera in cameras() {
        let points = points();
        let (reference, _) = by_opencv(&camera, &points);
        for (point, want) in points.iter().zip(reference) {
            let got = camera.project(point).expect("in front");
            assert!((got - want).norm() < 1e-9, "{:?} {point}: {got} {want}", camera.distortion);
        }
    }
}

#[test]
fn derivatives_equal_those_of_opencv() {
    for camera in cameras() {
        let points = points();
        let (_, jacobian) = by_opencv(&camera, &points);
        let columns = jacobian.cols() as usize;
        let values = numbers(&jacobian).expect("numbers");
        // Where OpenCV stores the derivatives by translation and by focal length, centre and distortion.
        let (translation, parameters) = match camera.distortion {
            Distortion::Fisheye(_) => (11, 0),
            _ => (3, 6),
        };
        for (i, point) in points.iter().enumerate() {
            let ours = camera.project_with_jacobians(point).expect("in front");
            for axis in 0..2 {
                let at = |column: usize| values[(2 * i + axis) * columns + column];
                for k in 0..3 {
                    let (got, want) = (ours.px_by_point[(axis, k)], at(translation + k));
                    assert!(
                        (got - want).abs() < 1e-8 * (1.0 + want.abs()),
                        "{:?} point {k}: {got} {want}",
                        camera.distortion
                    );
                }
                for k in 0..camera.parameter_count() {
                    let (got, want) = (ours.px_by_parameters[(axis, k)], at(parameters + k));
                    assert!(
                        (got - want).abs() < 1e-8 * (1.0 + want.abs()),
                        "{:?} parameter {k}: {got} {want}",
                        camera.distortion
                    );
                }
            }
        }
    }
}

#[test]
fn rays_of_pixels_equal_those_of_opencv() {
    for camera in cameras() {
        let pixels: Vec<Vector2<f64>> = points().iter().map(|p| camera.project(p).expect("in front")).collect();
        let mut rays = Vector::<Point2d>::new();
        let (k, d) = (camera_matrix(&camera).expect("K"), coefficients(&camera));
        if let Distortion::Fisheye(_) = camera.distortion {
            calib3d::fisheye_undistort_points_def(&to_points2d(&pixels), &mut rays, &k, &d).expect("undistorts");
        } else {
            let criteria = opencv::core::TermCriteria { typ: 3, max_count: 200, epsilon: 1e-14 };
            calib3d::undistort_points_iter(
                &to_points2d(&pixels),
                &mut rays,
                &k,
                &d,
                &no_array(),
                &no_array(),
                criteria,
            )
            .expect("undistorts");
        }
        for (px, want) in pixels.iter().zip(rays.iter()) {
            let ray = camera.unproject(px).expect("inside");
            let got = ray.xy() / ray.z;
            // OpenCV's fixed-point iteration stops near 1e-8.
            assert!((got - Vector2::new(want.x, want.y)).norm() < 1e-7, "{:?} {px}: {got}", camera.distortion);
        }
    }
}
