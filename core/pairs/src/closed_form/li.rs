//! Li, Wang & Wu: hand-eye and target placement together, all 24 unknowns in one linear system.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::linear::{Rows, rotation_of_size_one};
use super::pairing::matrix;
use super::shah::solution;
use super::{ClosedForm, ClosedFormSolution, Method, check};
use crate::{HandEyeError, PosePair};

/// Estimates `mount_from_camera` and `anchor_from_target` from the views themselves, in one linear system.
///
/// Solves `A X = Z B` with `A = camera_from_target`, `X = target_from_anchor`, `Z = camera_from_mount`,
/// `B = mount_from_anchor` for all views, as least squares in the elements of matrices `M_X`, `M_Z` for the rotations
/// (row by row) and in `t_X`, `t_Z`: `(R_A ⊗ I) vec M_X - (I ⊗ R_Bᵀ) vec M_Z = 0` and
/// `(I ⊗ t_Bᵀ) vec M_Z - R_A t_X + t_Z = t_A`. The rotations are those nearest to `M_X` and `M_Z`; the translations are
/// not solved again with them.
///
/// # Frames and units
/// Views hold `anchor_from_mount` and `camera_from_target`, metres. The results map camera to mount and target to
/// anchor coordinates.
/// # Needs
/// Three views, turned about two axes that are not parallel, with the mount moved as well as turned: the size of the
/// matrices follows from the translations alone. It need not become 1, and an error of it goes into the translations
/// of both links: with few or noisy views they can be off by centimetres (17 cm with eight views of a real
/// eye-to-hand session, as in OpenCV). Half turns need no care: no axis is taken.
/// # Errors
/// As [`ClosedForm::solve`]; [`HandEyeError::NoSolution`] when nothing fixes the size of a matrix, or when it is not
/// between 0.5 and 2 because the translations are too small for their noise: OpenCV then returns translations wrong by
/// that factor.
/// # Reference
/// Li, Wang & Wu 2010, "Simultaneous robot-world and hand-eye calibration using dual-quaternions and Kronecker
/// product", International Journal of the Physical Sciences 5(10), 1530-1536, eq. 19 (the journal assigned no DOI).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Li;

impl ClosedForm for Li {
    fn name(&self) -> &'static str {
        "li"
    }

    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
        check(pairs)?;
        let method = Method { name: self.name(), views: pairs.len() };
        let mut rows = Rows::<25>::new();
        for view in pairs {
            rows.push(&equations(view));
        }
        let x = rows.least_squares().ok_or_else(|| {
            method.fails("the views leave a rotation, translation or scale open, move the tip further")
        })?;
        let rotation = |at: usize| {
            rotation_of_size_one(&Matrix3::from_row_slice(&x.as_slice()[at..at + 9]))
                .ok_or_else(|| method.fails("the mount's origin moved too little to fix the scale against the noise"))
        };
        let translation = |at: usize| Vector3::new(x[at], x[at + 1], x[at + 2]);
        method.finite(solution((rotation(0)?, translation(18)), (rotation(9)?, translation(21))))
    }
}

/// The twelve rows of one view: coefficients of `vec M_X`, `vec M_Z`, `t_X`, `t_Z`, and the right-hand side.
fn equations(view: &PosePair) -> SMatrix<f64, 12, 25> {
    let identity = Matrix3::identity();
    let mount_from_anchor = view.anchor_from_mount.inverse();
    let r_a = matrix(&view.camera_from_target.rotation());
    let r_b = matrix(&mount_from_anchor.rotation());
    let mut rows = SMatrix::<f64, 12, 25>::zeros();
    rows.fixed_view_mut::<9, 9>(0, 0).copy_from(&r_a.kronecker(&identity));
    rows.fixed_view_mut::<9, 9>(0, 9).copy_from(&-identity.kronecker(&r_b.transpose()));
    rows.fixed_view_mut::<3, 9>(9, 9).copy_from(&identity.kronecker(&mount_from_anchor.translation().transpose()));
    rows.fixed_view_mut::<3, 3>(9, 18).copy_from(&-r_a);
    rows.fixed_view_mut::<3, 3>(9, 21).copy_from(&identity);
    rows.fixed_view_mut::<3, 1>(9, 24).copy_from(&view.camera_from_target.translation());
    rows
}
