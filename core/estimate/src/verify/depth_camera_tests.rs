use nalgebra::{Translation3, UnitQuaternion, Vector3, Vector6};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use handeye_geometry::se3;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::testing::BOARD;
use handeye_simulate::links::normal;
use handeye_simulate::moving_board::{Stage, centre, lens};

/// Boards 0.3 to 0.6 m away, tilted by up to 40°, known to 0.05 mm and 0.02°, with depths that scatter by 0.3 mm and modified
/// by `change`.
fn report(seed: u64, count: usize, change: impl Fn(&Isometry3<f64>, usize, &mut f32)) -> Option<DepthReport> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut stage = Stage::new();
    stage.depth_noise_m = 3e-4;
    let lens = lens();
    let mut all = DepthCheck::new(&lens, &BOARD, &BoardShape::FLAT);
    for i in 0..count {
        let towards: f64 = random.random_range(0.0..std::f64::consts::TAU);
        let tilt = Vector3::new(towards.cos(), towards.sin(), 0.0) * random.random_range(0.0..0.7);
        let at = Vector3::new(0.0, 0.0, random.random_range(0.3..0.6));
        let board = Isometry3::from_parts(at.into(), UnitQuaternion::from_scaled_axis(tilt))
            * Translation3::from(-centre().coords);
        // The pose by robot and corners: off by their uncertainty.
        let sigma = [2e-5, 2e-5, 5e-5, 3e-4, 3e-4, 1e-4];
        let off = Vector6::from_fn(|axis, _| sigma[axis] * normal(&mut random));
        let found = board * Translation3::from(centre().coords) * se3::exp(&off) * Translation3::from(-centre().coords);
        let mut depth = stage.depth(&board, seed * 100 + i as u64);
        depth.metres.iter_mut().enumerate().for_each(|(k, metres)| change(&board, k, metres));
        let corner =
            |(i, point): (usize, &Point3<f64>)| Corner::new(i, lens.project(&(board * point)).expect("in front"));
        let corners: Vec<Corner> = BOARD.points().iter().enumerate().map(corner).collect();
        if let Some(plane) = DepthPlane::new(&depth, (640, 480), &corners, &BOARD) {
            all.add(&plane, &found);
        }
    }
    all.finish(0.0, None)
}

fn numbers(errors: &DepthErrors) -> [(&'static str, Estimated); 5] {
    let [x, y] = errors.tilt_rad;
    let (scale, slope) = (errors.scale.expect("captures"), errors.slope_px.expect("captures"));
    [("offset", errors.offset_m), ("scale", scale), ("slope", slope), ("x", x), ("y", y)]
}

/// Two millimetres, three in a thousand, and half a pixel's worth of the slope, drawn from the geometry of the ray alone.
#[test]
fn offset_scale_and_slope_of_a_depth_camera_are_found_to_what_is_stated() {
    let wrong = |board: &Isometry3<f64>, k: usize, metres: &mut f32| {
        let px = nalgebra::Vector2::new((k % 640) as f64, (k / 640) as f64);
        let away = |px: nalgebra::Vector2<f64>| {
            let ray = lens().unproject(&px).expect("in the lens").into_inner();
            let normal = board.rotation * Vector3::z();
            normal.dot(&board.translation.vector) / normal.dot(&ray) * ray.z
        };
        if *metres < 3.0 {
            let by_column = away(px + nalgebra::Vector2::x()) - away(px);
            let by_row = away(px + nalgebra::Vector2::y()) - away(px);
            let slanted = 0.5 * by_column.abs().max(by_row.abs());
            *metres = (f64::from(*metres) * 1.003 + 0.002 + slanted) as f32;
        }
    };
    let report = report(1, 14, wrong).expect("depths");
    let errors = report.errors.as_ref().expect("of the right size");
    println!("{report:?}");
    assert!(!report.is_gross() && report.captures == 14 && report.fill > 0.99);
    let expected = [0.002 + 0.003 * errors.at_m, 0.003, 0.5, 0.0, 0.0];
    let finest = [2e-4, 2e-3, 0.2, 2e-3, 2e-3];
    for (((name, found), expected), finest) in numbers(errors).into_iter().zip(expected).zip(finest) {
        assert!((found.value - expected).abs() < 3.5 * found.sigma, "{name}: {found:?}, not {expected}");
        assert!(found.sigma < finest, "{name}: {found:?}");
    }
    assert!(errors.is_certain(errors.offset_m) && errors.is_certain(errors.slope_px.expect("captures")));
    assert!((errors.noise_m - 3e-4).abs() < 1e-5, "{}", errors.noise_m);
}

#[test]
fn a_depth_camera_without_errors_is_accused_of_none() {
    let (mut certain, mut beyond_two, mut all) = (0, 0, 0);
    for seed in 0..24 {
        let report = report(100 + seed, 8, |_, _, _| ()).expect("depths");
        let errors = report.errors.expect("of the right size");
        for (_, number) in numbers(&errors) {
            certain += usize::from(errors.is_certain(number));
            beyond_two += usize::from(number.value.abs() > 2.0 * number.sigma);
            all += 1;
        }
    }
    // One of a thousand is expected; at two standard deviations, with five degrees of freedom, one of ten.
    assert!(certain <= 1, "{certain} of {all}");
    assert!(beyond_two <= all / 5, "{beyond_two} of {all}: it states too little");
}

#[test]
fn what_covers_a_third_of_the_board_moves_nothing() {
    let covered = |_: &Isometry3<f64>, k: usize, metres: &mut f32| {
        if k % 640 > 360 {
            *metres = 0.2;
        }
    };
    let errors = report(2, 8, covered).expect("depths").errors.expect("of the right size");
    assert!(errors.offset_m.value.abs() < 3e-4 && !errors.is_certain(errors.offset_m), "{errors:?}");
}

#[test]
fn holes_are_counted_and_another_unit_is_named() {
    let with_holes = |_: &Isometry3<f64>, k: usize, metres: &mut f32| {
        if (k / 640) % 4 < 2 && k.is_multiple_of(2) {
            *metres = f32::NAN;
        }
    };
    // A quarter of the pixels.
    let fill = report(3, 6, with_holes).expect("depths").fill;
    assert!((fill - 0.75).abs() < 0.05, "{fill}");
    for factor in [1000.0, 0.1] {
        let other = report(4, 6, |_, _, metres| *metres *= factor).expect("depths");
        let is_named = (other.ratio / f64::from(factor) - 1.0).abs() < 1e-2;
        assert!(other.is_gross() && other.errors.is_none() && is_named, "{other:?}");
    }
    let nothing = report(6, 6, |_, _, metres| *metres = f32::NAN);
    assert_eq!(nothing, None);
}
