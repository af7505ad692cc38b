use super::*;
use crate::handeye::joint::normal::System;
use crate::handeye::joint::state::State;
use crate::handeye::joint::{JointProblem, JointStart, estimate};
use crate::test_sessions::Estimated as _;
use crate::{Method, fit};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::testing::BOARD;
use handeye_simulate::session::{ArmError, REALISTIC, Setup, add_field, camera, session, trial};

/// The state of the estimator at the model.
fn state_of(model: &ViewModel, problem: &JointProblem<'_>) -> State {
    let start = JointStart {
        mount_from_camera: model.hand_eye.mount_from_camera(),
        anchor_from_target: model.hand_eye.anchor_from_target(),
        intrinsics: model.intrinsics,
        shape: model.shape,
        noise: None,
    };
    State { field: model.field.clone(), arm: model.arm.clone(), ..State::new(problem, &start) }
}

/// The information of views by the rows is that of the estimator's own equations, view by view.
#[test]
fn what_views_are_expected_to_say_is_what_the_estimator_takes_from_them() {
    for (mode, lens_free, field) in [
        (Mode::EyeInHand, false, false),
        (Mode::EyeInHand, true, false),
        (Mode::EyeToHand, true, false),
        (Mode::EyeInHand, false, true),
    ] {
        let mut trial = trial(mode, 24, &REALISTIC, camera(), 5);
        if field {
            let noise = Noise { field_m: 2e-3, field_rad: 1e-3, ..REALISTIC };
            add_field(&mut rand_of(7), &noise, &mut trial.views);
        }
        let observations = trial.observations(lens_free);
        let calibration = fit(&observations, Method::Joint, &CancelToken::default()).expect("a good session");
        let model = ViewModel::new(&calibration, &BOARD).expect("a joint estimate");
        assert_eq!(model.field.is_some(), field, "the data show the field");

        // The same views in the estimator, at the estimate and without stated weights of the corners.
        let problem = JointProblem {
            free: model.free,
            noise: Some(*model.noise()),
            ..JointProblem::new(mode, &trial.board, &trial.views)
        };
        let state = state_of(&model, &problem);
        let system = System::new(&problem, &state, &CancelToken::default()).expect("in front of the camera");
        for (view, block) in trial.views.iter().zip(&system.blocks) {
            let (expected, _) = block.information(model.noise(), &Vector6::zeros()).expect("it determines a pose");
            let corners: Vec<usize> = view.corners.iter().map(|corner| corner.index).collect();
            let got = model.expected(&view.base_from_tip.into(), &corners).expect("it determines a pose").information();
            let scale = DMatrix::from_fn(got.nrows(), got.ncols(), |i, j| {
                (expected[(i, i)] * expected[(j, j)]).sqrt().max(f64::MIN_POSITIVE)
            });
            let off = (got - expected).component_div(&scale).amax();
            assert!(off < 1e-7, "{mode:?} {lens_free} {field}: {off}");
        }
    }
}

/// The same with the errors of an arm among the unknowns.
#[test]
fn what_views_say_of_an_arm_is_what_the_estimator_takes_from_them() {
    for (mode, lens_free) in [(Mode::EyeInHand, true), (Mode::EyeToHand, false)] {
        let arm_error = ArmError::Links([[2e-4, -3e-4, 1e-3, 1.5e-3]; 6]);
        let session = session(&Setup { joints: true, arm_error, ..Setup::new(mode, 16, 8) });
        let cancel = CancelToken::default();
        let calibration = fit(&session.observations(lens_free), Method::Joint, &cancel).expect("a good session");
        let model = ViewModel::of_arm(&calibration, &BOARD).expect("its joints are known");
        assert_eq!(model.unknowns(), model.prior().nrows());
        let board = BoardPoints::new(&BOARD.points());
        let known = JointProblem {
            free: model.free,
            noise: Some(*model.noise()),
            ..JointProblem::new(mode, &board, &session.views)
        };
        let state = state_of(&model, &known);
        let system = System::new(&known, &state, &cancel).expect("in front of the camera");
        for (view, block) in session.views.iter().zip(&system.blocks) {
            let (expected, _) = block.information(model.noise(), &Vector6::zeros()).expect("it determines a pose");
            let posture = Posture { base_from_tip: view.base_from_tip, tip_from_joints: view.tip_from_joints.clone() };
            let corners: Vec<usize> = view.corners.iter().map(|corner| corner.index).collect();
            let got = model.expected(&posture, &corners).expect("it determines a pose").information();
            let scale = expected.diagonal().map(|of| of.sqrt().max(f64::MIN_POSITIVE));
            let off = (got - expected).component_div(&(&scale * scale.transpose())).amax();
            assert!(off < 1e-6, "{mode:?} {lens_free}: {off}");
        }
    }
}

/// Noise levels and covariance of a calibration of known noise follow from its views alone.
#[test]
fn the_information_of_all_views_gives_the_covariance_of_the_estimate() {
    let trial = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 3);
    let problem = JointProblem { noise: Some(REALISTIC), ..JointProblem::new(trial.mode, &trial.board, &trial.views) };
    let solution = estimate(&problem, &trial.start(), &CancelToken::default()).expect("a good session");
    let observations = trial.observations(false);
    let calibration = fit(&observations, Method::Joint, &CancelToken::default()).expect("a good session");
    let model = ViewModel::new(&calibration, &BOARD).expect("a joint estimate").with_noise(REALISTIC);
    let all: Vec<usize> = (0..BOARD.len()).collect();
    let information: DMatrix<f64> = trial
        .views
        .iter()
        .map(|view| model.expected(&view.base_from_tip.into(), &all).expect("it determines a pose").information())
        .fold(model.prior(), |sum, of_view| sum + of_view);
    let covariance = information.try_inverse().expect("twelve views");
    for i in 0..12 {
        let ratio = covariance[(i, i)] / solution.covariance[(i, i)];
        assert!((ratio - 1.0).abs() < 0.02, "unknown {i}: {ratio}");
    }
}

fn rand_of(seed: u64) -> rand_chacha::ChaCha8Rng {
    rand::SeedableRng::seed_from_u64(seed)
}
