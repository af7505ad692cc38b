//! Shah: hand-eye and target placement together, rotations by one SVD of a Kronecker sum.

use nalgebra::{DMatrix, Matrix3, SMatrix, UnitQuaternion, Vector3};

use super::linear::{RANK_TOLERANCE, Rows, rotation_up_to_scale, singular};
use super::pairing::matrix;
use super::{ClosedForm, ClosedFormSolution, Method, check};
use crate::{HandEyeError, PosePair};
use handeye_geometry::frames::Pose;

/// Estimates `mount_from_camera` and `anchor_from_target` from the views themselves, both rotations first.
///
/// Solves `A X = Z B` with `A = camera_from_target`, `X = target_from_anchor`, `Z = camera_from_mount`,
/// `B = mount_from_anchor` for all views. `R_A R_X = R_Z R_B` makes `vec R_X` and `vec R_Z` (column by column) the
/// leading right and left singular vectors of `Σ R_B ⊗ R_A`, of which the nearest rotations are taken. The translations
/// are then the least-squares solution of `t_Z - R_A t_X = t_A - R_Z t_B`.
///
/// # Frames and units
/// Views hold `anchor_from_mount` and `camera_from_target`, metres. The results map camera to mount and target to
/// anchor coordinates.
/// # Needs
/// Three views, turned about two axes that are not parallel. Every view has the same weight, so a repeated pose counts
/// double. Half turns need no care, unless there are no other turns.
/// # Errors
/// As [`ClosedForm::solve`]; [`HandEyeError::NoSolution`] when two pairs of singular vectors fit equally well.
/// # Reference
/// Shah 2013, "Solving the robot-world/hand-eye calibration problem using the Kronecker product",
/// doi:10.1115/1.4024473.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shah;

impl ClosedForm for Shah {
    fn name(&self) -> &'static str {
        "shah"
    }

    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
        check(pairs)?;
        let method = Method { name: self.name(), views: pairs.len() };
        let (target_from_anchor, camera_from_mount) =
            rotations(pairs).ok_or_else(|| method.fails("more than one rotation fits the views"))?;
        let mut rows = Rows::<7>::new();
        for view in pairs {
            let mount_from_anchor = view.anchor_from_mount.inverse();
            let t_a = view.camera_from_target.translation();
            let mut block = SMatrix::<f64, 3, 7>::zeros();
            block.fixed_columns_mut::<3>(0).copy_from(&-matrix(&view.camera_from_target.rotation()));
            block.fixed_columns_mut::<3>(3).copy_from(&Matrix3::identity());
            block.set_column(6, &(t_a - camera_from_mount * mount_from_anchor.translation()));
            rows.push(&block);
        }
        let t = rows.least_squares().ok_or_else(|| method.fails("the turns leave a translation open"))?;
        method.finite(solution(
            (target_from_anchor, Vector3::new(t[0], t[1], t[2])),
            (camera_from_mount, Vector3::new(t[3], t[4], t[5])),
        ))
    }
}

/// Rotations of `target_from_anchor` and `camera_from_mount`.
fn rotations(views: &[PosePair]) -> Option<(UnitQuaternion<f64>, UnitQuaternion<f64>)> {
    let sum: SMatrix<f64, 9, 9> = views
        .iter()
        .map(|view| {
            let r_a = matrix(&view.camera_from_target.rotation());
            let r_b = matrix(&view.anchor_from_mount.rotation().inverse());
            r_b.kronecker(&r_a)
        })
        .sum();
    let singular = singular(&DMatrix::from_column_slice(9, 9, sum.as_slice()))?;
    if singular.values[0] - singular.values[1] <= RANK_TOLERANCE * singular.values[0] {
        return None;
    }
    let x = Matrix3::from_column_slice(singular.right[0].as_slice());
    let z = Matrix3::from_column_slice(singular.scaled_left[0].as_slice());
    Some((rotation_up_to_scale(&x)?, rotation_up_to_scale(&z)?))
}

/// Our two links from rotation and translation of `X = target_from_anchor` and `Z = camera_from_mount`.
pub(super) fn solution(
    target_from_anchor: (UnitQuaternion<f64>, Vector3<f64>),
    camera_from_mount: (UnitQuaternion<f64>, Vector3<f64>),
) -> ClosedFormSolution {
    let pose = |(rotation, translation): (UnitQuaternion<f64>, Vector3<f64>)| {
        nalgebra::Isometry3::from_parts(translation.into(), rotation)
    };
    ClosedFormSolution {
        mount_from_camera: Pose::from_isometry(pose(camera_from_mount).inverse()),
        anchor_from_target: Pose::from_isometry(pose(target_from_anchor).inverse()),
    }
}
