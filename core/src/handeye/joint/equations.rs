//! The least-squares equations of one view in the target's pose and the lens.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, SMatrix, SVector, Vector6};

use crate::camera::{CameraError, Intrinsics, MAX_PARAMETERS};
use crate::observation::Corner;
use crate::se3::skew;

/// Unweighted normal equations of one view, with residuals `r = predicted − measured` in pixels, the pose perturbed as
/// `camera_from_target * exp(xi)` and the lens parameters in the order of [`Intrinsics::parameters`].
#[derive(Debug, Clone)]
pub(crate) struct PoseEquations {
    /// `Jpᵀ Jp`
    pub pose: Matrix6<f64>,
    /// `Jpᵀ Jl`; zero when the lens is given.
    pub pose_by_lens: SMatrix<f64, 6, MAX_PARAMETERS>,
    /// `Jlᵀ Jl`
    pub lens: SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS>,
    /// `Jpᵀ r`
    pub pose_gradient: Vector6<f64>,
    /// `Jlᵀ r`
    pub lens_gradient: SVector<f64, MAX_PARAMETERS>,
    /// `rᵀ r`, squared pixels.
    pub squared_px: f64,
    /// Number of corners.
    pub corners: usize,
}

impl PoseEquations {
    /// Linearises the corners of a view at a pose of the target; `points` are those of the target.
    pub fn new(
        intrinsics: &Intrinsics,
        camera_from_target: &Isometry3<f64>,
        points: &[Point3<f64>],
        corners: &[Corner],
        free_intrinsics: bool,
    ) -> Result<Self, CameraError> {
        let rotation: Matrix3<f64> = camera_from_target.rotation.to_rotation_matrix().into_inner();
        let mut out = Self {
            pose: Matrix6::zeros(),
            pose_by_lens: SMatrix::zeros(),
            lens: SMatrix::zeros(),
            pose_gradient: Vector6::zeros(),
            lens_gradient: SVector::zeros(),
            squared_px: 0.0,
            corners: corners.len(),
        };
        for corner in corners {
            let point = &points[corner.index];
            let projection = intrinsics.project_with_jacobians(&(camera_from_target * point))?;
            let residual = projection.px - corner.px;
            let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
            let by_target_point = projection.px_by_point * rotation;
            by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_target_point);
            by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&(-by_target_point * skew(&point.coords)));
            out.pose += by_pose.transpose() * by_pose;
            out.pose_gradient += by_pose.transpose() * residual;
            out.squared_px += residual.norm_squared();
            if free_intrinsics {
                let by_lens = &projection.px_by_parameters;
                out.pose_by_lens += by_pose.transpose() * by_lens;
                out.lens += by_lens.transpose() * by_lens;
                out.lens_gradient += by_lens.transpose() * residual;
            }
        }
        Ok(out)
    }
}
