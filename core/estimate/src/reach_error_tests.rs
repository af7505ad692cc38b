use handeye_arm::ArmKind;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{ArmError, Session, Setup, session};

use super::*;
use crate::handeye::joint::Noise;
use crate::{Fit, Method, fit};

/// A robot that repeats well.
const PRECISE: Noise = Noise { corner_px: 0.1, robot_m: 2e-5, robot_rad: 1e-4, ..Noise::EXACT };

fn solved(mode: Mode, arm_error: ArmError) -> (Session, Fit, Vec<Seen>) {
    let session = session(&Setup { joints: true, arm_error, noise: PRECISE, ..Setup::new(mode, 20, 9) });
    let found = fit(&session.observations(false), Method::Joint, &CancelToken::default()).expect("solves");
    let near = [0.0, -1.2, 1.6, -1.9, -1.5, 0.0];
    let seen = session.views.iter().zip(&found.views).map(|(view, found)| Seen {
        joints_rad: ArmKind::Ur5.arm().inverse(&view.base_from_tip, &near).expect("within reach"),
        camera_from_target: found.camera_from_target.expect("used"),
    });
    let seen = seen.collect();
    (session, found, seen)
}

fn stated(session: &Session, found: &Fit, seen: &[Seen]) -> Option<ReachErrors> {
    reach(session, found, seen)?.at_target()
}

fn reach(session: &Session, found: &Fit, seen: &[Seen]) -> Option<Reach> {
    let fit = found.joint.as_ref()?.arm.as_ref()?;
    let arm = CorrectedArm::new(ArmKind::Ur5.arm(), fit)?;
    Reach::new((&arm, fit), found.hand_eye.as_ref()?, seen.to_vec(), &session.target, true)
}

#[test]
fn an_arm_whose_links_are_off_arrives_nearer_by_corrected_commands_and_an_exact_one_as_near() {
    let mut links = [[2e-4, -3e-4, 1e-3, 1.5e-3]; 6];
    links[2] = [-5e-4, 0.0, -1.5e-3, -2e-3];
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (session, found, seen) = solved(mode, ArmError::Links(links));
        let off = stated(&session, &found, &seen).expect("an arm in reach");
        let (session, found, seen) = solved(mode, ArmError::None);
        let exact = stated(&session, &found, &seen).expect("an arm in reach");
        println!("{mode:?}: {off:?}, exact {exact:?}");
        let corrected_95_m = off.corrected_95_m.expect("its own chain");
        assert!(corrected_95_m < off.as_it_is_95_m, "{mode:?}: {off:?}");
        assert!(off.repeatability_95_m < Some(corrected_95_m), "{mode:?}: {off:?}");
        assert!(exact.as_it_is_95_m < 0.5 * off.as_it_is_95_m, "{mode:?}: {exact:?}");
        assert_eq!(stated(&session, &found, &seen), Some(exact), "the same in every run");
    }
}

#[test]
fn at_points_it_is_that_of_the_worst_and_the_arm_repeats_as_its_noise_says() {
    let (session, found, seen) = solved(Mode::EyeToHand, ArmError::None);
    let reach = reach(&session, &found, &seen).expect("an arm in reach");
    let points = [0, 9].map(|k: usize| Point3::from(seen[k].camera_from_target.translation()));
    let [one, other] = points.map(|point| reach.at_points(&[point]).expect("in reach"));
    let worst = reach.at_points(&points).expect("in reach");
    assert_eq!(worst.as_it_is_95_m, one.as_it_is_95_m.max(other.as_it_is_95_m));
    let nowhere = Point3::new(0.0, 0.0, 50.0);
    assert_eq!(reach.at_points(&[points[0], nowhere]), Some(one), "the arm does not get to the other");
    assert_eq!(reach.at_points(&[nowhere]), None);
    // The camera does not move, so it is the noise of the touch alone: 2.8 σ of a 3-D vector, with 0.1 m of tool.
    let noise = found.joint.as_ref().and_then(|joint| joint.arm.as_ref()).expect("an arm").noise;
    let sigma_m = noise.robot_m.hypot(noise.robot_rad * USUAL_TOOL_M);
    let repeatability_95_m = one.repeatability_95_m.expect("by its noise");
    let times = repeatability_95_m / sigma_m;
    assert!((2.0..3.5).contains(&times), "{one:?} {sigma_m}");
    assert!(repeatability_95_m <= one.as_it_is_least_95_m && one.as_it_is_least_95_m < one.as_it_is_95_m, "{one:?}");
}

#[test]
fn with_a_camera_on_the_arm_a_point_of_the_camera_is_in_many_places() {
    let (session, found, seen) = solved(Mode::EyeInHand, ArmError::None);
    let reach = reach(&session, &found, &seen).expect("an arm in reach");
    assert_eq!(reach.at_points(&[Point3::from(seen[0].camera_from_target.translation())]), None);
}

#[test]
fn the_weight_says_how_far_small_errors_move_a_touch() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (session, found, seen) = solved(mode, ArmError::None);
        let reach = reach(&session, &found, &seen).expect("an arm in reach");
        let weight = reach.weight(None).expect("in reach");
        let arm = reach.repeated[0].errors.number_count();
        // Half a millimetre here, some hundredths of a degree there.
        let step = DVector::from_fn(6 + arm, |k, _| 3e-4 * (1.3 * k as f64 + 1.0).sin());
        let expected_m = (step.transpose() * &weight * &step)[(0, 0)].sqrt();
        let mut truth = Possible { unexplained: Unexplained::nothing(), ..reach.repeated[0].clone() };
        truth.errors.numbers_mut().zip(step.rows(6, arm).iter()).for_each(|(value, step)| *value += step);
        let mount = truth.hand_eye.mount_from_camera().perturbed(&step.fixed_rows::<6>(0).into_owned());
        truth.hand_eye = HandEye::new(mode, mount, truth.hand_eye.anchor_from_target());
        let target = session.target.points();
        let planned = planned(reach.views.len(), |view, random| {
            reach.views[view].camera_from_target.isometry() * target[random.below(target.len())]
        });
        let way = &reach.corrected;
        let planned: Vec<Plan> = planned.into_iter().step_by(APART).collect();
        let touches = reach.touches(way, &planned).expect("in reach");
        let pivots = way.pivots(&touches[0], &reach.turns, &reach.views, &reach.tool);
        let tool = way.tool_by(&pivots, &touches, &truth, &reach.tool).expect("a tool");
        let squares: f64 =
            touches.iter().map(|touch| Way::miss(touch, &truth, &reach.tool, &tool).norm_squared()).sum();
        let moved_m = (squares / touches.len() as f64).sqrt();
        assert!((moved_m / expected_m - 1.0).abs() < 0.02, "{mode:?}: {moved_m} m, by the weight {expected_m} m");
        assert!(moved_m > 1e-4, "{moved_m}");
    }
}

#[test]
fn touches_out_of_reach_are_no_error_that_is_known() {
    let (session, found, mut seen) = solved(Mode::EyeInHand, ArmError::None);
    for view in &mut seen {
        view.camera_from_target = Pose::from_isometry(Isometry3::translation(0.0, 0.0, 9.0));
    }
    assert_eq!(stated(&session, &found, &seen), None);
    assert_eq!(stated(&session, &found, &[]), None);
}
