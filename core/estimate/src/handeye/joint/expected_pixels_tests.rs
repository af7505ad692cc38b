use nalgebra::{DMatrix, Point3, Vector6};

use crate::handeye::joint::{Noise, ViewModel};
use crate::handeye::{HandEye, Mode};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::testing::BOARD;
use handeye_simulate::session::{REALISTIC, camera, trial};

/// Where a model puts a point of the board in a view.
fn pixel(model: &ViewModel, base_from_tip: &Pose<Base, Tip>, point: &Point3<f64>) -> nalgebra::Vector2<f64> {
    let seen = model.camera_from_target(&(*base_from_tip).into()).isometry() * point;
    model.intrinsics().project(&seen).expect("in front of the camera")
}

/// The standard deviation that one unknown alone gives a pixel is how far the pixel moves with it.
#[test]
fn a_pixel_is_as_unsure_as_it_moves_with_what_is_unsure() {
    const SIGMA: f64 = 1e-5;
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let trial = trial(mode, 4, &REALISTIC, camera(), 3);
        let (mount, anchor) = (trial.mount_from_camera, trial.anchor_from_target);
        let model = |links: &HandEye, lens: &Intrinsics| ViewModel::known(*links, *lens, true, Noise::EXACT, &BOARD);
        let links = HandEye::new(mode, mount, anchor);
        let truth = model(&links, &trial.intrinsics);
        let (base_from_tip, point) = (trial.views[1].base_from_tip, BOARD.points()[7]);
        for unknown in 0..truth.unknowns() {
            let mut covariance = DMatrix::zeros(truth.unknowns(), truth.unknowns());
            covariance[(unknown, unknown)] = SIGMA * SIGMA;
            let (px, sigma_px) = truth.pixels(&base_from_tip.into(), &covariance).of(&point).expect("in view");

            let mut step = Vector6::zeros();
            let moved = match unknown {
                0..6 => {
                    step[unknown] = SIGMA;
                    model(&HandEye::new(mode, mount.perturbed(&step), anchor), &trial.intrinsics)
                }
                6..12 => {
                    step[unknown - 6] = SIGMA;
                    model(&HandEye::new(mode, mount, anchor.perturbed(&step)), &trial.intrinsics)
                }
                _ => {
                    let mut parameters = trial.intrinsics.parameters();
                    parameters[unknown - 12] += SIGMA;
                    model(&links, &trial.intrinsics.with_parameters(&parameters))
                }
            };
            let way = (pixel(&moved, &base_from_tip, &point) - px).abs();
            assert!((way - sigma_px).norm() < 1e-3 * way.norm().max(1e-9), "{mode:?} {unknown}: {way} {sigma_px}");
        }
    }
}

/// Links and lens together: errors that small turns cannot separate compensate each other in views like those taken.
#[test]
fn a_view_like_those_taken_is_surer_than_links_and_lens_are_by_themselves() {
    let trial = trial(Mode::EyeInHand, 6, &REALISTIC, camera(), 3);
    let links = HandEye::new(trial.mode, trial.mount_from_camera, trial.anchor_from_target);
    let model = ViewModel::known(links, trial.intrinsics, true, REALISTIC, &BOARD);
    let all: Vec<usize> = (0..BOARD.len()).collect();
    let of_view = |view: &handeye_geometry::targets::observation::View| {
        model.expected(&view.base_from_tip.into(), &all).expect("it determines a pose").information()
    };
    let information = trial.views.iter().map(of_view).fold(model.prior(), |sum, view| sum + view);
    let covariance = information.try_inverse().expect("six views");
    let apart = DMatrix::from_diagonal(&covariance.diagonal());
    let sigma_px = |covariance: &DMatrix<f64>| {
        let pixels = model.pixels(&trial.views[2].base_from_tip.into(), covariance);
        pixels.of(&BOARD.points()[0]).expect("in view").1.norm()
    };
    // The robot's 0.1 mm and 0.02° are 0.3 px of it.
    let (together, apart) = (sigma_px(&covariance), sigma_px(&apart));
    assert!(together < 1.0, "{together} px");
    assert!(apart > 2.0 * together, "{apart} px, {together} px");
}
