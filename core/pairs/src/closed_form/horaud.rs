//! Horaud & Dornaika: the rotation as the eigenvector of a 4×4 matrix of quaternions.

use super::pairing;
use super::{ClosedForm, ClosedFormSolution};
use crate::{HandEyeError, PosePair};

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
/// turn the sign that the other motions require.
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
        pairing::rotation_first(self.name(), pairs, pairing::rotation)
    }
}
