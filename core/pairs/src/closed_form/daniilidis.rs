//! Daniilidis: rotation and translation together, as a unit dual quaternion.

use nalgebra::{DVector, Quaternion, SMatrix, UnitQuaternion, Vector3};

use super::linear::{RANK_TOLERANCE, Rows};
use super::pairing::{self, Motion};
use super::{ClosedForm, ClosedFormSolution, Method, check, with_mean_target};
use crate::{HandEyeError, PosePair};
use handeye_geometry::se3::skew;

/// Estimates `mount_from_camera` from relative motions, as one unit dual quaternion.
///
/// Solves `A X = X B` with `A = mount_j_from_mount_i`, `B = camera_j_from_camera_i`, `X = mount_from_camera` for all
/// pairs `i < j`. A pose is the pair of quaternions `q` (rotation) and `q' = t q / 2`. The vector parts `a, a'` of `A`
/// and `b, b'` of `B` give six equations that are linear in `(q_X, q'_X)`:
/// `[a - b | [a + b]×] q_X = 0` and `[a' - b' | [a' + b']×] q_X + [a - b | [a + b]×] q'_X = 0`. Their two weakest right
/// singular vectors are combined so that `|q_X| = 1` and `q_X · q'_X = 0`. `anchor_from_target` is the mean over the
/// views.
///
/// # Frames and units
/// Views hold `anchor_from_mount` and `camera_from_target`, metres. The result maps camera to mount coordinates.
/// # Needs
/// Three views, turned about two axes that are not parallel. The real parts, equal for exact motions by the theorem
/// of screw congruence, are not used, so that with noise the axes of the frames matter. Rotations and half metres
/// are in one sum of squares, so the unit of length matters too. Quaternion signs as for [`Horaud`](super::Horaud).
/// # Errors
/// As [`ClosedForm::solve`]; [`HandEyeError::NoSolution`] when half turns leave the rotation open, when more than two
/// singular vectors are null, or when the noise leaves no real combination of the two (OpenCV returns NaN).
/// # Reference
/// Daniilidis 1999, "Hand-eye calibration using dual quaternions", eqs. 31 to 35, doi:10.1177/02783649922066213. Of the
/// two combinations the one with the larger `|q_X|` per norm of `(q_X, q'_X)` is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Daniilidis;

impl ClosedForm for Daniilidis {
    fn name(&self) -> &'static str {
        "daniilidis"
    }

    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
        check(pairs)?;
        let method = Method { name: self.name(), views: pairs.len() };
        let mut rows = Rows::<8>::new();
        for motion in pairing::aligned_motions(&method, pairs)? {
            rows.push(&equations(&motion));
        }
        let singular = rows.singular().ok_or_else(|| method.fails("the numbers overflow, check the length unit"))?;
        if singular.values[5] <= RANK_TOLERANCE * singular.values[0] {
            return Err(method.fails("the motions leave rotation or translation open"));
        }
        let (q, q_dual) = unit_combination(&singular.right[6], &singular.right[7])
            .ok_or_else(|| method.fails("no rigid transform is near the null space, the poses are too noisy"))?;
        let translation = (q_dual * q.conjugate() * 2.0).imag();
        with_mean_target(&method, pairs, pairing::pose(UnitQuaternion::new_unchecked(q), translation))
    }
}

/// The six rows of one motion.
fn equations(motion: &Motion) -> SMatrix<f64, 6, 8> {
    let (a, a_dual) = vectors(&motion.mount.rotation(), &motion.mount.translation());
    let (b, b_dual) = vectors(&motion.camera.rotation(), &motion.camera.translation());
    let mut rows = SMatrix::<f64, 6, 8>::zeros();
    for (row, column) in [(0, 0), (3, 4)] {
        rows.fixed_view_mut::<3, 1>(row, column).copy_from(&(a - b));
        rows.fixed_view_mut::<3, 3>(row, column + 1).copy_from(&skew(&(a + b)));
    }
    rows.fixed_view_mut::<3, 1>(3, 0).copy_from(&(a_dual - b_dual));
    rows.fixed_view_mut::<3, 3>(3, 1).copy_from(&skew(&(a_dual + b_dual)));
    rows
}

/// Vector parts of the two quaternions of a pose.
fn vectors(rotation: &UnitQuaternion<f64>, translation_m: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let dual = Quaternion::from_imag(*translation_m) * rotation.into_inner() * 0.5;
    (rotation.imag(), dual.imag())
}

/// The unit dual quaternion in the span of two 8-vectors, each a quaternion `w, x, y, z` and its dual part.
fn unit_combination(first: &DVector<f64>, second: &DVector<f64>) -> Option<(Quaternion<f64>, Quaternion<f64>)> {
    let quaternion = |v: &DVector<f64>, at: usize| Quaternion::new(v[at], v[at + 1], v[at + 2], v[at + 3]);
    let (u1, v1) = (quaternion(first, 0), quaternion(first, 4));
    let (u2, v2) = (quaternion(second, 0), quaternion(second, 4));
    // q · q' is a quadratic form in the direction (cos φ, sin φ): mean + amplitude * cos(2 φ - phase).
    let (c11, c12, c22) = (u1.dot(&v1), u1.dot(&v2) + u2.dot(&v1), u2.dot(&v2));
    let mean = 0.5 * (c11 + c22);
    let amplitude = 0.5 * (c11 - c22).hypot(c12);
    let phase = c12.atan2(c11 - c22);
    if mean.abs() > amplitude {
        return None;
    }
    let offset = (-mean / amplitude).acos();
    let (q, q_dual) = [0.5 * (phase + offset), 0.5 * (phase - offset)]
        .map(|angle| {
            let (s, c) = angle.sin_cos();
            (u1 * c + u2 * s, v1 * c + v2 * s)
        })
        .into_iter()
        .max_by(|(q, _), (p, _)| q.norm().total_cmp(&p.norm()))?;
    let norm = q.norm();
    (norm > RANK_TOLERANCE).then(|| (q / norm, q_dual / norm))
}
