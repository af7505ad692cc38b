use nalgebra::{DMatrix, Matrix2};

use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::{CornerWeights, estimate};
use crate::test_sessions::Estimated as _;
use handeye_geometry::targets::corner_covariance::CornerCovariance;
use handeye_geometry::targets::observation::{Corners, View};
use handeye_simulate::session::{REALISTIC, camera, trial};

/// Corners of which one in three is twice as good along a direction, the same in every view.
fn covariance_px2(corner: usize) -> Matrix2<f64> {
    if corner.is_multiple_of(3) { Matrix2::new(0.01, 0.004, 0.004, 0.02) } else { Matrix2::identity() * 0.04 }
}

/// Where corners share no noise their joint covariance is equivalent to those of single corners: in the answer and in the
/// equations of every effect.
#[test]
fn corners_that_share_nothing_count_together_as_each_for_itself() {
    let cancel = CancelToken::default();
    let session = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 7);
    let stated = |together: bool| -> Vec<View> {
        let of = |view: &View| {
            let corner = |corner: &Corner| Corner { covariance_px2: Some(covariance_px2(corner.index)), ..*corner };
            let corners: Vec<Corner> = view.corners.iter().map(corner).collect();
            let mut all = DMatrix::zeros(2 * corners.len(), 2 * corners.len());
            for (i, corner) in corners.iter().enumerate() {
                all.fixed_view_mut::<2, 2>(2 * i, 2 * i).copy_from(&covariance_px2(corner.index));
            }
            let corners =
                if together { Corners::together(corners, CornerCovariance::new(&all)) } else { corners.into() };
            View { corners, ..view.clone() }
        };
        session.views.iter().map(of).collect()
    };
    let solved = |views: &[View]| {
        let weights = CornerWeights::stated(views.iter().flat_map(|view| view.corners.iter()));
        let problem = JointProblem { views, weights, ..session.problem(true, None) };
        let solution = estimate(&problem, &session.start(), &cancel).expect("solves");
        let equations = [Effect::Distortion(3), Effect::Print].map(|effect| {
            Equations::new(&problem, &solution, effect, &cancel).expect("not cancelled").expect("enough residuals")
        });
        let (system, state) = (solution.linearised(&problem).expect("linear"), State::of(&solution));
        let effects = [Effect::Print, Effect::Distortion(3)];
        let of_view = |view| score(&problem, &state, system, &solution.noise, &effects, view).expect("a score");
        let scores: Vec<Score> = (0..views.len()).map(of_view).collect();
        (solution, equations, scores)
    };
    let (each, of_each, scores_of_each) = solved(&stated(false));
    let (together, of_together, scores_together) = solved(&stated(true));
    let apart = each.hand_eye.mount_from_camera().inverse() * together.hand_eye.mount_from_camera();
    assert!(apart.translation().norm() < 1e-9, "{apart:?}");
    assert!((each.noise.corner_px / together.noise.corner_px - 1.0).abs() < 1e-6);
    for (a, b) in of_each.iter().zip(&of_together) {
        assert!((&a.information - &b.information).amax() < 1e-5 * a.information.amax());
        assert!(
            (&a.pull - &b.pull).amax() < 1e-5 * a.pull.amax(),
            "{} of {}",
            (&a.pull - &b.pull).amax(),
            a.pull.amax()
        );
    }
    for (a, b) in scores_of_each.iter().zip(&scores_together) {
        assert!((&a.information - &b.information).amax() < 1e-5 * a.information.amax());
        assert!((&a.gradient - &b.gradient).amax() < 1e-5 * a.gradient.amax());
    }
    // The scores of all views add up to the equations of the effect.
    let all = scores_of_each.iter().map(|score| score.information.clone()).reduce(|a, b| a + b).expect("views");
    let pull = -scores_of_each.iter().map(|score| score.gradient.clone()).reduce(|a, b| a + b).expect("views");
    let [distortion, print] = of_each;
    let shared = all.nrows() - print.pull.len() - distortion.pull.len();
    for (at, equations) in [(shared, print), (shared + 2 * session.board.len(), distortion)] {
        let count = equations.pull.len();
        let [of_shared, cross, own] = [(0, shared, 0, shared), (0, shared, at, count), (at, count, at, count)]
            .map(|(row, rows, column, columns)| all.view((row, column), (rows, columns)).into_owned());
        let scale = of_shared.diagonal().map(|value| value.sqrt().recip());
        let scaled = DMatrix::from_fn(shared, shared, |i, j| of_shared[(i, j)] * scale[i] * scale[j]);
        let cross = DMatrix::from_fn(shared, count, |i, j| cross[(i, j)] * scale[i]);
        let follow = scaled.cholesky().expect("determined").solve(&cross);
        let eliminated = own - cross.tr_mul(&follow);
        assert!((&eliminated - &equations.information).amax() < 1e-6 * equations.information.amax());
        let eliminated = pull.rows(at, count) - follow.tr_mul(&pull.rows(0, shared).component_mul(&scale));
        assert!((&eliminated - &equations.pull).amax() < 1e-6 * equations.pull.amax());
    }
}
