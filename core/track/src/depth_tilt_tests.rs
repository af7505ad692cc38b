use nalgebra::Vector3;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::moving_board::{FAR_M, Stage, Watch, board_at, lens};
use handeye_geometry::testing::BOARD;
use handeye_simulate::links::normal;

/// Uncertainty of a pose from corners with hard edges, about the middle of the board: four tenths of a degree of tilt.
const CORNERS: [f64; 6] = [5e-5, 5e-5, 1e-4, 7e-3, 7e-3, 3e-4];

fn truth(tilt: Vector3<f64>) -> Isometry3<f64> {
    Watch::new().camera_from_target(&board_at(Vector3::zeros(), tilt))
}

/// Estimates from noisy corners, and from the depths of `stage` as modified by `change`; both as twists from the truth,
/// with the squared Mahalanobis distance of the second.
fn both(
    stage: &Stage,
    tilt: Vector3<f64>,
    seed: u64,
    change: impl Fn(usize, &mut f32),
) -> (Vector6<f64>, Vector6<f64>, f64) {
    let truth = truth(tilt);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // A twist about the middle as one about the first corner.
    let mut from_middle = Matrix6::identity();
    from_middle.fixed_view_mut::<3, 3>(0, 3).copy_from(&se3::skew(&BOARD.centre().coords));
    let off = from_middle * Vector6::from_fn(|i, _| CORNERS[i] * normal(&mut rng));
    let about_middle = Matrix6::from_diagonal(&Vector6::from(CORNERS.map(|sigma| sigma * sigma)));
    let covariance = from_middle * about_middle * from_middle.transpose();
    let mut depth = stage.depth(&truth, seed);
    depth.metres.iter_mut().enumerate().for_each(|(i, metres)| change(i, metres));
    let by_corners = truth * se3::exp(&off);
    let tilt = DepthTilt::new(&depth, FAR_M, &lens(), &BOARD, &by_corners).expect("depths");
    let tilted = tilt.with(&by_corners, &covariance).expect("regular");
    let left = se3::log(&(truth.inverse() * tilted.camera_from_target));
    (off, left, left.dot(&(tilted.covariance.try_inverse().expect("regular") * left)))
}

fn tilt_of(error: &Vector6<f64>) -> f64 {
    error.fixed_rows::<2>(3).norm()
}

const TILTS: [Vector3<f64>; 3] =
    [Vector3::new(0.3, -0.2, 0.1), Vector3::new(-0.6, 0.3, 1.0), Vector3::new(0.02, 0.01, -0.4)];

#[test]
fn depths_of_a_renderer_take_the_tilt_from_tenths_of_a_degree_to_hundredths() {
    let mut stage = Stage::new();
    stage.depth_noise_m = 1e-5;
    for (k, tilt) in TILTS.into_iter().enumerate() {
        let (mut corners, mut fused) = (0.0_f64, 0.0_f64);
        for seed in 0..20 {
            let (off, left, _) = both(&stage, tilt, 100 * k as u64 + seed, |_, _| ());
            corners += tilt_of(&off).powi(2) / 20.0;
            fused += tilt_of(&left).powi(2) / 20.0;
        }
        let [corners, fused] = [corners, fused].map(|squares| squares.sqrt().to_degrees());
        println!("tilted by {tilt:?}: {corners:.3}° by corners, {fused:.4}° with depth");
        assert!(fused < 0.03 && corners > 0.3, "{fused} {corners}");
    }
}

/// CoppeliaSim draws depths with half a pixel of their slope on top, which at 45° is 0.3 mm of 0.4 m.
#[test]
fn a_polygon_offset_makes_no_tilt() {
    let stage = Stage::new();
    let tilt = Vector3::new(0.7, -0.3, 0.2);
    let board = truth(tilt);
    let (slopes, _) = slopes_at(&board).expect("in front");
    let per_pixel = slopes.amax() / lens().fx;
    let (_, left, _) = both(&stage, tilt, 1, |_, metres| {
        if *metres < FAR_M {
            *metres += (0.5 * per_pixel * f64::from(*metres).powi(2)) as f32;
        }
    });
    assert!(tilt_of(&left).to_degrees() < 0.01, "{}", tilt_of(&left).to_degrees());
}

/// A depth camera with a scale error, an offset and noise must not make a pose worse without a larger covariance.
#[test]
fn what_a_depth_camera_is_off_is_in_the_covariance() {
    type Change = fn(f64) -> f64;
    let kinds: [(&str, f64, Change); 4] = [
        ("noise of 1.5 mm", 1.5e-3, |m| m),
        ("2 % too far", 1e-4, |m| m * 1.02),
        ("10 mm too near", 1e-4, |m| m - 0.01),
        ("steps of 1 mm", 0.0, |m| (m * 1e3).round() * 1e-3),
    ];
    for (what, noise_m, change) in kinds {
        let mut stage = Stage::new();
        stage.depth_noise_m = noise_m;
        let (mut squared, mut corners, mut fused, mut count) = (0.0, 0.0, 0.0, 0.0);
        for (k, tilt) in TILTS.into_iter().enumerate() {
            for seed in 0..10 {
                let to_metres = |_: usize, metres: &mut f32| {
                    if *metres < FAR_M {
                        *metres = change(f64::from(*metres)) as f32;
                    }
                };
                let (off, left, distance) = both(&stage, tilt, 1000 + 100 * k as u64 + seed, to_metres);
                squared += distance;
                corners += tilt_of(&off).powi(2);
                fused += tilt_of(&left).powi(2);
                count += 1.0;
            }
        }
        let (squared, ratio) = (squared / count, f64::sqrt(fused / corners));
        println!("{what}: squared Mahalanobis distance {squared:.2} of 6, tilt {ratio:.2} of that by corners");
        // Thirty of them scatter by sqrt(12 / 30) = 0.6.
        assert!(squared < 8.0, "{what}: {squared}");
        assert!(ratio < 1.05, "{what}: {ratio}");
    }
}

#[test]
fn a_board_behind_something_else_has_no_tilt_by_depth() {
    let stage = Stage::new();
    let board = truth(TILTS[0]);
    let mut depth = stage.depth(&board, 1);
    for (i, metres) in depth.metres.iter_mut().enumerate() {
        if i % 640 < 420 {
            *metres = f32::NAN;
        }
    }
    assert!(DepthTilt::new(&depth, FAR_M, &lens(), &BOARD, &board).is_none());
}

#[test]
fn derivatives_match_differences() {
    const STEP: f64 = 1e-6;
    let pose = truth(Vector3::new(0.4, -0.2, 0.5));
    let (at, by_pose) = slopes_at(&pose).expect("in front");
    for k in 0..6 {
        let mut twist = Vector6::zeros();
        twist[k] = STEP;
        let (moved, _) = slopes_at(&(pose * se3::exp(&twist))).expect("in front");
        let difference = (moved - at) / STEP;
        assert!((difference - by_pose.column(k)).norm() < 1e-4, "{k}: {difference} {}", by_pose.column(k));
    }
}
