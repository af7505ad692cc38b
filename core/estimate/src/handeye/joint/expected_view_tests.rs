use super::*;
use crate::handeye::joint::normal::System;
use crate::handeye::joint::state::State;
use crate::handeye::joint::{JointProblem, estimate};
use crate::test_sessions::Estimated as _;
use crate::{Method, fit};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::testing::BOARD;
use handeye_simulate::session::{REALISTIC, add_field, camera, trial};

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

        // The same views in the estimator, at the estimate and with nothing said of the corners' weights.
        let problem = JointProblem {
            free: model.free,
            noise: Some(*model.noise()),
            ..JointProblem::new(mode, &trial.board, &trial.views)
        };
        let mut state = State::new(
            &problem,
            &crate::handeye::joint::JointStart {
                mount_from_camera: model.hand_eye.mount_from_camera(),
                anchor_from_target: model.hand_eye.anchor_from_target(),
                intrinsics: model.intrinsics,
                shape: model.shape,
                noise: None,
            },
        );
        state.field.clone_from(&model.field);
        let system = System::new(&problem, &state, &CancelToken::default()).expect("in front of the camera");
        for (view, block) in trial.views.iter().zip(&system.blocks) {
            let (expected, _) = block.information(model.noise(), &Vector6::zeros()).expect("it determines a pose");
            let corners: Vec<usize> = view.corners.iter().map(|corner| corner.index).collect();
            let got = model.expected(&view.base_from_tip, &corners).expect("it determines a pose").information();
            let scale = DMatrix::from_fn(got.nrows(), got.ncols(), |i, j| {
                (expected[(i, i)] * expected[(j, j)]).sqrt().max(f64::MIN_POSITIVE)
            });
            let off = (got - expected).component_div(&scale).amax();
            assert!(off < 1e-7, "{mode:?} {lens_free} {field}: {off}");
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
        .map(|view| model.expected(&view.base_from_tip, &all).expect("it determines a pose").information())
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
