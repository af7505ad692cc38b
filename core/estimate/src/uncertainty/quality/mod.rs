//! The quality of a calibration: expected error in millimetres, and error on views it has not seen.

mod held_out;
mod tip_box;

use nalgebra::{Matrix6, Point3};

use crate::handeye::joint::{JointSolution, SmallSample};
use handeye_geometry::point_error;

pub use held_out::{BY_CHANCE, HeldOut, board_error_m, held_out, pose_of_view};
pub(crate) use held_out::{PredictedBy, compared, weighted_pose_of_view};
pub use tip_box::{BoxError, TipBox, tip_error_95_over};

/// Expected error of a point that the camera measures, at the place where it saw the target: 95 % of errors are below
/// this many metres. It counts the hand-eye transform alone, with the effect of robot and corner noise on it; the noise
/// of a later robot pose or image comes on top.
pub fn tip_error_95_m(solution: &JointSolution) -> f64 {
    tip_error_95_at(&solution.hand_eye_covariance(), solution.small_sample, &solution.reference_point)
}

/// The same at any `point` (camera coordinates, metres), from the covariance `[t; r]` of the hand-eye transform (right
/// perturbation) and the distribution of its error.
pub fn tip_error_95_at(hand_eye: &Matrix6<f64>, law: SmallSample, point: &Point3<f64>) -> f64 {
    law.radius_95(&point_error::covariance(hand_eye, point))
}
