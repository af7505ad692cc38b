//! Verification with what a calibration finds out beside the links: the size of the board and offsets of the joints; and
//! the law of measured points.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3, Vector6};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::diagnose::findings::FindingOptions;
use crate::diagnose::{Calibration, calibrate_with};
use crate::handeye::joint::{Noise, SmallSample};
use crate::handeye::{HandEye, Mode};
use crate::{CameraKnowledge, Method, Observations, ObservedView, Options};
use handeye_arm::{ArmKind, ArmModel};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::testing::BOARD;
use handeye_simulate::links::noise_twist;
use handeye_simulate::session::{REALISTIC, Session, camera, seen, trial};

/// A print that is so much larger than stated, as one that a printer "fits to the page".
const SCALE: f64 = 1.024;
/// What the joints of the simulated arm are off by, degrees; the first and the last joint cannot be told.
const OFFSETS_DEG: [f64; 6] = [0.0, 0.2, -0.15, 0.1, -0.2, 0.0];

const EXACT: Noise = Noise { corner_px: 0.0, robot_m: 0.0, robot_rad: 0.0, ..Noise::EXACT };

fn check_all(calibrated: &Predictor, views: &[View]) -> Verification {
    let captures: Vec<_> = views.iter().collect();
    verify(calibrated, &BOARD, &captures, &CancelToken::default()).expect("verifies")
}

fn solved(observations: &Observations, options: Options) -> Calibration {
    let (wanted, cancel) = (FindingOptions::default(), CancelToken::default());
    calibrate_with(observations, Method::Joint, options, &wanted, &cancel).expect("solves")
}

/// The corners of a trial as if its board had been printed larger, with the noise that they had.
fn printed_larger(t: &mut Session) {
    for (view, pose) in t.views.iter_mut().zip(&t.true_camera_from_target) {
        for corner in &mut view.corners {
            let at = |scale: f64| {
                let point = Point3::from(t.points[corner.index].coords * scale);
                t.intrinsics.project(&(pose.isometry() * point)).expect("in front of the camera")
            };
            corner.px += at(SCALE) - at(1.0);
        }
    }
}

#[test]
fn a_board_that_is_larger_than_stated_is_seen_where_it_is() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let mut t = trial(mode, 5, &EXACT, camera(), 81);
        printed_larger(&mut t);
        let exact = Predictor {
            shape: BoardShape { scale: SCALE, ..BoardShape::default() },
            ..Predictor::known(HandEye::new(t.mode, t.mount_from_camera, t.anchor_from_target), t.intrinsics)
        };
        let v = check_all(&exact, &t.views);
        println!("{mode:?}: middle of the board {:.4} mm", v.centre_rms_m * 1e3);
        assert!(v.rms_px < 1e-6 && v.centre_rms_m < 1e-8 && v.orientation_rms_rad < 1e-6, "{mode:?}: {v:?}");
        assert!(v.captures.iter().all(|c| c.pnp_rms_px < 1e-6 && c.origin_error_in_base_m.norm() < 1e-8));
        assert!(v.origin_scatter_m.expect("five captures") < 1e-8);

        // A pixel on a corner is the corner, half a metre away.
        let (view, board) = (&t.views[0], BoardPoints::new(&t.points));
        let flat = planar_pose::camera_from_target(&view.corners, &BOARD, &t.intrinsics).expect("a pose");
        let seen = exact.seen(&board, (&view.corners, None), &flat).expect("in front of the camera");
        let centre = BOARD.centre();
        let nearer = seen.isometry() * (centre * SCALE) - flat.isometry() * centre;
        println!("{mode:?}: as a board of the stated size it would be {:.1} mm nearer", nearer.norm() * 1e3);
        // 2.4 % of 0.4 to 0.6 m.
        assert!((0.009..0.015).contains(&nearer.norm()), "{nearer}");
        let corner = &view.corners[34];
        let found = exact.point_on_board(&view.base_from_tip, &corner.px, &seen).expect("a point");
        let truth = t.true_camera_from_target[0].isometry() * board.point(corner.index, &exact.shape);
        assert!((found.in_camera.point() - truth).norm() < 1e-8, "{} {truth}", found.in_camera.point());
    }
}

/// Views of a UR5 whose joints stand a little elsewhere than it reports, with the board half a metre in front of it.
fn views_of_an_arm_with_offsets(count: usize, noise: &Noise, intrinsics: &Intrinsics, seed: u64) -> Vec<View> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let arm = ArmModel::Kind(ArmKind::Ur5).arm().expect("built in");
    let tip_from_camera: Pose<Tip, Camera> =
        Pose::from_isometry(se3::exp(&Vector6::new(0.05, 0.01, 0.06, 0.1, -0.05, 0.4)));
    let middle = [0.3, -1.4, 1.6, -1.7, -1.5, 0.2];
    let standing = arm.forward(&middle).expect("six joints") * tip_from_camera;
    let centre = BOARD.centre();
    let ahead =
        Isometry3::from_parts(Vector3::new(0.0, 0.0, 0.5).into(), UnitQuaternion::from_euler_angles(0.2, -0.1, 0.1))
            * Isometry3::translation(-centre.x, -centre.y, -centre.z);
    let base_from_target: Pose<Base, Target> = standing * Pose::from_isometry(ahead);
    let mut views = Vec::new();
    while views.len() < count {
        // Wrist and arm turn, so that the offsets of the four joints between are told.
        let reported: Vec<f64> =
            (0..6).map(|j| middle[j] + rng.random_range(-1.0..1.0) * if j == 5 { 0.9 } else { 0.35 }).collect();
        let really: Vec<f64> = reported.iter().zip(OFFSETS_DEG).map(|(q, deg)| q + deg.to_radians()).collect();
        let camera_from_target =
            (arm.forward(&really).expect("six joints") * tip_from_camera).inverse() * base_from_target;
        let corners =
            seen(&mut rng, intrinsics, camera_from_target.isometry(), &BOARD.points(), noise.corner_px, |_| {
                Vector2::zeros()
            });
        let error = noise_twist(&mut rng, noise.robot_m, noise.robot_rad);
        let base_from_tip = arm.forward(&reported).expect("six joints").perturbed(&error);
        let tip_by_joint = arm.tip_by_joint_at(&base_from_tip, &reported).expect("six joints");
        if let Some(corners) = corners {
            views.push(View { tip_by_joint, ..View::new(views.len().to_string(), base_from_tip, corners) });
        }
    }
    views
}

fn observed(views: &[View], intrinsics: Intrinsics) -> Observations {
    Observations {
        mode: Some(Mode::EyeInHand),
        target: BOARD,
        image_size: (intrinsics.width, intrinsics.height),
        camera: CameraKnowledge::Fixed(intrinsics),
        views: views.iter().map(ObservedView::from).collect(),
    }
}

#[test]
fn a_capture_whose_joints_are_unknown_is_not_verified_as_if_they_were_right() {
    let mut views = views_of_an_arm_with_offsets(12, &EXACT, &camera(), 83);
    let observations = observed(&views, camera());
    let calibration = solved(&observations, Options { joint_offsets: true, ..Options::default() });
    let calibrated = Predictor::new(&calibration).expect("complete");
    assert_eq!(calibrated.joint_offsets_rad.len(), 6);
    views[1].tip_by_joint.clear();
    let captures: Vec<_> = views.iter().collect();
    let result = verify(&calibrated, &BOARD, &captures, &CancelToken::default());
    assert_eq!(result, Err(VerifyError::NoJoints { name: "1".to_owned() }));
}

#[test]
fn the_error_of_a_measured_point_follows_the_law_of_the_calibration() {
    // Six views leave few degrees of freedom.
    let t = trial(Mode::EyeInHand, 6, &REALISTIC, camera(), 84);
    let calibration = solved(&t.observations(false), Options::default());
    let law = calibration.joint.as_ref().expect("a joint estimate").small_sample;
    let calibrated = Predictor::new(&calibration).expect("complete");
    // The point for which the result states its expected error.
    let reference = calibration.joint.as_ref().expect("a joint estimate").reference_point;
    let px = t.intrinsics.project(&reference).expect("in front");
    let point = calibrated.point_at_depth(&t.views[0].base_from_tip, &px, reference.z).expect("a point");
    let (here, stated) = (point.error_95_m().expect("stated"), calibration.tip_error_95_m().expect("stated"));
    assert!((here / stated - 1.0).abs() < 1e-6, "{here} here, {stated} in the result");
    let gaussian = handeye_geometry::point_error::radius_95(&point.covariance_in_base.expect("stated"));
    println!(
        "{:.1} degrees of freedom: {:.3} mm, Gaussian {:.3} mm",
        law.degrees_of_freedom,
        here * 1e3,
        gaussian * 1e3
    );

    // √(3 F(3, 8)) at 95 % is 3.4927, √χ²(3) 2.7955: the published quantiles.
    let few = SmallSample { degrees_of_freedom: 8.0, ..SmallSample::KNOWN };
    let round = Some(nalgebra::Matrix3::identity() * 1e-8);
    let point = MeasuredPoint { covariance_in_base: round, small_sample: few, ..point };
    assert!((point.error_95_m().expect("stated") * 1e4 - 3.4927).abs() < 1e-3, "{:?}", point.error_95_m());
    let known = MeasuredPoint { small_sample: SmallSample::KNOWN, ..point };
    assert!((known.error_95_m().expect("stated") * 1e4 - 2.7955).abs() < 1e-3, "{:?}", known.error_95_m());
}

mod slow {
    use super::*;

    #[test]
    fn a_found_scale_predicts_as_well_as_it_says() {
        // As of the plain chain: 20 trials of 10 captures, mean ratio 1 with a spread of 0.06.
        let (mut mean, mut single, mut centre_m, mut stated) = (0.0, 0.0, 0.0, 0);
        for seed in 0..20 {
            let mut t = trial(Mode::EyeInHand, 40, &REALISTIC, camera(), 8100 + seed);
            printed_larger(&mut t);
            let mut observations = t.observations(false);
            observations.views.truncate(30);
            let calibration = solved(&observations, Options { free_scale: true, ..Options::default() });
            let v = check_all(&Predictor::new(&calibration).expect("complete"), &t.views[30..]);
            mean += v.consistency.expect("stated").ratio / 20.0;
            single += v.captures.iter().map(|c| c.ratio.expect("stated")).sum::<f64>() / 200.0;
            stated += usize::from(v.consistency.expect("stated").is_consistent());
            centre_m += v.centre_rms_m / 20.0;
        }
        println!(
            "scale {SCALE}: middle {:.3} mm, ratio {mean:.3}, of captures {single:.3}, {stated} of 20",
            centre_m * 1e3
        );
        assert!((0.8..1.25).contains(&mean) && (0.8..1.25).contains(&single), "{mean} {single}");
        assert!(stated >= 17, "{stated}");
        // A robot of 0.1 mm and 0.02°, which at half a metre is 0.17 mm, and an image of 0.1 px.
        assert!(centre_m < 0.5e-3, "{centre_m}");
    }

    #[test]
    fn accepted_joint_offsets_are_part_of_the_prediction() {
        let (mut mean, mut centre_m, mut without_m) = (0.0, 0.0, 0.0);
        for seed in 0..10 {
            let views = views_of_an_arm_with_offsets(40, &REALISTIC, &camera(), 8200 + seed);
            let observations = observed(&views[..30], camera());
            let calibration = solved(&observations, Options { joint_offsets: true, ..Options::default() });
            assert!(
                calibration
                    .joint
                    .as_ref()
                    .and_then(|joint| joint.joint_offsets.as_ref())
                    .is_some_and(|offsets| offsets.accepted),
                "seed {seed}"
            );
            let calibrated = Predictor::new(&calibration).expect("complete");
            let v = check_all(&calibrated, &views[30..]);
            mean += v.consistency.expect("stated").ratio / 10.0;
            centre_m += v.centre_rms_m / 10.0;
            let forgotten = Predictor { joint_offsets_rad: Vec::new(), uncertainty: None, ..calibrated };
            without_m += check_all(&forgotten, &views[30..]).centre_rms_m / 10.0;
        }
        println!(
            "offsets {OFFSETS_DEG:?}°: middle {:.3} mm, ratio {mean:.3}; without them {:.3} mm",
            centre_m * 1e3,
            without_m * 1e3
        );
        assert!((0.75..1.3).contains(&mean), "{mean}");
        assert!(centre_m < 0.5e-3 && without_m > 1e-3, "{centre_m} {without_m}");
    }
}
