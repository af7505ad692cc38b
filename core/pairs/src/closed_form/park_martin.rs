//! Park & Martin: least squares on the Lie algebra of rotations.

use nalgebra::{Matrix3, UnitQuaternion};

use super::linear::RANK_TOLERANCE;
use super::pairing::{self, Motion};
use super::{ClosedForm, ClosedFormSolution};
use crate::{HandEyeError, PosePair};
use handeye_geometry::se3;

/// Estimates `mount_from_camera` from relative motions, the rotation first and the translation with it.
///
/// Solves `A X = X B` with `A = mount_j_from_mount_i`, `B = camera_j_from_camera_i`, `X = mount_from_camera` for all
/// pairs `i < j`. With `a` and `b` the rotation vectors (axis times angle) of `A` and `B`, the rotation minimises
/// `Σ |a - R_X b|²`; the translation is the least-squares solution of `(I - R_A) t = t_A - R_X t_B`.
/// `anchor_from_target` is the mean over the views.
///
/// # Frames and units
/// Views hold `anchor_from_mount` and `camera_from_target`, metres. The result maps camera to mount coordinates.
/// # Needs
/// Three views, turned about two axes that are not parallel. Wide turns count most, motions between repeated poses not
/// at all.
/// Next to a half turn the sign of the axes is taken from the other motions, where OpenCV takes it from noise.
/// # Errors
/// As [`ClosedForm::solve`]; [`HandEyeError::NoSolution`] when half turns leave the rotation open, or when the camera
/// did not turn as the robot did.
/// # Reference
/// Park & Martin 1994, "Robot sensor calibration: solving AX=XB on the Euclidean group", doi:10.1109/70.326576. The
/// paper's `(MᵀM)^(-1/2) Mᵀ` with `M = Σ b aᵀ` is taken from an SVD that keeps the determinant at +1, where
/// noise on a weak third axis would make it a reflection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParkMartin;

impl ClosedForm for ParkMartin {
    fn name(&self) -> &'static str {
        "park_martin"
    }

    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
        pairing::rotation_first(self.name(), pairs, rotation)
    }
}

/// The rotation that turns the camera's rotation vectors into the mount's.
fn rotation(motions: &[Motion]) -> Option<UnitQuaternion<f64>> {
    let correlation: Matrix3<f64> = motions
        .iter()
        .map(|m| rotation_vector(&m.mount.rotation()) * rotation_vector(&m.camera.rotation()).transpose())
        .sum();
    let mut singular = correlation.singular_values();
    singular.as_mut_slice().sort_by(|a, b| b.total_cmp(a));
    if singular[1] <= RANK_TOLERANCE * singular[0] {
        return None;
    }
    Some(UnitQuaternion::from_rotation_matrix(&se3::nearest_rotation(&correlation)))
}

/// Axis times angle of this quaternion rather than of its opposite, which distinguishes the two sides of a half turn.
fn rotation_vector(rotation: &UnitQuaternion<f64>) -> nalgebra::Vector3<f64> {
    if rotation.w >= 0.0 {
        return se3::rotation_vector(rotation);
    }
    let v = rotation.imag();
    v * (2.0 * v.norm().atan2(rotation.w) / v.norm())
}
