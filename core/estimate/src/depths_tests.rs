//! Depths drawn pixel by pixel from the poses of the target, with errors that depth cameras have and the estimate's model does
//! not.

use nalgebra::{Isometry3, Vector2, Vector3};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::handeye::joint::Noise;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::testing::BOARD;
use handeye_simulate::links::normal;
use handeye_simulate::session::{Session, camera, trial};

const NOISE: Noise = Noise { corner_px: 0.1, robot_m: 1e-4, robot_rad: 3e-4, ..Noise::EXACT };
const VIEWS: usize = 12;
const SESSIONS: u64 = 16;

/// The depths of a plane, a value for every pixel, with an error by place in the image (−1 … 1) and depth, and white noise.
fn depth_image(
    rng: &mut ChaCha8Rng,
    lens: &Intrinsics,
    board: &Isometry3<f64>,
    noise_m: f64,
    error_m: impl Fn(Vector2<f64>, f64) -> f64,
) -> DepthImage {
    let normal_vector = board.rotation * Vector3::z();
    let height = normal_vector.dot(&board.translation.vector);
    let (width, rows) = (lens.width, lens.height);
    let metres = (0..width * rows).map(|i| {
        let px = Vector2::new(f64::from(i % width), f64::from(i / width));
        let ray = lens.unproject(&px).expect("in the lens").into_inner();
        let depth = height / normal_vector.dot(&ray) * ray.z;
        let half = Vector2::new(f64::from(width), f64::from(rows)) / 2.0;
        let place = (px - half).component_div(&half);
        (depth + error_m(place, depth) + noise_m * normal(rng)) as f32
    });
    DepthImage::new(width, rows, metres.collect()).expect("as many as pixels")
}

/// Sums over sessions with and without depths.
#[derive(Default, Debug)]
struct Tally {
    sessions: f64,
    accepted: f64,
    squares_mm2: [f64; 2],
    within: [f64; 2],
}

impl Tally {
    fn rms_mm(&self) -> [f64; 2] {
        self.squares_mm2.map(|sum| (sum / self.sessions).sqrt())
    }
}

fn tally(sessions: u64, noise_m: f64, error_m: impl Fn(&mut ChaCha8Rng) -> Error) -> Tally {
    let mut tally = Tally::default();
    for seed in 0..sessions {
        let mut t = trial(Mode::EyeInHand, VIEWS, &NOISE, camera(), 700 + seed);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let without = t.observations(true);
        for (view, board) in t.views.iter_mut().zip(&t.true_camera_from_target) {
            let error = error_m(&mut rng);
            let image = depth_image(&mut rng, &t.intrinsics, board.isometry(), noise_m, error);
            view.depth = DepthPlane::new(&image, (t.intrinsics.width, t.intrinsics.height), &view.corners, &BOARD);
            assert!(view.depth.is_some());
        }
        let with = t.observations(true);
        tally.sessions += 1.0;
        for (k, observations) in [without, with].iter().enumerate() {
            let found = fit(observations, Method::Joint, &CancelToken::default()).expect("solves");
            let joint = found.joint.as_ref().expect("a joint estimate");
            let off = error_m_of(&t, &found);
            tally.squares_mm2[k] += (off * 1e3).powi(2);
            tally.within[k] += f64::from(u8::from(off <= found.modelled_error_95_m().expect("stated")));
            tally.accepted += f64::from(u8::from(joint.depths.is_some_and(|depths| depths.in_fit.accepted)));
        }
    }
    tally
}

fn error_m_of(t: &Session, found: &Fit) -> f64 {
    let joint = found.joint.as_ref().expect("a joint estimate");
    let there = found.hand_eye.expect("a hand-eye").mount_from_camera();
    let point = joint.reference_point;
    (there.isometry() * point - t.mount_from_camera.isometry() * point).norm()
}

/// Errors of the depths of a camera, by place in the image (−1 … 1) and depth; drawn again for every image.
type Error = Box<dyn Fn(Vector2<f64>, f64) -> f64>;

/// Makes one for every image.
type DepthCamera = dyn Fn(&mut ChaCha8Rng) -> Error;

const SINGLE_DEPTHS_M: f64 = 3e-4;

/// Sessions among 1000 to 1059 that leave out depths that are right.
const LEFT_OUT: [u64; 2] = [1024, 1059];

/// A camera whose depths are measured along its lens, with an offset of 5 mm and a scale of one part in a hundred.
#[test]
fn depths_along_the_lens_make_the_answer_better_and_the_stated_error_stays_true() {
    let found = tally(SESSIONS, SINGLE_DEPTHS_M, |_| Box::new(|_, depth| 0.005 + 0.01 * depth));
    let [without, with] = found.rms_mm();
    println!("{without:.3} mm without, {with:.3} mm with depths; {found:?}");
    // One session in twenty leaves them out by chance.
    assert!(found.accepted >= 0.7 * found.sessions && with < 0.8 * without, "{found:?}");
    assert!(found.within[1] >= 0.8 * found.sessions, "{found:?}");
}

#[test]
fn depths_that_are_off_as_the_model_does_not_know_do_no_harm() {
    let turned =
        |_: &mut ChaCha8Rng| -> Error { Box::new(|place, depth| 0.5_f64.to_radians() * 0.55 * place.x * depth) };
    let bowl = |_: &mut ChaCha8Rng| -> Error { Box::new(|place, _| 0.004 * place.norm_squared()) };
    let by_square = |_: &mut ChaCha8Rng| -> Error { Box::new(|_, depth| 0.02 * depth * depth) };
    let ripple =
        |_: &mut ChaCha8Rng| -> Error { Box::new(|place, _| 0.001 * ((8.0 * place.x).sin() + (7.0 * place.y).cos())) };
    let of_each_image = |rng: &mut ChaCha8Rng| -> Error {
        let [a, b, c] = std::array::from_fn(|_| normal(rng));
        Box::new(move |place, _| 0.001 * (a + b * (3.0 * place.x + c).sin() + c * (3.0 * place.y + a).cos()))
    };
    let along_rays = |_: &mut ChaCha8Rng| -> Error {
        let lens = camera();
        Box::new(move |place, depth| {
            let ray = Vector2::new(place.x * 320.0 / lens.fx, place.y * 240.0 / lens.fy);
            depth * ((1.0 + ray.norm_squared()).sqrt() - 1.0)
        })
    };
    let cameras: [(&str, &DepthCamera); 6] = [
        ("the distance along the pixel's ray", &along_rays),
        ("turned by 0.5°", &turned),
        ("a bowl of 4 mm", &bowl),
        ("2 % of the squared depth", &by_square),
        ("a ripple of 1 mm, the same in all images", &ripple),
        ("1 mm, another in every image", &of_each_image),
    ];
    for (name, error) in cameras {
        let found = tally(SESSIONS, SINGLE_DEPTHS_M, error);
        let [without, with] = found.rms_mm();
        println!("{name}: {without:.3} mm without, {with:.3} mm with depths; {found:?}");
        assert!(with < 1.1 * without, "{name}: {found:?}");
        assert!(found.within[1] >= 0.8 * found.sessions, "{name}: {found:?}");
    }
}

/// The errors that the depths of 20 views have, each found within its stated uncertainty, and none mistaken for
/// another.
#[test]
fn the_errors_of_a_depth_camera_are_found_to_what_is_stated() {
    let mut t = trial(Mode::EyeInHand, 20, &NOISE, camera(), 41);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let turned = 0.5_f64.to_radians();
    for (view, board) in t.views.iter_mut().zip(&t.true_camera_from_target) {
        // The angle of the pixel's own ray counts: a turn about the camera's y brings nearer what is at positive x.
        let lens = t.intrinsics;
        let across = move |place: Vector2<f64>| (place.x * 320.0 + 320.0 - lens.cx) / lens.fx;
        let error = |place: Vector2<f64>, depth: f64| 0.005 + 0.01 * depth - turned * across(place) * depth;
        let image = depth_image(&mut rng, &lens, board.isometry(), SINGLE_DEPTHS_M, error);
        view.depth = DepthPlane::new(&image, (lens.width, lens.height), &view.corners, &BOARD);
    }
    let found = fit(&t.observations(true), Method::Joint, &CancelToken::default()).expect("solves");
    let depths = found.joint.and_then(|joint| joint.depths).expect("depths");
    let (values, covariance) = (depths.in_fit.bias.values(), depths.in_fit.covariance);
    let expected = [0.005, 0.01, 0.0, 0.0, turned];
    for (k, (value, expected)) in values.iter().zip(expected).enumerate() {
        let sigma = covariance[(k, k)].sqrt();
        assert!((value - expected).abs() < 3.5 * sigma, "{k}: {value} ± {sigma}, not {expected}");
    }
    let tilt_sigma = covariance[(4, 4)].sqrt();
    assert!(tilt_sigma < turned / 5.0, "{tilt_sigma}: it would not be seen");
    assert!(depths.in_fit.weight.turned && depths.in_fit.other_probability < 0.05, "{depths:?}");
}

/// Depths that are right make held-out predictions worse in some sessions, by chance: it shows what happens to those that are left
/// out.
#[test]
fn an_answer_that_leaves_the_depths_out_is_that_without_them() {
    let mut left_out = 0;
    for seed in LEFT_OUT {
        let mut t = trial(Mode::EyeInHand, VIEWS, &NOISE, camera(), seed);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let without = fit(&t.observations(true), Method::Joint, &CancelToken::default()).expect("solves");
        for (view, board) in t.views.iter_mut().zip(&t.true_camera_from_target) {
            let lens = t.intrinsics;
            let image = depth_image(&mut rng, &lens, board.isometry(), SINGLE_DEPTHS_M, |_, _| 0.0);
            view.depth = DepthPlane::new(&image, (lens.width, lens.height), &view.corners, &BOARD);
        }
        let with = fit(&t.observations(true), Method::Joint, &CancelToken::default()).expect("solves");
        let joint = with.joint.as_ref().expect("a joint estimate");
        let depths = joint.depths.expect("an attempt");
        if depths.in_fit.accepted {
            continue;
        }
        left_out += 1;
        assert_eq!(depths.bias, DepthBias::default());
        assert_eq!(depths.in_fit.weight(), None);
        assert!(depths.in_fit.heldout_after_px > depths.in_fit.heldout_before_px, "{depths:?}");
        let camera = |found: &Fit| found.hand_eye.expect("a hand-eye").mount_from_camera();
        assert_eq!(camera(&with), camera(&without));
        assert_eq!(with.modelled_error_95_m(), without.modelled_error_95_m());
    }
    assert!(left_out > 0, "all sessions count on their depths");
}

/// Drawn depths are exact except for the rounding of their numbers. The estimate treats them like that; a verification, which tests
/// for errors, takes them as no better than those of depth cameras.
#[test]
fn a_verification_takes_no_depth_for_better_than_a_camera_resolves() {
    let mut t = trial(Mode::EyeInHand, VIEWS, &NOISE, camera(), 43);
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for (view, board) in t.views.iter_mut().zip(&t.true_camera_from_target) {
        let lens = t.intrinsics;
        let image = depth_image(&mut rng, &lens, board.isometry(), 0.0, |_, _| 0.0);
        view.depth = DepthPlane::new(&image, (lens.width, lens.height), &view.corners, &BOARD);
    }
    let found = fit(&t.observations(true), Method::Joint, &CancelToken::default()).expect("solves");
    let (noise, in_fit) = found.joint.as_ref().and_then(|joint| Some((joint.noise, joint.depths?))).expect("depths");
    let level_m = |weight: DepthWeight| noise.corner_px / weight.px_per_m;
    let counted = in_fit.in_fit.weight().expect("the answer uses them");
    assert!(level_m(counted) < resolution::DEPTH_M, "{} m", level_m(counted));
    let examined = crate::diagnose::Calibration::as_modelled(found);
    let uncertainty =
        crate::verify::Predictor::new(&examined).expect("a camera on a robot").uncertainty.expect("stated");
    let (_, judged) = uncertainty.depths.expect("depths");
    assert!((level_m(judged) / resolution::DEPTH_M - 1.0).abs() < 1e-9, "{} m", level_m(judged));
}
