//! Numbers of the pane that the result does not hold itself.

use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::SmallSample;
use handeye_estimate::stated_uncertainty::StatedUncertainty;
use handeye_geometry::frames::{Camera, Mount, Pose};
use handeye_geometry::point_error;
use handeye_geometry::se3;
use nalgebra::{Cholesky, Matrix3, Matrix6, Vector3};

use handeye_workbench::model::{Model, Solved};

/// 95 % quantile of chi-square with six degrees of freedom.
const CHI_SQUARE_6_95: f64 = 12.592;

/// The bound of 95 % of the errors, for every axis separately.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Within95 {
    /// The bound of the translation, along the axes of the parent \[m\].
    pub translation_m: [f64; 3],
    /// The bound of the rotation, about the axes of the child \[rad\].
    pub rotation_rad: [f64; 3],
}

impl Within95 {
    /// From the covariance of `[t; r]` in `T * exp(delta)`, whose translation is along the axes of the child, and the
    /// distribution of the error, as in the headline: with few views the noise levels are poorly known.
    pub fn new(mount_from_camera: &Pose<Mount, Camera>, covariance: &Matrix6<f64>, law: SmallSample) -> Self {
        let rotation = mount_from_camera.rotation().to_rotation_matrix().into_inner();
        let translation = rotation * covariance.fixed_view::<3, 3>(0, 0) * rotation.transpose();
        // 1.96 standard deviations when the levels are known, and more the fewer degrees of freedom they have.
        let one_axis = Matrix3::from_diagonal(&Vector3::new(1.0 / law.scale, 0.0, 0.0));
        let sigmas = point_error::radius_95_t(&one_axis, law.degrees_of_freedom);
        let within = |variance: f64| sigmas * variance.max(0.0).sqrt();
        Self {
            translation_m: std::array::from_fn(|i| within(translation[(i, i)])),
            rotation_rad: std::array::from_fn(|i| within(covariance[(3 + i, 3 + i)])),
        }
    }
}

/// An answer compared with the true place of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AgainstTruth {
    /// The error of a point where the board was seen \[m\].
    pub at_board_m: Option<f64>,
    /// Whether the whole transform is within its stated 95 %; `None` when it states none.
    pub is_within: Option<bool>,
}

/// Compares with the truth; `None` if it is not known.
pub fn against_truth(model: &Model, solved: &Solved) -> Option<AgainstTruth> {
    let hand_eye = solved.calibration.hand_eye?;
    let truth = true_mount_from_camera(model, hand_eye.mode())?;
    let found = hand_eye.mount_from_camera();
    let at_board_m = solved.calibration.joint.as_ref().map(|joint| {
        let point = joint.reference_point;
        (found.isometry().transform_point(&point) - truth.isometry().transform_point(&point)).norm()
    });
    let stated = solved
        .calibration
        .link_covariances()
        .filter(|_| *solved.calibration.stated_uncertainty() == StatedUncertainty::AsModelled);
    let is_within = stated.and_then(|covariances| {
        let error = se3::log((found.inverse() * truth).isometry());
        let weighted = Cholesky::new(covariances.hand_eye)?.solve(&error);
        Some(error.dot(&weighted) <= CHI_SQUARE_6_95)
    });
    Some(AgainstTruth { at_board_m, is_within })
}

/// The truth of the session, which may be of another cell than the connected one.
fn true_mount_from_camera(model: &Model, mode: Mode) -> Option<Pose<Mount, Camera>> {
    let recorded = model.document().meta.ground_truth.as_ref().and_then(|truth| truth.links(mode));
    if let Some(links) = recorded {
        return Some(links.mount_from_camera());
    }
    let truth = model.cell.as_ref()?.truth.as_ref()?;
    (mode == Mode::EyeInHand).then(|| truth.tip_from_camera.relabel())
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::testing::sample;

    #[test]
    fn the_uncertainty_of_a_translation_is_along_the_axes_of_the_mount() {
        // The camera is turned by a quarter about z: its x is the y of the mount.
        let quarter = std::f64::consts::FRAC_PI_4;
        let pose = Pose::from_translation_xyzw([0.0; 3], [0.0, 0.0, quarter.sin(), quarter.cos()]);
        let mut covariance = Matrix6::zeros();
        covariance[(0, 0)] = 4e-6;
        covariance[(5, 5)] = 1e-6;
        let within = Within95::new(&pose, &covariance, SmallSample::KNOWN);
        let expected = [0.0, 1.96 * 2e-3, 0.0];
        assert!((0..3).all(|i| (within.translation_m[i] - expected[i]).abs() < 1e-6), "{within:?}");
        assert!((within.rotation_rad[2] - 1.96e-3).abs() < 1e-6 && within.rotation_rad[0] == 0.0);
        // Student's t with ten degrees of freedom.
        let few = Within95::new(&pose, &covariance, SmallSample { degrees_of_freedom: 10.0, ..SmallSample::KNOWN });
        assert!((few.translation_m[1] - 2.228 * 2e-3).abs() < 5e-6, "{few:?}");
    }

    #[test]
    fn a_wrong_answer_is_outside_what_it_states_and_a_right_one_is_not() {
        let model = sample::solved();
        let solved = model.solve.current().expect("solved");
        let right = against_truth(&model, solved).expect("the truth is known");
        assert_eq!(right.is_within, Some(true), "{right:?}");
        let mut elsewhere = model.clone();
        let shift = Pose::from_translation_xyzw([0.0, 0.0, 0.01], [0.0, 0.0, 0.0, 1.0]);
        if let Some(truth) = elsewhere.cell.as_mut().and_then(|cell| cell.truth.as_mut()) {
            truth.tip_from_camera = truth.tip_from_camera * shift;
        }
        let wrong = against_truth(&elsewhere, solved).expect("the truth is known");
        assert_eq!(wrong.is_within, Some(false));
        let off_m = wrong.at_board_m.expect("a joint estimate has a reference point");
        assert!((off_m - 0.01).abs() < 1e-3, "{off_m} m: the camera was moved by 10 mm");
    }
}
