//! Andreff, Horaud & Espiau: rotation matrix and translation together, by the Kronecker product.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::linear::{Rows, rotation_of_size_one};
use super::pairing::{self, Motion};
use super::{ClosedForm, ClosedFormSolution, Method, check, with_mean_target};
use crate::{HandEyeError, PosePair};

/// Estimates `mount_from_camera` from relative motions, rotation and translation in one linear system.
///
/// Solves `A X = X B` with `A = mount_j_from_mount_i`, `B = camera_j_from_camera_i`, `X = mount_from_camera` for all
/// pairs `i < j`, as least squares in the nine elements of a matrix `M` for `R_X` (row by row) and in `t`:
/// `(I - R_A ⊗ R_B) vec M = 0` and `(I ⊗ t_Bᵀ) vec M + (I - R_A) t = t_A`. The rotation is the one nearest to `M`; `t`
/// is not solved again with it. `anchor_from_target` is the mean over the views.
///
/// # Frames and units
/// Views hold `anchor_from_mount` and `camera_from_target`, metres. The result maps camera to mount coordinates.
/// # Needs
/// Three views, turned about two axes that are not parallel, with the mount moved as well as turned: the size of `M`
/// follows from the translations alone. It need not become 1, and an error of it goes into `t`, which makes this
/// the weakest of the `A X = X B` methods with noise (2 to 9 times the error of the others at 0.1 px or less, more with
/// fewer or worse views). Elements of a matrix and metres are in one sum of squares, so the unit of length matters.
/// Half turns need no care: no axis is taken.
/// # Errors
/// As [`ClosedForm::solve`]; [`HandEyeError::NoSolution`] when nothing fixes the size of `M`, or when it is not between
/// 0.5 and 2 because the translations are too small for their noise: OpenCV then returns `t` wrong by that factor.
/// # Reference
/// Andreff, Horaud & Espiau 1999, "On-line hand-eye calibration", eqs. 10 and 15, doi:10.1109/IM.1999.805374.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Andreff;

impl ClosedForm for Andreff {
    fn name(&self) -> &'static str {
        "andreff"
    }

    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
        check(pairs)?;
        let method = Method { name: self.name(), views: pairs.len() };
        let mut rows = Rows::<13>::new();
        for motion in pairing::motions(pairs) {
            rows.push(&equations(&motion));
        }
        let x = rows.least_squares().ok_or_else(|| {
            method.fails("the motions leave rotation, translation or scale open, move the tip further")
        })?;
        let matrix = Matrix3::from_row_slice(&x.as_slice()[..9]);
        let rotation = rotation_of_size_one(&matrix)
            .ok_or_else(|| method.fails("the mount's origin moved too little to fix the scale against the noise"))?;
        with_mean_target(&method, pairs, pairing::pose(rotation, Vector3::new(x[9], x[10], x[11])))
    }
}

/// The twelve rows of one motion: coefficients of `vec M` and `t`, and the right-hand side.
fn equations(motion: &Motion) -> SMatrix<f64, 12, 13> {
    let (r_a, r_b) = (motion.mount_rotation(), motion.camera_rotation());
    let mut rows = SMatrix::<f64, 12, 13>::zeros();
    let kronecker: SMatrix<f64, 9, 9> = r_a.kronecker(&r_b);
    rows.fixed_view_mut::<9, 9>(0, 0).copy_from(&(SMatrix::<f64, 9, 9>::identity() - kronecker));
    rows.fixed_view_mut::<3, 9>(9, 0)
        .copy_from(&Matrix3::identity().kronecker(&motion.camera.translation().transpose()));
    rows.fixed_view_mut::<3, 3>(9, 9).copy_from(&(Matrix3::identity() - r_a));
    rows.fixed_view_mut::<3, 1>(9, 12).copy_from(&motion.mount.translation());
    rows
}
