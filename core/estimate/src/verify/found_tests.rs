//! Verification with what a calibration estimates in addition to the links, the size of the board; and the error
//! distribution of measured points.

use nalgebra::Point3;

use super::*;
use crate::diagnose::findings::FindingOptions;
use crate::diagnose::{Calibration, calibrate_with};
use crate::handeye::joint::{Noise, SmallSample};
use crate::handeye::{HandEye, Mode};
use crate::test_sessions::OFF_LINKS;
use crate::{Method, Observations, Options};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::testing::BOARD;
use handeye_simulate::session::{ArmError, REALISTIC, Session, Setup, camera, session, trial};

/// A print that is larger than stated by this factor, as one that a printer "fits to the page".
const SCALE: f64 = 1.024;
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

fn off_by_its_links(mode: Mode, seed: u64) -> (Session, Calibration) {
    // A robot that repeats well, as industrial ones do.
    let noise = Noise { corner_px: 0.1, robot_m: 2e-5, robot_rad: 1e-4, ..Noise::EXACT };
    let arm_error = ArmError::Links(OFF_LINKS.map(|row| row.map(|value| 4.0 * value)));
    let t = session(&Setup { joints: true, arm_error, noise, ..Setup::new(mode, 40, seed) });
    let mut observations = t.observations(false);
    observations.views.truncate(20);
    let calibration = solved(&observations, Options::default());
    (t, calibration)
}

#[test]
fn captures_are_predicted_by_corrected_tip_poses_as_well_as_the_errors_of_the_arm_are_known() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (t, calibration) = off_by_its_links(mode, 90);
        let reported = check_all(&Predictor::new(&calibration).expect("complete"), &t.views[20..]);
        let of_arm = Predictor::of_arm(&calibration).expect("its joints are known");
        let corrected = check_all(&of_arm, &t.views[20..]);
        let consistency = corrected.consistency.expect("it states an uncertainty");
        println!(
            "{mode:?}: {:.3} mm, corrected {:.3} mm, {consistency:?}",
            reported.centre_rms_m * 1e3,
            corrected.centre_rms_m * 1e3
        );
        assert!(corrected.centre_rms_m < 0.5 * reported.centre_rms_m, "{mode:?}");
        assert!(consistency.is_consistent() && consistency.ratio > 0.3, "{mode:?}: {consistency:?}");

        let unknown = View { tip_from_joints: Vec::new(), ..t.views[20].clone() };
        let error = verify(&of_arm, &BOARD, &[&unknown], &CancelToken::default()).expect_err("no joints");
        assert!(matches!(error, VerifyError::NoJoints { .. }), "{error}");
    }
}

/// Checked by finite differences over both ends of every principal axis.
#[test]
fn the_covariance_of_a_point_counts_the_errors_of_the_arm_with_those_of_the_camera() {
    let (t, calibration) = off_by_its_links(Mode::EyeInHand, 91);
    let of_arm = Predictor::of_arm(&calibration).expect("its joints are known");
    let (view, px) = (&t.views[30], nalgebra::Vector2::new(100.0, 50.0));
    let at = |calibrated: &Predictor| {
        let tip = calibrated.arm.as_ref().expect("corrected").of_view(view);
        let base_from_tip = Pose::from_isometry(view.base_from_tip.isometry() * tip.reported_from_true);
        calibrated.point_at_depth(TipAt { base_from_tip, by_errors: tip.by_errors }, &px, 0.8).expect("a point")
    };
    let stated = at(&of_arm).covariance_in_base.expect("stated");
    let fit = calibration.arm().expect("its joints are known");
    let eigen = fit.links_and_errors_covariance().symmetric_eigen();
    let mut expected = nalgebra::Matrix3::zeros();
    for (axis, variance) in eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter()) {
        let step = axis * variance.max(0.0).sqrt();
        let moved = |sign: f64| {
            let mut moved = of_arm.clone();
            let links = &of_arm.hand_eye;
            let by: nalgebra::Vector6<f64> = step.fixed_rows::<6>(0) * sign;
            moved.hand_eye = HandEye::new(t.mode, links.mount_from_camera().perturbed(&by), links.anchor_from_target());
            let errors = moved.arm.as_mut().expect("corrected").numbers_mut();
            errors.zip(step.iter().skip(12)).for_each(|(error, by)| *error += sign * by);
            at(&moved).in_base.point()
        };
        let by = (moved(1.0) - moved(-1.0)) / 2.0;
        expected += by * by.transpose();
    }
    assert!((stated - expected).norm() < 1e-3 * expected.norm(), "{stated} {expected}");
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
        // As for the plain chain: 20 trials of 10 captures, mean ratio 1 with a spread of 0.06.
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
}
