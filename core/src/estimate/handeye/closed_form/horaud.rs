//! Horaud & Dornaika: the rotation as the eigenvector of a 4×4 matrix of quaternions.

use nalgebra::{Matrix4, Quaternion, SymmetricEigen, UnitQuaternion, Vector4};

use super::linear::RANK_TOLERANCE;
use super::pairing::{self, Motion};
use super::{ClosedForm, ClosedFormSolution};
use crate::estimate::handeye::{HandEyeError, PosePair};

/// Estimates `mount_from_camera` from relative motions, the rotation first and the translation with it.
///
/// Solves `A X = X B` with `A = mount_j_from_mount_i`, `B = camera_j_from_camera_i`, `X = mount_from_camera` for all
/// pairs `i < j`. The rotation is the unit quaternion that minimises `Σ |q_A q_X - q_X q_B|²`, an eigenvector; the
/// translation is the least-squares solution of `(I - R_A) t = t_A - R_X t_B`. `anchor_from_target` is the mean over
/// the views.
///
/// # Frames and units
/// Views hold `anchor_from_mount` and `camera_from_target`, metres. The result maps camera to mount coordinates.
/// # Needs
/// Three views, turned about two axes that are not parallel. Wide turns count most, motions between repeated poses not
/// at all.
/// The quaternions of `A` and `B` must have matching signs: positive real parts, as in OpenCV, and next to a half
/// turn the sign that the other motions ask for.
/// # Errors
/// As [`ClosedForm::solve`]; [`HandEyeError::NoSolution`] when half turns leave the rotation open, or when the camera
/// did not turn as the robot did.
/// # Reference
/// Horaud & Dornaika 1995, "Hand-eye calibration", section 4 and appendix A, doi:10.1177/027836499501400301. The
/// paper compares unit axes; like OpenCV we compare whole quaternions, which weights each motion with `sin²(θ/2)`.
/// The paper's joint iteration over rotation and translation is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Horaud;

impl ClosedForm for Horaud {
    fn name(&self) -> &'static str {
        "horaud"
    }

    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
        pairing::rotation_first(self.name(), pairs, rotation)
    }
}

/// Rotation of `mount_from_camera`; `None` when two rotations fit equally well within [`RANK_TOLERANCE`].
pub(super) fn rotation(motions: &[Motion]) -> Option<UnitQuaternion<f64>> {
    let cost: Matrix4<f64> = motions
        .iter()
        .map(|m| {
            let difference = times_from_left(&m.mount.rotation()) - times_from_right(&m.camera.rotation());
            difference.transpose() * difference
        })
        .sum();
    let eigen = SymmetricEigen::new(cost);
    let mut order = [0, 1, 2, 3];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [best, second, .., worst] = order.map(|k| eigen.eigenvalues[k]);
    if second - best <= RANK_TOLERANCE * worst {
        return None;
    }
    let q = eigen.eigenvectors.column(order[0]);
    Some(UnitQuaternion::from_quaternion(Quaternion::from_parts(q[0], nalgebra::Vector3::new(q[1], q[2], q[3]))))
}

/// The matrix with `M x = q x` for quaternions as columns `w, x, y, z`.
fn times_from_left(q: &Quaternion<f64>) -> Matrix4<f64> {
    columns(|unit| q * unit)
}

/// The matrix with `M x = x q` for quaternions as columns `w, x, y, z`.
fn times_from_right(q: &Quaternion<f64>) -> Matrix4<f64> {
    columns(|unit| unit * q)
}

fn columns(product: impl Fn(Quaternion<f64>) -> Quaternion<f64>) -> Matrix4<f64> {
    let units = [
        Quaternion::new(1.0, 0.0, 0.0, 0.0),
        Quaternion::new(0.0, 1.0, 0.0, 0.0),
        Quaternion::new(0.0, 0.0, 1.0, 0.0),
        Quaternion::new(0.0, 0.0, 0.0, 1.0),
    ];
    Matrix4::from_columns(&units.map(|unit| {
        let p = product(unit);
        Vector4::new(p.w, p.i, p.j, p.k)
    }))
}
