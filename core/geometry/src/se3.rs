//! The group of rigid motions: exponential, logarithm, adjoint, means.
//!
//! Tangent vectors are `[tx ty tz rx ry rz]`, metres and radians, translation first; perturbations are on the right,
//! `T * exp(delta)`, so a covariance is expressed in the source frame of `T`. Formulas: Solà, Deray, Atchuthan 2018, "A
//! micro Lie theory for state estimation in robotics", appendix D.

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Quaternion, SymmetricEigen, Translation3, UnitQuaternion, Vector3, Vector6,
};

/// Below this angle \[rad\] the series are used: the next term of each is then below the rounding of an `f64`, while
/// above it the cancellation in the closed forms, scaled by the squared angle that multiplies it, is too.
const SMALL_ANGLE: f64 = 1e-2;

/// The matrix `[v]×` with `[v]× w = v × w`.
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// `exp([rho; phi])` in SE(3): the screw motion, not translation and rotation separately.
pub fn exp(delta: &Vector6<f64>) -> Isometry3<f64> {
    let rho = delta.fixed_rows::<3>(0).into_owned();
    let phi = delta.fixed_rows::<3>(3).into_owned();
    Isometry3::from_parts(Translation3::from(left_jacobian(&phi) * rho), UnitQuaternion::from_scaled_axis(phi))
}

/// The tangent vector with [`exp`]`(log(T)) = T` and a rotation angle of at most π.
///
/// At exactly π the axis is determined up to its sign; one of the two is returned.
pub fn log(pose: &Isometry3<f64>) -> Vector6<f64> {
    let phi = rotation_vector(&pose.rotation);
    let rho = left_jacobian_inverse(&phi) * pose.translation.vector;
    Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

/// Axis times angle, angle in [0, π], accurate near 0 and near π.
pub fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let q = rotation.coords;
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let v = Vector3::new(q.x, q.y, q.z) * sign;
    let w = q.w * sign;
    let n = v.norm();
    // atan2 keeps full precision at both ends, where acos(w) or asin(n) would lose half the digits.
    let factor = if n < 1e-12 { 2.0 / w } else { 2.0 * n.atan2(w) / n };
    v * factor
}

/// Left Jacobian of SO(3), which also maps `rho` to the translation in [`exp`].
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle_sq = phi.norm_squared();
    let angle = angle_sq.sqrt();
    let k = skew(phi);
    // (1 - cos x) / x² as a squared sinc, which does not cancel.
    let sinc = if angle < SMALL_ANGLE {
        1.0 - angle_sq / 24.0 * (1.0 - angle_sq / 80.0)
    } else {
        (0.5 * angle).sin() / (0.5 * angle)
    };
    let b = if angle < SMALL_ANGLE {
        1.0 / 6.0 - angle_sq / 120.0 * (1.0 - angle_sq / 42.0)
    } else {
        (angle - angle.sin()) / (angle_sq * angle)
    };
    Matrix3::identity() + 0.5 * sinc * sinc * k + b * k * k
}

/// Inverse of [`left_jacobian`], defined for angles below 2π.
pub(crate) fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle_sq = phi.norm_squared();
    let angle = angle_sq.sqrt();
    let k = skew(phi);
    let c = if angle < SMALL_ANGLE {
        1.0 / 12.0 + angle_sq / 720.0 * (1.0 + angle_sq / 42.0)
    } else {
        let half = 0.5 * angle;
        (1.0 - half * half.cos() / half.sin()) / angle_sq
    };
    Matrix3::identity() - 0.5 * k + c * k * k
}

/// Adjoint: `T * exp(delta) = exp(adjoint(T) * delta) * T`.
pub fn adjoint(pose: &Isometry3<f64>) -> Matrix6<f64> {
    let r = pose.rotation.to_rotation_matrix().into_inner();
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&(skew(&pose.translation.vector) * r));
    m
}

/// The rotation that minimises the sum of squared chordal distances; independent of quaternion signs.
///
/// `None` when the input is empty.
/// Reference: Markley, Cheng, Crassidis, Oshman 2007, "Averaging quaternions", eq. 12.
pub(crate) fn mean_rotation(rotations: impl IntoIterator<Item = UnitQuaternion<f64>>) -> Option<UnitQuaternion<f64>> {
    let mut sum = nalgebra::Matrix4::zeros();
    let mut count = 0usize;
    for rotation in rotations {
        sum += rotation.coords * rotation.coords.transpose();
        count += 1;
    }
    if count == 0 {
        return None;
    }
    let eigen = SymmetricEigen::new(sum);
    let best = eigen.eigenvalues.imax();
    let c = eigen.eigenvectors.column(best);
    Some(UnitQuaternion::from_quaternion(Quaternion::new(c[3], c[0], c[1], c[2])))
}

/// Chordal mean of the rotations with the arithmetic mean of the translations; `None` when empty.
pub fn mean_pose(poses: &[Isometry3<f64>]) -> Option<Isometry3<f64>> {
    let rotation = mean_rotation(poses.iter().map(|p| p.rotation))?;
    let sum: Vector3<f64> = poses.iter().map(|p| p.translation.vector).sum();
    Some(Isometry3::from_parts(Translation3::from(sum / poses.len() as f64), rotation))
}

/// The rotation nearest to a 3×3 matrix in the Frobenius norm (Kabsch with the determinant fixed to +1).
pub fn nearest_rotation(m: &Matrix3<f64>) -> nalgebra::Rotation3<f64> {
    // Eigen of MᵀM would square the condition number; a 3×3 SVD is safe and cheap.
    let svd = m.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return nalgebra::Rotation3::identity();
    };
    let mut d = Matrix3::identity();
    d[(2, 2)] = (u * v_t).determinant().signum();
    // nalgebra sorts singular values in descending order, so the sign goes to the weakest direction.
    nalgebra::Rotation3::from_matrix_unchecked(u * d * v_t)
}

/// Largest deviation of the product of a matrix with its transpose from the identity, by element.
pub const ORTHONORMAL_TOLERANCE: f64 = 2e-3;

/// Why a matrix is not a rotation.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum NotARotation {
    /// Its columns are not orthonormal.
    #[error(
        "its columns are not orthonormal: the largest error of their products is {deviation:.6}, at most {ORTHONORMAL_TOLERANCE}"
    )]
    NotOrthonormal {
        /// Largest element of the difference.
        deviation: f64,
    },
    /// The matrix is left-handed.
    #[error("it mirrors (determinant −1): check the signs and the handedness")]
    Mirrors,
}

/// The rotation of a matrix that is orthonormal to [`ORTHONORMAL_TOLERANCE`]; it is made exact.
///
/// # Errors
/// [`NotARotation`] for one that deviates more, or that mirrors.
pub fn rotation_of_matrix(m: &Matrix3<f64>) -> Result<UnitQuaternion<f64>, NotARotation> {
    // Elements first: products of huge ones are NaN, for which comparisons fail.
    let deviation = (m.transpose() * m - Matrix3::identity()).amax();
    if m.amax() > 1.0 + ORTHONORMAL_TOLERANCE || deviation > ORTHONORMAL_TOLERANCE {
        return Err(NotARotation::NotOrthonormal { deviation });
    }
    if m.determinant() < 0.0 {
        return Err(NotARotation::Mirrors);
    }
    Ok(UnitQuaternion::from_rotation_matrix(&nearest_rotation(m)))
}

#[cfg(test)]
#[path = "se3_tests.rs"]
mod tests;
