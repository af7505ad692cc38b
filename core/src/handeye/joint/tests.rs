use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::*;
use crate::camera::Distortion;
use crate::frames::{Base, Target, Tip};
use crate::observation::Corner;
use crate::progress::CancelToken;
use crate::se3;
use crate::target::{Grid, TargetSpec};

const BOARD: TargetSpec = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });

struct Trial {
    mode: Mode,
    points: Vec<Point3<f64>>,
    views: Vec<View>,
    intrinsics: Intrinsics,
    mount_from_camera: Pose<Mount, Camera>,
    anchor_from_target: Pose<Anchor, Target>,
}

fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn noise_twist(rng: &mut impl Rng, metres: f64, radians: f64) -> Vector6<f64> {
    Vector6::from_fn(|i, _| normal(rng) * if i < 3 { metres } else { radians })
}

/// Views on a 35° cone with ±60° of roll at 0.4 to 0.6 m: the geometry of the published Monte-Carlo tables.
fn trial(mode: Mode, views: usize, noise: &Noise, intrinsics: Intrinsics, seed: u64) -> Trial {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let points = BOARD.points();
    let centre = BOARD.centre();
    let mount_from_camera = Pose::from_isometry(se3::exp(&Vector6::new(0.05, 0.01, 0.06, 0.1, -0.2, 1.4)));
    let anchor_from_target: Pose<Anchor, Target> =
        Pose::from_isometry(se3::exp(&Vector6::new(0.5, 0.1, 0.2, 0.4, 0.2, -0.3)));
    let mut out = Vec::new();
    while out.len() < views {
        let tilt = 35f64.to_radians() * rng.random::<f64>().sqrt();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let roll = rng.random_range(-60f64..60.0).to_radians();
        let distance = rng.random_range(0.4..0.6);
        let jitter = Vector3::new(rng.random_range(-0.03..0.03), rng.random_range(-0.03..0.03), distance);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt)
            * UnitQuaternion::from_scaled_axis(Vector3::z() * roll);
        let camera_from_target =
            Isometry3::from_parts(jitter.into(), turn) * Isometry3::translation(-centre.x, -centre.y, -centre.z);
        let camera_from_target: Pose<Camera, Target> = Pose::from_isometry(camera_from_target);
        let true_anchor_from_mount = anchor_from_target * camera_from_target.inverse() * mount_from_camera.inverse();
        let true_base_from_tip: Pose<Base, Tip> = match mode {
            Mode::EyeInHand => true_anchor_from_mount.relabel(),
            Mode::EyeToHand => true_anchor_from_mount.inverse().relabel(),
        };
        let error = chain::correction_transform(&noise_twist(&mut rng, noise.robot_m, noise.robot_rad));
        let base_from_tip = Pose::from_isometry(true_base_from_tip.isometry() * error.inverse());
        let corners: Option<Vec<Corner>> = points
            .iter()
            .enumerate()
            .map(|(index, p)| {
                let px = intrinsics.project(&(camera_from_target.isometry() * p)).ok()?;
                let seen = nalgebra::Vector2::new(
                    px.x + normal(&mut rng) * noise.corner_px,
                    px.y + normal(&mut rng) * noise.corner_px,
                );
                intrinsics.contains(&seen).then_some(Corner { index, px: seen })
            })
            .collect();
        if let Some(corners) = corners {
            out.push(View { name: format!("{}", out.len()), base_from_tip, corners });
        }
    }
    Trial { mode, points, views: out, intrinsics, mount_from_camera, anchor_from_target }
}

impl Trial {
    fn problem(&self, free_intrinsics: bool, noise: Option<Noise>) -> JointProblem<'_> {
        JointProblem { mode: self.mode, points: &self.points, views: &self.views, free_intrinsics, noise }
    }

    /// A start as far off as a poor closed form: millimetres and tenths of a degree.
    fn start(&self) -> JointStart {
        let off = Vector6::new(0.004, -0.003, 0.005, 0.01, -0.008, 0.006);
        JointStart {
            mount_from_camera: self.mount_from_camera.perturbed(&off),
            anchor_from_target: self.anchor_from_target.perturbed(&(-off)),
            intrinsics: self.intrinsics,
        }
    }

    fn hand_eye_error(&self, solution: &JointSolution) -> Vector6<f64> {
        let estimated = solution.hand_eye.mount_from_camera();
        se3::log((self.mount_from_camera.inverse() * estimated).isometry())
    }
}

fn camera() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 581.0)
}

const REALISTIC: Noise = Noise { corner_px: 0.1, robot_m: 1e-4, robot_rad: 0.02 * std::f64::consts::PI / 180.0 };

#[test]
fn exact_data_gives_the_exact_answer_in_both_set_ups() {
    let tiny = Noise { corner_px: 1e-9, robot_m: 0.0, robot_rad: 0.0 };
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let intrinsics =
            Intrinsics { distortion: Distortion::BrownConrady([-0.1, 0.05, 1e-3, -5e-4, 0.0]), ..camera() };
        let t = trial(mode, 12, &tiny, intrinsics, 5);
        let mut start = t.start();
        start.intrinsics.fx *= 1.01;
        start.intrinsics.distortion = Distortion::BrownConrady([0.0; 5]);
        let solution = estimate(&t.problem(true, None), &start, &CancelToken::default()).expect("solves");
        assert!(t.hand_eye_error(&solution).norm() < 1e-7, "{mode:?}: {}", t.hand_eye_error(&solution));
        assert!((solution.intrinsics.fx - 581.0).abs() < 1e-4);
    }
}

#[test]
fn error_reaches_the_bound_and_the_stated_covariance_is_true() {
    // Mean of eᵀ C⁻¹ e is 6 when the covariance is true; its own spread over 60 trials is sqrt(12 / 60) = 0.45.
    for (mode, seed) in [(Mode::EyeInHand, 100), (Mode::EyeToHand, 200)] {
        let trials = 60;
        let mut mahalanobis = 0.0;
        for k in 0..trials {
            let t = trial(mode, 20, &REALISTIC, camera(), seed + k);
            let solution = estimate(&t.problem(false, None), &t.start(), &CancelToken::default()).expect("solves");
            let e = t.hand_eye_error(&solution);
            let inverse = solution.hand_eye_covariance().try_inverse().expect("regular");
            mahalanobis += (e.transpose() * inverse * e)[0] / trials as f64;
        }
        println!("{mode:?}: mean squared Mahalanobis distance {mahalanobis:.2} of 6");
        assert!((4.65..8.0).contains(&mahalanobis), "{mode:?}: {mahalanobis}");
    }
}

#[test]
fn noise_levels_are_recovered_where_the_data_can_tell_them() {
    // Half a millimetre and a tenth of a degree stand clear of what 0.1 px of corner noise does to a pose. Spread of a
    // standard deviation from 120 numbers, averaged over 20 trials: 1.4 %; three of those, and the loss to the unknowns.
    let noise = Noise { corner_px: 0.1, robot_m: 5e-4, robot_rad: 0.1f64.to_radians() };
    let trials = 20;
    let mut mean = Vector3::zeros();
    for k in 0..trials {
        let t = trial(Mode::EyeInHand, 40, &noise, camera(), 300 + k);
        let found = estimate(&t.problem(false, None), &t.start(), &CancelToken::default()).expect("solves").noise;
        mean += Vector3::new(
            found.corner_px / noise.corner_px,
            found.robot_m / noise.robot_m,
            found.robot_rad / noise.robot_rad,
        ) / trials as f64;
    }
    println!("estimated over true noise: {:.3} {:.3} {:.3}", mean.x, mean.y, mean.z);
    assert!((mean.x - 1.0).abs() < 0.01 && (mean.y - 1.0).abs() < 0.06 && (mean.z - 1.0).abs() < 0.06, "{mean}");
}

#[test]
fn estimated_noise_costs_little_against_known_noise() {
    let mut with_known = 0.0;
    let mut with_estimated = 0.0;
    for k in 0..40 {
        let t = trial(Mode::EyeInHand, 10, &REALISTIC, camera(), 900 + k);
        let translation = |noise| {
            let s = estimate(&t.problem(false, noise), &t.start(), &CancelToken::default()).expect("solves");
            t.hand_eye_error(&s).fixed_rows::<3>(0).norm_squared()
        };
        with_known += translation(Some(REALISTIC));
        with_estimated += translation(None);
    }
    let ratio = f64::sqrt(with_estimated / with_known);
    println!("estimated against known noise: {ratio:.3}");
    assert!(ratio < 1.10, "{ratio}");
}

#[test]
fn an_exact_robot_is_recognised() {
    let exact = Noise { corner_px: 0.1, robot_m: 0.0, robot_rad: 0.0 };
    let t = trial(Mode::EyeInHand, 20, &exact, camera(), 42);
    let solution = estimate(&t.problem(false, None), &t.start(), &CancelToken::default()).expect("solves");
    // The bound of an exact robot at 20 views and 0.1 px is 0.037 mm; with a robot of 0.1 mm it would be 0.21 mm.
    assert!(t.hand_eye_error(&solution).fixed_rows::<3>(0).norm() < 1.5e-4);
    assert!(solution.noise.robot_m < 3e-5, "{:?}", solution.noise);
}

#[test]
fn the_answer_does_not_depend_on_the_order_of_views() {
    let t = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 7);
    let mut reversed = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 7);
    reversed.views.reverse();
    let solve = |t: &Trial| estimate(&t.problem(true, None), &t.start(), &CancelToken::default()).expect("solves");
    let (a, b) = (solve(&t), solve(&reversed));
    let (metres, radians) = a.hand_eye.mount_from_camera().distance_to(&b.hand_eye.mount_from_camera());
    // Noise levels are settled to a thousandth; what that leaves is far below a micrometre.
    assert!(metres < 1e-6 && radians < 1e-6, "{metres} {radians}");
}

#[test]
fn influence_is_what_leaving_the_view_out_does() {
    let t = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 11);
    let full = estimate(&t.problem(false, Some(REALISTIC)), &t.start(), &CancelToken::default()).expect("solves");
    for left_out in [0, 5, 11] {
        let mut views = t.views.clone();
        views.remove(left_out);
        let problem = JointProblem { views: &views, ..t.problem(false, Some(REALISTIC)) };
        let without = estimate(&problem, &t.start(), &CancelToken::default()).expect("solves");
        let tip = |s: &JointSolution| s.hand_eye.mount_from_camera().isometry() * full.reference_point;
        let moved = (tip(&without) - tip(&full)).norm();
        let stated = full.views[left_out].influence_m.expect("determined");
        assert!((moved - stated).abs() < 0.05 * moved + 1e-6, "view {left_out}: {stated} stated, {moved} measured");
    }
}

#[test]
fn too_few_views_and_cancelling_are_typed_errors() {
    let t = trial(Mode::EyeInHand, 2, &REALISTIC, camera(), 1);
    let result = estimate(&t.problem(false, None), &t.start(), &CancelToken::default());
    assert!(matches!(result, Err(HandEyeError::TooFewViews { got: 2, need: 3 })));
    let t = trial(Mode::EyeInHand, 5, &REALISTIC, camera(), 1);
    let cancel = CancelToken::default();
    cancel.cancel();
    assert!(matches!(estimate(&t.problem(false, None), &t.start(), &cancel), Err(HandEyeError::Cancelled)));
}

#[test]
fn a_robot_that_only_translates_is_singular_not_a_wrong_answer() {
    let mut t = trial(Mode::EyeInHand, 8, &REALISTIC, camera(), 3);
    let first = *t.views[0].base_from_tip.isometry();
    for (i, view) in t.views.iter_mut().enumerate() {
        let shift = Isometry3::translation(0.004 * i as f64, -0.003 * i as f64, 0.002 * (i % 3) as f64);
        view.base_from_tip = Pose::from_isometry(shift * first);
        let chain =
            camera_from_target(Mode::EyeInHand, &view.base_from_tip, &t.mount_from_camera, &t.anchor_from_target);
        for corner in &mut view.corners {
            corner.px = t.intrinsics.project(&(chain.isometry() * t.points[corner.index])).expect("in front");
        }
    }
    let result = estimate(&t.problem(false, Some(REALISTIC)), &t.start(), &CancelToken::default());
    assert!(matches!(result, Err(HandEyeError::NoSolution { .. })), "{result:?}");
}
