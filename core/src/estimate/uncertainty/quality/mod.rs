//! What a calibration is worth: expected error in millimetres, and error on views it has not seen.

mod held_out;
mod radius;
mod tip_box;

use nalgebra::{Matrix3, Matrix6, Point3, SMatrix};

use crate::estimate::handeye::joint::{JointSolution, SmallSample};
use crate::geometry::se3::skew;

pub use held_out::{HeldOut, board_error_m, held_out, held_out_rms_px, pose_of_view};
pub use radius::{radius_95, radius_95_mixture, radius_95_t};
pub use tip_box::{BoxError, TipBox, tip_error_95_over};

/// Covariance in the camera frame of where `point` (camera coordinates, metres) is said to be, given the covariance
/// `[t; r]` of the hand-eye transform (right perturbation).
pub fn point_covariance(hand_eye: &Matrix6<f64>, point: &Point3<f64>) -> Matrix3<f64> {
    let by_pose = point_by_hand_eye(point);
    by_pose * hand_eye * by_pose.transpose()
}

/// How a `point` (camera coordinates, metres) moves with the hand-eye transform `[t; r]`, right perturbation.
pub fn point_by_hand_eye(point: &Point3<f64>) -> SMatrix<f64, 3, 6> {
    let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
    by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&point.coords));
    by_pose
}

/// Expected error of a point that the camera measures, at the place where it saw the target: 95 % of errors are below
/// this many metres. It counts the hand-eye transform alone, with what robot and corner noise did to it; the noise of
/// a later robot pose or image comes on top.
pub fn tip_error_95_m(solution: &JointSolution) -> f64 {
    tip_error_95_at(&solution.hand_eye_covariance(), solution.small_sample, &solution.reference_point)
}

/// The same at any `point` (camera coordinates, metres), from the covariance `[t; r]` of the hand-eye transform (right
/// perturbation) and the distribution of its error.
pub fn tip_error_95_at(hand_eye: &Matrix6<f64>, law: SmallSample, point: &Point3<f64>) -> f64 {
    point_error_95(&point_covariance(hand_eye, point), law)
}

/// The length that the error of a point stays under with a probability of 95 %, metres, from the covariance of the point
/// and the distribution of the hand-eye's error that causes it.
pub fn point_error_95(covariance: &Matrix3<f64>, law: SmallSample) -> f64 {
    radius_95_t(&(covariance / law.scale), law.degrees_of_freedom)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_error_moves_a_far_point_sideways() {
        let mut c = Matrix6::zeros();
        c[(3, 3)] = 1e-6;
        let moved = point_covariance(&c, &Point3::new(0.0, 0.0, 2.0));
        assert!((moved[(1, 1)] - 4e-6).abs() < 1e-15 && moved[(0, 0)] == 0.0 && moved[(2, 2)] == 0.0);
    }
}
