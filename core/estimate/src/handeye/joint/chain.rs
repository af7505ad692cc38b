//! The chain of transforms of one view and its derivatives.

use nalgebra::{Isometry3, Matrix6, Matrix6xX, Translation3, UnitQuaternion, Vector6};

use super::arm_errors::ArmErrors;
use crate::handeye::Mode;
use handeye_geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use handeye_geometry::se3;
use handeye_geometry::targets::observation::View;

/// `camera_from_target` of a view from the reported robot pose and the calibration.
pub fn camera_from_target(
    mode: Mode,
    base_from_tip: &Pose<Base, Tip>,
    mount_from_camera: &Pose<Mount, Camera>,
    anchor_from_target: &Pose<Anchor, Target>,
) -> Pose<Camera, Target> {
    mount_from_camera.inverse() * mode.anchor_from_mount(base_from_tip).inverse() * *anchor_from_target
}

/// The correction `E` of a tip pose: translation and rotation vector apart, so that its prior is exactly quadratic.
pub fn correction_transform(correction: &Vector6<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(correction.fixed_rows::<3>(0).into_owned()),
        UnitQuaternion::from_scaled_axis(correction.fixed_rows::<3>(3).into_owned()),
    )
}

/// Right Jacobian of a correction with respect to its own numbers: `E(d + δ) = E(d) exp(J δ)`.
pub(super) fn correction_jacobian(correction: &Vector6<f64>) -> Matrix6<f64> {
    let phi = correction.fixed_rows::<3>(3).into_owned();
    let rotation = correction_transform(correction).rotation.to_rotation_matrix();
    let mut jacobian = Matrix6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation.matrix().transpose());
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&se3::left_jacobian(&-phi));
    jacobian
}

/// `camera_from_target` of one view at the current estimate, and its derivatives with respect to the unknowns:
/// `camera_from_target * exp(xi)` with `xi = by_hand_eye * x + y + by_correction * d + by_arm * q`, where `x` and `y` perturb
/// `mount_from_camera` and `anchor_from_target` on the right, `d` is added to the correction and `q` to the errors of the arm.
#[derive(Debug, Clone)]
pub struct Chain {
    pub camera_from_target: Isometry3<f64>,
    pub by_hand_eye: Matrix6<f64>,
    pub by_correction: Matrix6<f64>,
    /// Derivatives by the errors of the arm; without columns where it has none.
    pub by_arm: Matrix6xX<f64>,
}

impl Chain {
    pub fn new(
        mode: Mode,
        base_from_tip: &Pose<Base, Tip>,
        correction: &Vector6<f64>,
        mount_from_camera: &Pose<Mount, Camera>,
        anchor_from_target: &Pose<Anchor, Target>,
    ) -> Self {
        let view = View::new(String::new(), *base_from_tip, Vec::new());
        Self::with_arm(mode, &view, None, correction, mount_from_camera, anchor_from_target)
    }

    /// The chain with errors of the arm as well.
    pub fn with_arm(
        mode: Mode,
        view: &View,
        arm: Option<&ArmErrors>,
        correction: &Vector6<f64>,
        mount_from_camera: &Pose<Mount, Camera>,
        anchor_from_target: &Pose<Anchor, Target>,
    ) -> Self {
        let e = correction_transform(correction);
        let by_links = arm.map(|arm| arm.of_view(view));
        let links = by_links.as_ref().map_or_else(Isometry3::identity, |tip| tip.reported_from_true);
        let true_pose = Pose::from_isometry(view.base_from_tip.isometry() * links * e);
        let camera_from_target =
            *camera_from_target(mode, &true_pose, mount_from_camera, anchor_from_target).isometry();
        // exp(-x) C = C exp(-Ad(C⁻¹) x)
        let by_hand_eye = -se3::adjoint(&camera_from_target.inverse());
        let target = anchor_from_target.isometry();
        let xi_by_twist = match mode {
            // C = X⁻¹ (H E)⁻¹ Y, and (H E exp(e))⁻¹ Y = (H E)⁻¹ Y exp(-Ad(((H E)⁻¹ Y)⁻¹) e)
            Mode::EyeInHand => -se3::adjoint(&(target.inverse() * true_pose.isometry())),
            // C = X⁻¹ H E Y, and E exp(e) Y = E Y exp(Ad(Y⁻¹) e)
            Mode::EyeToHand => se3::adjoint(&target.inverse()),
        };
        let by_arm = by_links
            .map_or_else(|| Matrix6xX::zeros(0), |tip| xi_by_twist * se3::adjoint(&e.inverse()) * tip.by_errors);
        Self { camera_from_target, by_hand_eye, by_correction: xi_by_twist * correction_jacobian(correction), by_arm }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_finite_differences_in_both_set_ups() {
        const STEP: f64 = 1e-6;
        let pose = |s: f64| se3::exp(&Vector6::new(0.3 * s, -0.2, 0.5, 0.7 * s, -0.4, 0.2 + s));
        let (h, x, y) = (Pose::from_isometry(pose(1.0)), Pose::from_isometry(pose(0.4)), pose(-0.6));
        let y = Pose::from_isometry(y);
        let correction = Vector6::new(0.01, -0.02, 0.005, 0.1, -0.2, 0.15);
        let frames = [0.3, -0.7, 1.1].map(pose).to_vec();
        let view = View { tip_from_joints: frames, ..View::new(String::new(), h, Vec::new()) };
        let mut arm = ArmErrors::none(3);
        arm.numbers_mut().enumerate().for_each(|(k, value)| *value = 0.02 * (k as f64).cos());
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let at = |x: &Pose<Mount, Camera>, y: &Pose<Anchor, Target>, d: &Vector6<f64>, q: &ArmErrors| {
                Chain::with_arm(mode, &view, Some(q), d, x, y)
            };
            let chain = at(&x, &y, &correction, &arm);
            for i in 0..6 {
                let mut step = Vector6::zeros();
                step[i] = STEP;
                let turned = |chain_after: Chain| {
                    se3::log(&(chain.camera_from_target.inverse() * chain_after.camera_from_target)) / STEP
                };
                let by_x = turned(at(&x.perturbed(&step), &y, &correction, &arm));
                assert!((by_x - chain.by_hand_eye.column(i)).norm() < 1e-5, "{mode:?} x{i}");
                let by_y = turned(at(&x, &y.perturbed(&step), &correction, &arm));
                assert!((by_y - Matrix6::identity().column(i)).norm() < 1e-5, "{mode:?} y{i}");
                let by_d = turned(at(&x, &y, &(correction + step), &arm));
                assert!((by_d - chain.by_correction.column(i)).norm() < 1e-5, "{mode:?} d{i}");
            }
            for k in 0..arm.values().len() {
                let mut moved = arm.clone();
                *moved.numbers_mut().nth(k).expect("so many") += STEP;
                let turned = se3::log(
                    &(chain.camera_from_target.inverse() * at(&x, &y, &correction, &moved).camera_from_target),
                ) / STEP;
                assert!((turned - chain.by_arm.column(k)).norm() < 1e-5, "{mode:?} q{k}");
            }
        }
    }
}
