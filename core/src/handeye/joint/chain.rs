//! The chain of transforms of one view and its derivatives.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector6};

use crate::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use crate::handeye::Mode;
use crate::se3;

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

/// `camera_from_target` of one view at the current estimate, and how it turns with the unknowns:
/// `camera_from_target * exp(xi)` with `xi = by_hand_eye * x + y + by_correction * d`, where `x` and `y` perturb
/// `mount_from_camera` and `anchor_from_target` on the right and `d` is added to the correction.
#[derive(Debug, Clone)]
pub struct Chain {
    pub camera_from_target: Isometry3<f64>,
    pub by_hand_eye: Matrix6<f64>,
    pub by_correction: Matrix6<f64>,
}

impl Chain {
    pub fn new(
        mode: Mode,
        base_from_tip: &Pose<Base, Tip>,
        correction: &Vector6<f64>,
        mount_from_camera: &Pose<Mount, Camera>,
        anchor_from_target: &Pose<Anchor, Target>,
    ) -> Self {
        let e = correction_transform(correction);
        let true_pose = Pose::from_isometry(base_from_tip.isometry() * e);
        let camera_from_target =
            *camera_from_target(mode, &true_pose, mount_from_camera, anchor_from_target).isometry();
        // exp(-x) C = C exp(-Ad(C⁻¹) x)
        let by_hand_eye = -se3::adjoint(&camera_from_target.inverse());
        // Adding d to the correction turns E by the twist `twist_by_d * d` on its right.
        let mut twist_by_d = Matrix6::zeros();
        let phi = correction.fixed_rows::<3>(3).into_owned();
        let rotation = e.rotation.to_rotation_matrix();
        twist_by_d.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation.matrix().transpose());
        twist_by_d.fixed_view_mut::<3, 3>(3, 3).copy_from(&se3::left_jacobian(&-phi));
        let target = anchor_from_target.isometry();
        let xi_by_twist = match mode {
            // C = X⁻¹ (H E)⁻¹ Y, and (H E exp(e))⁻¹ Y = (H E)⁻¹ Y exp(-Ad(((H E)⁻¹ Y)⁻¹) e)
            Mode::EyeInHand => -se3::adjoint(&(target.inverse() * true_pose.isometry())),
            // C = X⁻¹ H E Y, and E exp(e) Y = E Y exp(Ad(Y⁻¹) e)
            Mode::EyeToHand => se3::adjoint(&target.inverse()),
        };
        Self { camera_from_target, by_hand_eye, by_correction: xi_by_twist * twist_by_d }
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
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let chain = Chain::new(mode, &h, &correction, &x, &y);
            for i in 0..6 {
                let mut step = Vector6::zeros();
                step[i] = STEP;
                let turned = |chain_after: Chain| {
                    se3::log(&(chain.camera_from_target.inverse() * chain_after.camera_from_target)) / STEP
                };
                let by_x = turned(Chain::new(mode, &h, &correction, &x.perturbed(&step), &y));
                assert!((by_x - chain.by_hand_eye.column(i)).norm() < 1e-5, "{mode:?} x{i}");
                let by_y = turned(Chain::new(mode, &h, &correction, &x, &y.perturbed(&step)));
                assert!((by_y - Matrix6::identity().column(i)).norm() < 1e-5, "{mode:?} y{i}");
                let by_d = turned(Chain::new(mode, &h, &(correction + step), &x, &y));
                assert!((by_d - chain.by_correction.column(i)).norm() < 1e-5, "{mode:?} d{i}");
            }
        }
    }
}
