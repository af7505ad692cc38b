use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::with_stated_error;
use crate::test_sessions::Estimated as _;
use handeye_geometry::se3;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

/// A session of a lens that follows its model except for waves of this many pixels.
fn session(views: usize, waves_px: f64, seed: u64) -> Session {
    let mut session = trial(Mode::EyeInHand, views, &REALISTIC, camera(), seed);
    session.add_waves(waves_px, 300.0);
    session
}

fn without(session: &Session) -> JointSolution {
    fit(&session.problem(true, None), &session.start(), &CancelToken::default()).expect("solves")
}

fn shown(session: &Session, without: &JointSolution) -> Option<(ShownDistortion, JointSolution)> {
    with_shown_distortion(&session.problem(true, None), without, &CancelToken::default()).expect("not cancelled")
}

#[test]
fn a_lens_beyond_its_model_is_seen_and_what_it_does_to_the_answer_is_counted() {
    let trials = 20;
    let (mut found, mut mahalanobis, mut plain) = (0, 0.0, 0.0);
    let distance = |session: &Session, solution: &JointSolution| {
        let error = session.hand_eye_error(solution);
        error.dot(&(solution.hand_eye_covariance().try_inverse().expect("regular") * error))
    };
    for k in 0..trials {
        let session = session(40, 0.1, 6100 + k);
        let cancel = CancelToken::default();
        let problem = session.problem(true, None);
        let without = without(&session);
        plain += distance(&session, &with_stated_error(&problem, without.clone(), &cancel).expect("solves"));
        let Some((distortion, solution)) = shown(&session, &without) else { continue };
        found += 1;
        let views = corrected(&session.views, &distortion.field);
        let problem = JointProblem { views: &views, ..problem };
        let solution = with_stated_error(&problem, solution, &cancel).expect("solves");
        let solution = with_its_error(&problem, solution, &distortion, &cancel).expect("solves");
        mahalanobis += distance(&session, &solution);
        // 5,600 residuals determine the noise to one percent.
        assert!((solution.noise.corner_px / 0.1 - 1.0).abs() < 0.05, "{:?}", solution.noise);
    }
    let (mean, plain) = (mahalanobis / found as f64, plain / trials as f64);
    println!("seen in {found} of {trials}, mean squared Mahalanobis distance {mean:.2} of 6, without {plain:.1}");
    assert_eq!(found, trials);
    // With a true covariance it is 6 or less; 20 of them scatter by sqrt(12 / 20) = 0.8. The waves are the same in all.
    assert!(mean < 8.5, "{mean}");
    assert!(plain > 12.0, "{plain}");
}

#[test]
fn a_lens_of_its_model_shows_nothing() {
    // At most one in a hundred by chance: more than five of a hundred come about in one run of two thousand.
    let found = (0..100).filter(|k| {
        let session = session(12, 0.0, 6300 + k);
        shown(&session, &without(&session)).is_some()
    });
    let found = found.count();
    println!("residual distortion in {found} of 100 sessions whose lens is of its model");
    assert!(found <= 5, "{found}");
}

#[test]
fn a_given_lens_is_taken_as_it_is() {
    let session = session(20, 0.3, 6500);
    let problem = session.problem(false, None);
    let cancel = CancelToken::default();
    let without = fit(&problem, &session.start(), &cancel).expect("solves");
    assert!(with_shown_distortion(&problem, &without, &cancel).expect("not cancelled").is_none());
}

#[test]
fn the_answer_follows_a_small_field_as_the_equations_say() {
    let session = session(15, 0.0, 6600);
    let cancel = CancelToken::default();
    let free = without(&session);
    let noise = free.noise;
    let problem = session.problem(true, Some(noise));
    let at = |views: &[View]| {
        let problem = JointProblem { views, ..problem };
        fit(&problem, &free.as_start(), &cancel).expect("solves")
    };
    let before = at(&session.views);
    let information = before.hand_eye_covariance().try_inverse().expect("regular");
    let equations =
        Equations::new(&problem, &before, Effect::Distortion(3), &cancel).expect("solves").expect("enough residuals");
    let size = (camera().width, camera().height);
    for k in [1, 4, 9, 11, 15, 19] {
        let mut coefficients = nalgebra::DVector::zeros(20);
        coefficients[k] = 1e-2;
        let field = ResidualDistortion::new(size, 3, coefficients.as_slice().to_vec());
        let after = at(&corrected(&session.views, &field));
        let moved = |solution: &JointSolution| solution.hand_eye.mount_from_camera();
        let moved = se3::log((moved(&before).inverse() * moved(&after)).isometry());
        let expected: nalgebra::Vector6<f64> = -(&equations.follow * &coefficients).fixed_rows::<6>(0);
        // In standard deviations: what the lens absorbs leaves a change of second order.
        let length = |way: nalgebra::Vector6<f64>| way.dot(&(information * way)).sqrt();
        let (off, far) = (length(moved - expected), length(expected));
        assert!(off < 0.02 * far + 1e-3, "{k}: off by {off} of {far} standard deviations");
        // The cost falls by as much as follows from the gradient and the information.
        let half =
            coefficients.dot(&(&equations.information * &coefficients)) - 2.0 * coefficients.dot(&equations.pull);
        let cost = |solution: &JointSolution, views: &[View]| {
            let problem = JointProblem { views, ..problem };
            let state = crate::handeye::joint::state::State::of(solution);
            let system = crate::handeye::joint::normal::System::new(&problem, &state, &cancel);
            system.expect("solves").cost(&noise)
        };
        let rise = cost(&after, &corrected(&session.views, &field)) - cost(&before, &session.views);
        assert!((rise - half).abs() < 0.02 * half.abs().max(1e-6), "{k}: {rise} {half}");
    }
}
