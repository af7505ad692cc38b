//! Where points of the target are expected in the image of a view that was not taken, and with what uncertainty.
//!
//! With the shared unknowns `s` of covariance `C` and the error `d` of the robot, a pixel moves by `J s + J_d d`, so its
//! covariance is `J C Jᵀ + J_d Σ J_dᵀ`. Links, lens and the robot's field count together: a focal length that is too long and a
//! camera that is too far away are hardly separated by small turns, and in a view like those that were taken they compensate
//! each other, in another one they do not.

use nalgebra::{DMatrix, Isometry3, Matrix2xX, Matrix6, Matrix6xX, Point3, SMatrix, Vector2};

use super::chain::Chain;
use super::view_block::{Layout, prior_weight};
use super::{Noise, PoseDependentError};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3::skew;

/// The image of one view by the model of a calibration.
#[derive(Debug, Clone)]
pub struct ExpectedPixels<'a> {
    intrinsics: &'a Intrinsics,
    camera_from_target: Isometry3<f64>,
    /// Jacobian of the pose of the target by the shared unknowns; zero for those of the lens.
    by_shared: Matrix6xX<f64>,
    /// Number of unknowns of the lens.
    lens: usize,
    covariance: &'a DMatrix<f64>,
    /// Covariance of the pose by the robot's noise.
    by_robot: Matrix6<f64>,
}

impl<'a> ExpectedPixels<'a> {
    /// `covariance` is that of the unknowns of `layout`, of which `lens` are of the lens.
    pub(super) fn new(
        intrinsics: &'a Intrinsics,
        chain: &Chain,
        (layout, lens): (Layout, usize),
        at: Option<(&PoseDependentError, &Pose<Base, Tip>)>,
        noise: &Noise,
        covariance: &'a DMatrix<f64>,
    ) -> Self {
        let mut by_shared = Matrix6xX::zeros(layout.count());
        by_shared.fixed_columns_mut::<6>(0).copy_from(&chain.by_hand_eye);
        by_shared.fixed_columns_mut::<6>(6).copy_from(&Matrix6::identity());
        layout.of_arm_in(&mut by_shared, &chain.by_arm);
        if let Some((field, base_from_tip)) = at {
            let slopes = field.columns(base_from_tip, &chain.by_correction);
            by_shared.columns_mut(layout.field_at(), slopes.ncols()).copy_from(&slopes);
        }
        let spread = Matrix6::from_diagonal(&prior_weight(noise).map(f64::recip));
        let by_robot = chain.by_correction * spread * chain.by_correction.transpose();
        Self { intrinsics, camera_from_target: chain.camera_from_target, by_shared, lens, covariance, by_robot }
    }

    /// The lens.
    pub fn intrinsics(&self) -> &Intrinsics {
        self.intrinsics
    }

    /// Where the target is.
    pub fn camera_from_target(&self) -> &Isometry3<f64> {
        &self.camera_from_target
    }

    /// The pixel of a point of the target \[m\], and its standard deviations along x and y, pixels; `None` where the lens gives no
    /// pixel.
    pub fn of(&self, point: &Point3<f64>) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let seen = self.intrinsics.project_with_jacobians(&(self.camera_from_target * point)).ok()?;
        let turn = self.camera_from_target.rotation.to_rotation_matrix();
        let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
        by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&(turn.matrix() * -skew(&point.coords)));
        let by_pose = seen.px_by_point * by_pose;
        let mut by_shared: Matrix2xX<f64> = by_pose * &self.by_shared;
        by_shared.columns_mut(Layout::FORM_AT, self.lens).copy_from(&seen.px_by_parameters.columns(0, self.lens));
        let variance = (&by_shared * self.covariance).component_mul(&by_shared).column_sum()
            + (by_pose * self.by_robot * by_pose.transpose()).diagonal();
        Some((seen.px, variance.map(|v| v.max(0.0).sqrt())))
    }
}

#[cfg(test)]
#[path = "expected_pixels_tests.rs"]
mod tests;
