//! The chain of transforms of one view and its derivatives.

use nalgebra::{Isometry3, Matrix6, SMatrix, Translation3, UnitQuaternion, Vector6};

use crate::handeye::Mode;
use handeye_geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use handeye_geometry::se3;
use handeye_geometry::targets::observation::View;

/// Most joints of an arm.
pub const MAX_JOINTS: usize = 7;

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

/// What the offsets of the joints do to the tip of a view: a twist on the right of the reported pose.
fn joint_twist(view: &View, offsets_rad: &[f64]) -> Vector6<f64> {
    view.tip_by_joint.iter().zip(offsets_rad).map(|(twist, offset)| twist * *offset).sum()
}

/// The reported tip pose with the offsets of the joints taken out.
pub fn base_from_tip_by_joints(view: &View, offsets_rad: &[f64]) -> Pose<Base, Tip> {
    if offsets_rad.is_empty() {
        return view.base_from_tip;
    }
    view.base_from_tip.perturbed(&joint_twist(view, offsets_rad))
}

/// `camera_from_target` of one view at the current estimate, and how it turns with the unknowns:
/// `camera_from_target * exp(xi)` with `xi = by_hand_eye * x + y + by_correction * d + by_joints * q`, where `x` and `y`
/// perturb `mount_from_camera` and `anchor_from_target` on the right, `d` is added to the correction and `q` to the
/// offsets of the joints.
#[derive(Debug, Clone)]
pub struct Chain {
    pub camera_from_target: Isometry3<f64>,
    pub by_hand_eye: Matrix6<f64>,
    pub by_correction: Matrix6<f64>,
    /// Columns beyond the number of joints are zero.
    pub by_joints: SMatrix<f64, 6, MAX_JOINTS>,
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
        Self::with_joints(mode, &view, &[], correction, mount_from_camera, anchor_from_target)
    }

    /// With offsets of the joints as well; there are none where `offsets_rad` is empty.
    pub fn with_joints(
        mode: Mode,
        view: &View,
        offsets_rad: &[f64],
        correction: &Vector6<f64>,
        mount_from_camera: &Pose<Mount, Camera>,
        anchor_from_target: &Pose<Anchor, Target>,
    ) -> Self {
        let e = correction_transform(correction);
        let true_pose = Pose::from_isometry(base_from_tip_by_joints(view, offsets_rad).isometry() * e);
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
        let mut by_joints = SMatrix::<f64, 6, MAX_JOINTS>::zeros();
        if !offsets_rad.is_empty() {
            // exp(t) E turns by Ad(E⁻¹) Jr(t) dt, and Jr(t) = I − ad(t) / 2 to second order in a twist of milliradians.
            let through = xi_by_twist
                * se3::adjoint(&e.inverse())
                * (Matrix6::identity() - small_adjoint(&joint_twist(view, offsets_rad)) * 0.5);
            for (j, twist) in view.tip_by_joint.iter().take(offsets_rad.len()).enumerate() {
                by_joints.set_column(j, &(through * twist));
            }
        }
        Self { camera_from_target, by_hand_eye, by_correction: xi_by_twist * twist_by_d, by_joints }
    }
}

/// `ad(t)`, with `ad(t) s` the Lie bracket of two twists.
fn small_adjoint(twist: &Vector6<f64>) -> Matrix6<f64> {
    let mut m = Matrix6::zeros();
    let turn = se3::skew(&twist.fixed_rows::<3>(3).into_owned());
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&se3::skew(&twist.fixed_rows::<3>(0).into_owned()));
    m
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
        let twists = vec![Vector6::new(0.1, 0.2, -0.3, 0.0, 0.6, 0.8), Vector6::new(-0.4, 0.1, 0.2, 1.0, 0.0, 0.0)];
        let view = View { tip_by_joint: twists, ..View::new(String::new(), h, Vec::new()) };
        let offsets = [2e-3, -3e-3];
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let at = |x: &Pose<Mount, Camera>, y: &Pose<Anchor, Target>, d: &Vector6<f64>, q: &[f64]| {
                Chain::with_joints(mode, &view, q, d, x, y)
            };
            let chain = at(&x, &y, &correction, &offsets);
            for i in 0..6 {
                let mut step = Vector6::zeros();
                step[i] = STEP;
                let turned = |chain_after: Chain| {
                    se3::log(&(chain.camera_from_target.inverse() * chain_after.camera_from_target)) / STEP
                };
                let by_x = turned(at(&x.perturbed(&step), &y, &correction, &offsets));
                assert!((by_x - chain.by_hand_eye.column(i)).norm() < 1e-5, "{mode:?} x{i}");
                let by_y = turned(at(&x, &y.perturbed(&step), &correction, &offsets));
                assert!((by_y - Matrix6::identity().column(i)).norm() < 1e-5, "{mode:?} y{i}");
                let by_d = turned(at(&x, &y, &(correction + step), &offsets));
                assert!((by_d - chain.by_correction.column(i)).norm() < 1e-5, "{mode:?} d{i}");
                if i < 2 {
                    let mut moved = offsets;
                    moved[i] += STEP;
                    let by_q = turned(at(&x, &y, &correction, &moved));
                    assert!((by_q - chain.by_joints.column(i)).norm() < 2e-5, "{mode:?} q{i}");
                }
            }
        }
    }
}
