use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix2, Point3, Vector2, Vector3};

use super::*;
use crate::camera::Distortion;
use crate::targets::corner_covariance::CornerCovariance;

const LENSES: [Distortion; 4] = [
    Distortion::None,
    Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
    Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
    Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
];

struct View {
    intrinsics: Intrinsics,
    board: BoardPoints,
    shape: BoardShape,
    corners: Vec<Corner>,
    whitener: Whitener,
    pose: Isometry3<f64>,
}

#[derive(Clone, Copy, PartialEq)]
enum Count {
    Alike,
    Each,
    Together,
}

/// Twenty corners about a pixel away from their places.
fn view(distortion: Distortion, count: Count) -> View {
    let points: Vec<Point3<f64>> =
        (0..20).map(|i| Point3::new(f64::from(i % 5) * 0.03, f64::from(i / 5) * 0.03, 0.0)).collect();
    let intrinsics = Intrinsics { fy: 575.0, distortion, ..Intrinsics::pinhole(640, 480, 581.0) };
    let pose = Isometry3::new(Vector3::new(-0.05, -0.08, 0.4), Vector3::new(0.3, -0.4, 0.2));
    let (board, shape) = (BoardPoints::new(&points), BoardShape { warp_m: [0.001, -0.002], scale: 1.01 });
    let corners = (0..points.len())
        .map(|i| {
            let px = intrinsics.project(&(pose * board.point(i, &shape))).expect("in front");
            Corner::new(i, px + Vector2::new((i as f64).sin(), (2.0 * i as f64).cos()))
        })
        .collect();
    let weight = |i: usize| Matrix2::new(1.0, 0.1 * i as f64, 0.0, 2.0 + (i as f64).sin());
    let shared =
        |i: usize, j: usize| f64::from(u8::from(i == j)) + 0.5 * ((i * j) as f64).cos() / (1.0 + i.abs_diff(j) as f64);
    let whitener = match count {
        Count::Alike => Whitener::Alike,
        Count::Each => Whitener::Each((0..points.len()).map(weight).collect()),
        Count::Together => {
            let root = DMatrix::from_fn(2 * points.len(), 2 * points.len(), shared);
            let covariance = CornerCovariance::new(&(&root * root.transpose())).expect("a covariance");
            Whitener::Together { covariance: Arc::new(covariance), unit_px2: 2.0 }
        }
    };
    View { intrinsics, board, shape, corners, whitener, pose }
}

/// All residuals after a step of pose and form.
fn residuals(view: &View, free: FreeParameters, step: &[f64]) -> DVector<f64> {
    let pose = view.pose * crate::se3::exp(&Vector6::from_row_slice(&step[..6]));
    let form = &step[6..];
    let mut intrinsics = view.intrinsics;
    if free.lens {
        let moved: Vec<f64> = intrinsics.parameters().iter().zip(form).map(|(p, d)| p + d).collect();
        intrinsics = intrinsics.with_parameters(&moved);
    }
    let mut shape = view.shape;
    if free.warp {
        for k in 0..2 {
            shape.warp_m[k] += form[free.warp_at(&intrinsics) + k];
        }
    }
    if free.scale {
        shape.scale += form[free.scale_at(&intrinsics)];
    }
    let of = |(i, corner): (usize, &Corner)| {
        let px = intrinsics.project(&(pose * view.board.point(corner.index, &shape))).expect("in front");
        let residual = view.whitener.of(i).copied().unwrap_or_else(Matrix2::identity) * (px - corner.px);
        [residual.x, residual.y]
    };
    let all = DVector::from_vec(view.corners.iter().enumerate().flat_map(of).collect());
    let columns = DMatrix::from_columns(std::slice::from_ref(&all));
    view.whitener.together(&columns).map_or(all, |whitened| whitened.column(0).into_owned())
}

#[test]
fn the_equations_are_those_of_differences_of_the_residuals() {
    const STEP: f64 = 1e-6;
    for distortion in LENSES {
        for (count, lens, warp, scale) in [
            (Count::Alike, false, false, false),
            (Count::Alike, true, false, false),
            (Count::Each, true, true, true),
            (Count::Each, false, true, false),
            (Count::Alike, true, false, true),
            (Count::Together, true, true, true),
            (Count::Together, false, false, true),
        ] {
            let view = view(distortion, count);
            let free = FreeParameters { lens, warp, scale, depth: false };
            let n = 6 + free.count(&view.intrinsics);
            let zero = vec![0.0; n];
            let r = residuals(&view, free, &zero);
            let columns: Vec<DVector<f64>> = (0..n)
                .map(|i| {
                    let at = |sign: f64| {
                        let mut step = zero.clone();
                        step[i] = sign * STEP;
                        residuals(&view, free, &step)
                    };
                    (at(1.0) - at(-1.0)) / (2.0 * STEP)
                })
                .collect();
            let jacobian = DMatrix::from_columns(&columns);
            let (normal, gradient) = (jacobian.transpose() * &jacobian, jacobian.transpose() * &r);
            let View { intrinsics, board, shape, corners, whitener, pose } = &view;
            let seen = ViewInput { intrinsics, board, shape, corners, whitener, depths: None };
            let found = PoseEquations::new(&seen, pose, free).expect("in front");
            assert_eq!(found.corners, 20);
            assert!((found.squared_px / r.norm_squared() - 1.0).abs() < 1e-12);
            let at = |i: usize, j: usize| match (i < 6, j < 6) {
                (true, true) => found.pose[(i, j)],
                (true, false) => found.pose_by_form[(i, j - 6)],
                (false, true) => found.pose_by_form[(j, i - 6)],
                (false, false) => found.form[(i - 6, j - 6)],
            };
            for i in 0..n {
                // Pixels in the hundreds round at 1e-13, and their difference over 2e-6 at 1e-7 per entry.
                let size = |i: usize| normal[(i, i)].sqrt();
                let own = if i < 6 { found.pose_gradient[i] } else { found.form_gradient[i - 6] };
                assert!((own - gradient[i]).abs() < 1e-6 * r.norm(), "{distortion:?} {free:?} gradient {i}");
                for j in 0..n {
                    let error = (at(i, j) - normal[(i, j)]).abs();
                    let allowed = 1e-6 * (size(i) + size(j));
                    assert!(error <= allowed, "{distortion:?} {free:?} ({i}, {j}): {error:e} of {allowed:e}");
                }
            }
        }
    }
}

#[test]
fn a_target_behind_the_camera_has_no_equations() {
    let view = view(LENSES[1], Count::Alike);
    let View { intrinsics, board, shape, corners, whitener, .. } = &view;
    let seen = ViewInput { intrinsics, board, shape, corners, whitener, depths: None };
    let behind = Isometry3::translation(0.0, 0.0, -1.0);
    assert!(PoseEquations::new(&seen, &behind, FreeParameters { lens: true, ..FreeParameters::default() }).is_err());
}
