//! What is reported about a lens with a robot; the study `lens_claims` does it at length.

#[expect(dead_code, reason = "the study draws more than is tested here")]
#[path = "../../../studies/lens_claims/scene.rs"]
mod scene;

use handeye_estimate::diagnose::doctor::Diagnosis;
use handeye_estimate::diagnose::findings::{Finding, FindingCode, Severity};
use handeye_estimate::diagnose::{Calibration, calibrate};
use handeye_estimate::handeye::Mode;
use handeye_estimate::uncertainty::overdispersion::Evidence;
use handeye_estimate::{Method, Observations};
use handeye_geometry::progress::CancelToken;
use scene::Scene;

const MODES: [Mode; 2] = [Mode::EyeInHand, Mode::EyeToHand];

/// As made by the command line.
fn examined(observations: &Observations) -> (Calibration, Diagnosis) {
    let cancel = CancelToken::default();
    let calibration = calibrate(observations, Method::Joint, &cancel).expect("calibrates");
    let diagnosis = calibration.diagnosis().clone();
    (calibration, diagnosis)
}

fn named(diagnosis: &Diagnosis, code: FindingCode) -> Option<&Finding> {
    diagnosis.findings.iter().find(|finding| finding.code == code)
}

/// Programs differ by half a pixel in where an image begins, and a lens from another program is off by that.
#[test]
fn a_given_lens_whose_centre_is_half_a_pixel_off_is_named_and_counted() {
    for mode in MODES {
        for seed in 0..3 {
            let session = Scene { corner_px: 0.03, robot: (2e-5, 5e-5), ..Scene::new(mode, 20) }.draw(seed);
            let (calibration, diagnosis) = examined(&session.given([0.5, 0.5]));
            let finding = named(&diagnosis, FindingCode::WrongIntrinsics).expect("it is named");
            assert_eq!(finding.severity, Severity::Warning);
            let reported = finding.to_string();
            assert!(reported.contains("half a pixel"), "{mode:?} {seed}: {reported}");
            let right = format!("cx = {:.2} and cy = {:.2}", session.lens.cx, session.lens.cy);
            assert!(reported.contains(&right), "{mode:?} {seed}: {reported}, not {right}");
            let (error_m, stated_m) = session.errors_m(&calibration).expect("answered");
            let stated_m = stated_m.expect("one cause explains it");
            assert!(error_m > 3e-4, "{mode:?} {seed}: the lens changes nothing: nothing is asserted");
            assert!(
                (error_m..2.0 * error_m).contains(&stated_m),
                "{mode:?} {seed}: off by {error_m}, stated {stated_m}"
            );
        }
    }
}

/// A dozen views with an arm that scatters by 0.1 mm hardly distinguish one centre from another, and not half a pixel
/// at all.
#[test]
fn half_a_pixel_is_named_where_another_centre_would_not_be() {
    let mut found = 0;
    for seed in 0..4 {
        let session = Scene { corner_px: 0.03, ..Scene::new(Mode::EyeInHand, 12) }.draw(seed);
        let reported = |off: f64| {
            let (_, diagnosis) = examined(&session.given([off; 2]));
            named(&diagnosis, FindingCode::WrongIntrinsics).map(ToString::to_string)
        };
        let off = if seed % 2 == 0 { 0.5 } else { -0.5 };
        found += usize::from(reported(off).is_some_and(|reported| reported.contains("half a pixel")));
        assert_eq!(reported(0.0), None, "{seed}");
    }
    assert!(found >= 2, "in {found} of 4");
}

#[test]
fn a_given_lens_that_is_right_is_not_accused() {
    for mode in MODES {
        for (corner_px, robot) in
            [(0.0, (0.0, 0.0)), (0.03, (1e-5, 3e-5)), (0.1, (1e-4, 3.5e-4)), (0.3, (1e-4, 3.5e-4))]
        {
            let session = Scene { corner_px, robot, shared_px: 0.5 * corner_px, ..Scene::new(mode, 16) }.draw(7);
            let (_, diagnosis) = examined(&session.given([0.0, 0.0]));
            let accused = named(&diagnosis, FindingCode::WrongIntrinsics);
            assert!(accused.is_none(), "{mode:?}, {corner_px} px, {robot:?}: {accused:?}");
        }
    }
}

#[test]
fn fx_and_fy_that_differ_by_more_than_those_of_a_camera_are_named() {
    for aspect in [0.03, -0.03] {
        let scene = Scene { aspect, ..Scene::new(Mode::EyeInHand, 14) };
        let session = scene.draw(3);
        for observations in [session.alone(), session.unknown()] {
            let (_, diagnosis) = examined(&observations);
            let finding = named(&diagnosis, FindingCode::PixelAspect).expect("it is named");
            assert_eq!(finding.severity, Severity::Warning);
            let (ratio, sigma) =
                (finding.value("fx_over_fy").expect("there"), finding.value("fx_over_fy_sigma").expect("there"));
            let truth = session.lens.fx / session.lens.fy;
            assert!((ratio - truth).abs() < 4.0 * sigma && sigma < 2e-3, "{ratio} ± {sigma} for {truth}");
            assert!(finding.to_string().contains("scaled in one direction"), "{finding}");
        }
    }
}

#[test]
fn fx_and_fy_of_a_camera_are_not_accused_where_views_tell_them_badly() {
    for mode in MODES {
        for seed in 0..3 {
            // At most twelve degrees of tilt, and no rotations about the axis of the camera.
            let scene = Scene { tilt_deg: 12.0, roll_deg: 5.0, shared_px: 0.1, ..Scene::new(mode, 8) };
            let session = scene.draw(seed);
            for observations in [session.alone(), session.unknown()] {
                let (_, diagnosis) = examined(&observations);
                let accused = named(&diagnosis, FindingCode::PixelAspect);
                assert!(accused.is_none(), "{mode:?} {seed}: {accused:?}");
            }
        }
    }
}

/// Errors shared by the corners of a view make the lens less well known than independent corners suggest, and few views do not
/// refute that.
#[test]
fn what_views_say_of_the_lens_counts_where_their_corners_err_alike() {
    for print_m in [0.0, 1e-4] {
        let checked = |shared_px: f64, seed: u64| {
            let scene = Scene { shared_px, print_m, ..Scene::new(Mode::EyeInHand, 8) };
            let (calibration, _) = examined(&scene.draw(seed).unknown());
            let joint = calibration.joint.as_ref().expect("of the joint estimate");
            assert_eq!(joint.print.is_some(), print_m > 0.0, "the print shows where it is off");
            let check = joint.widening.checks.iter().find(|check| check.by == Evidence::Lens).expect("it is estimated");
            // Nothing is known of the lens beforehand.
            assert_eq!(joint.widening.lens, check.ratio.max(1.0));
            check.ratio
        };
        let mean = |shared_px| (0..6).map(|seed| checked(shared_px, seed)).sum::<f64>() / 6.0;
        let (alike, independent) = (mean(0.1), mean(0.0));
        // One is right where corners err independently; six of some thirty degrees of freedom scatter by a tenth, and a
        // deviation of four tenths is not by chance.
        assert!((0.6..1.4).contains(&independent), "{independent}");
        assert!(alike > 1.4, "{alike} where corners err alike");
    }
}
