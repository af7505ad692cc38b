use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{ArmError, Setup, session};

use super::*;
use crate::diagnose::findings::FindingOptions;
use crate::diagnose::{Calibration, Promise, calibrate_with};
use crate::handeye::joint::Noise;
use crate::{Method, Options};

/// A robot that repeats well.
const PRECISE: Noise = Noise { corner_px: 0.1, robot_m: 2e-5, robot_rad: 1e-4, ..Noise::EXACT };

fn calibrated(mode: Mode, noise: Noise, accuracy_mm: Option<f64>) -> Calibration {
    let session = session(&Setup { arm_error: ArmError::None, noise, ..Setup::new(mode, 20, 9) });
    let robot = accuracy_mm.map(|mm| RobotAccuracy::new(mm, None));
    let wanted = FindingOptions::default().with_robot_accuracy(robot);
    let observations = session.observations(false);
    calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &CancelToken::default()).expect("solves")
}

fn stated_mm(calibration: &Calibration) -> f64 {
    calibration.reach_errors().expect("accurate to some millimetres").as_it_is_95_m * 1e3
}

#[test]
fn how_near_a_tool_arrives_is_known_where_the_accuracy_is_and_grows_with_it() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        assert_eq!(calibrated(mode, PRECISE, None).reach_errors(), None);
        let [half, one, two] = [0.5, 1.0, 2.0].map(|mm| calibrated(mode, PRECISE, Some(mm)));
        // The camera's part is small beside these.
        assert!((stated_mm(&one) / stated_mm(&half) - 2.0).abs() < 0.05, "{mode:?}: {}", stated_mm(&half));
        assert!((stated_mm(&two) / stated_mm(&one) - 2.0).abs() < 0.05, "{mode:?}: {}", stated_mm(&one));
        let reach = one.reach_errors().expect("as above");
        assert_eq!((reach.corrected_95_m, reach.repeatability_95_m), (None, None), "nothing of the arm is estimated");
        assert!(reach.as_it_is_least_95_m <= reach.as_it_is_95_m, "{reach:?}");
        let promised = one.promised(1e-4, None).expect("a reach");
        assert_eq!((promised.of, promised.error_m), (Promise::Reach, reach.as_it_is_95_m));
        assert_eq!(one.tip_error_95_m(), calibrated(mode, PRECISE, None).tip_error_95_m(), "the camera's part alone");
    }
}

/// The board and the tool see what a robot is off from 0.1 to 0.5 m behind it: a millimetre at the tip is two to four there, and with the
/// camera on the arm it is off at the view and at the touch.
#[test]
fn a_camera_on_the_arm_is_off_with_the_arm() {
    let [on, beside] = [Mode::EyeInHand, Mode::EyeToHand].map(|mode| stated_mm(&calibrated(mode, PRECISE, Some(1.0))));
    assert!((1.6..4.0).contains(&beside), "{beside} mm");
    assert!(on > 1.5 * beside, "{on} mm, {beside} mm");
}

#[test]
fn a_robot_that_scatters_more_than_it_is_said_to_counts_as_it_scatters() {
    let coarse = Noise { robot_m: 1e-3, robot_rad: 2e-3, ..PRECISE };
    let stated = stated_mm(&calibrated(Mode::EyeToHand, coarse, Some(0.01)));
    // 2.8 σ of a point in space by the shift alone.
    assert!(stated > 2.5, "{stated} mm");
}

/// Touches of a view.
const EACH: usize = 100;

/// Touches by another computation: the pose of the tip is off by a shift and a turn, whatever was seen.
#[test]
fn touches_of_a_robot_that_is_off_as_said_are_within_in_95_of_100() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let calibration = calibrated(mode, PRECISE, Some(1.0));
        let stated_m = calibration.reach_errors().expect("accurate to 1 mm").as_it_is_95_m;
        let hand_eye = calibration.hand_eye.expect("an answer");
        let mut random = Draw::new(5);
        let mut off = |metres: f64, radians: f64| {
            let mut three = |sigma: f64| Vector3::from_fn(|_, _| sigma * random.normal());
            nalgebra::Isometry3::new(three(metres), three(radians))
        };
        let sigma = 1e-3 / 3.0_f64.sqrt();
        let mut pose_error = || off(sigma, sigma * TURN_PER_M);
        let tool = Point3::from(crate::reach_error::USUAL_TOOL);
        let mut within = 0;
        let seen: Vec<_> = calibration.views.iter().filter_map(|view| view.camera_from_target).collect();
        for camera_from_target in &seen {
            for _ in 0..EACH {
                let tip = *hand_eye.base_from_tip(camera_from_target).isometry();
                let in_camera = camera_from_target.isometry() * Point3::new(0.05, 0.03, 0.0);
                let at_view = tip * pose_error();
                let (believed, truth) = (camera(&hand_eye, &tip) * in_camera, camera(&hand_eye, &at_view) * in_camera);
                // The tool is tilted nowhere: isotropic errors do not mind.
                let goal =
                    nalgebra::Isometry3::from_parts((believed - tip.rotation * tool.coords).into(), tip.rotation);
                let arrived = goal * pose_error() * tool;
                within += usize::from((arrived - truth).norm() <= stated_m);
            }
        }
        let share = within as f64 / (EACH * seen.len()) as f64;
        // Where the tip of the tool is found is off as well, which is not drawn here.
        assert!((0.95..0.9999).contains(&share), "{mode:?}: {share}");
    }
}
