use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::Noise;
use crate::test_sessions::Estimated as _;
use handeye_geometry::targets::bent::BoardPoints;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

/// A robot whose errors change by 2 mm and 0.2° over the session.
const FIELD: Noise = Noise { field_m: 2e-3, field_rad: 0.2 * std::f64::consts::PI / 180.0, ..REALISTIC };

fn of_session(session: &Session, board: &BoardPoints) -> (JointSolution, Option<JointSolution>) {
    let cancel = CancelToken::default();
    let problem = JointProblem { board, ..session.problem(false, None) };
    let without = fit(&problem, &session.start(), &cancel).expect("solves");
    let with = with_shown_field(&problem, &session.views, &without, &cancel).expect("not cancelled");
    (without, with)
}

#[test]
fn a_robot_whose_errors_depend_on_the_place_is_calibrated_better_with_its_field_and_its_error_is_stated() {
    for (mode, seed) in [(Mode::EyeInHand, 4100), (Mode::EyeToHand, 4200)] {
        let trials = 30;
        let (mut shown, mut mahalanobis, mut squares) = (0, 0.0, [0.0; 2]);
        for k in 0..trials {
            let session = trial(mode, 20, &FIELD, camera(), seed + k);
            let (without, Some(with)) = of_session(&session, &session.board) else { continue };
            shown += 1;
            let error = session.hand_eye_error(&with);
            mahalanobis += error.dot(&(with.hand_eye_covariance().try_inverse().expect("regular") * error));
            squares[0] += session.hand_eye_error(&without).fixed_rows::<3>(0).norm_squared();
            squares[1] += error.fixed_rows::<3>(0).norm_squared();
        }
        let (mean, gain) = (mahalanobis / shown as f64, (squares[0] / squares[1]).sqrt());
        println!(
            "{mode:?}: shown in {shown} of {trials}, mean squared Mahalanobis distance {mean:.2} of 6, error {gain:.1} times smaller"
        );
        assert_eq!(shown, trials, "{mode:?}");
        // With a true covariance it is 6, and the mean of 30 scatters by sqrt(12 / 30) = 0.63.
        assert!((4.1..9.0).contains(&mean), "{mode:?}: {mean}");
        assert!(gain > 3.0, "{mode:?}: {gain}");
    }
}

#[test]
fn a_healthy_session_has_no_field() {
    // One in a hundred by chance: more than five of a hundred come about in one run of two thousand.
    let shown = (0..100)
        .filter(|k| {
            let session = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 4300 + k);
            of_session(&session, &session.board).1.is_some()
        })
        .count();
    println!("a field in {shown} of 100 healthy sessions");
    assert!(shown <= 5, "{shown}");
}

#[test]
fn a_target_of_another_size_is_no_field() {
    let shown = (0..20)
        .filter(|k| {
            let session = trial(Mode::EyeInHand, 15, &REALISTIC, camera(), 4400 + k);
            let larger: Vec<_> = session.points.iter().map(|p| p * 1.03).collect();
            of_session(&session, &BoardPoints::new(&larger)).1.is_some()
        })
        .count();
    assert_eq!(shown, 0);
}

#[test]
fn few_views_show_no_field() {
    let session = trial(Mode::EyeInHand, 9, &FIELD, camera(), 4500);
    assert!(of_session(&session, &session.board).1.is_none());
}
