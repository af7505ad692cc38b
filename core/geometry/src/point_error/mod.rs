//! Error of a point: its covariance by that of the hand-eye transform, and the length that 95 % of errors stay below.

mod radius;

use nalgebra::{Matrix3, Matrix6, Point3, SMatrix};

use crate::se3::skew;

pub use radius::{radius_95, radius_95_mixture, radius_95_t};

/// Covariance in the camera frame of the stated place of `point` (camera coordinates, metres), given the covariance
/// `[t; r]` of the hand-eye transform (right perturbation).
pub fn covariance(hand_eye: &Matrix6<f64>, point: &Point3<f64>) -> Matrix3<f64> {
    let by_pose = by_hand_eye(point);
    by_pose * hand_eye * by_pose.transpose()
}

/// Jacobian of a `point` (camera coordinates, metres) by the hand-eye transform `[t; r]`, right perturbation.
pub fn by_hand_eye(point: &Point3<f64>) -> SMatrix<f64, 3, 6> {
    let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
    by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&point.coords));
    by_pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_error_moves_a_far_point_sideways() {
        let mut c = Matrix6::zeros();
        c[(3, 3)] = 1e-6;
        let moved = covariance(&c, &Point3::new(0.0, 0.0, 2.0));
        assert!((moved[(1, 1)] - 4e-6).abs() < 1e-15 && moved[(0, 0)] == 0.0 && moved[(2, 2)] == 0.0);
    }
}
