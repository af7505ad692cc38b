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
    let fit = found.joint.as_ref()?.arm.as_ref()?;
    let arm = CorrectedArm::new(ArmKind::Ur5.arm(), fit)?;
    reach_errors(&arm, fit, found.hand_eye.as_ref()?, seen, &session.target, &(Vector3::z() * USUAL_TOOL_M))
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
        assert!(off.corrected_95_m < off.as_it_is_95_m, "{mode:?}: {off:?}");
        assert!(exact.as_it_is_95_m < 0.5 * off.as_it_is_95_m, "{mode:?}: {exact:?}");
        assert_eq!(stated(&session, &found, &seen), Some(exact), "the same in every run");
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
