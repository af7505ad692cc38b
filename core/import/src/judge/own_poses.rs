//! Poses that a camera was given by the target that it sees, and that are not a robot's.
//!
//! # How they are recognised
//! With `A` a pose as it is read and `C` the target's pose in the camera, the hand-eye equation `A X C = Y` holds for every arm.
//! For poses that are a function of the target's poses alone its links are such as no arm has:
//!
//! - the camera carries itself: `X` has no translation and turns axes into axes (tools differ in where they let y and z point);
//! - the target carries itself: `Y` puts the origin on the target, and turns axes into axes (tools count points from a corner, from
//!   the middle, or from the outer edge).
//!
//! One of both alone is common: a TCP that was calibrated to the camera gives the first, a base that was taught on the target or a
//! world that is the target's frame the second. Only both together count as the camera's own poses. The first alone does where
//! poses and images agree far better than the noise of the corners allows: an arm is independent of that noise.
//!
//! # Tolerances
//! The poses come from another program with another lens: a focal length that is off by a twentieth moves the camera by a twentieth
//! of the distance, a centre that is off by a twentieth of the focal length turns it by 0.05 rad. Of arms whose base and hand-eye are
//! turned at random, one in 6,000 has either rotation so near to one of the 24 (24·0.05³/6π), one in 4·10⁷ both.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, UnitQuaternion};

use crate::sight::Sight;
use handeye_estimate::diagnose::hypotheses::{EXPLAINED, EXPLAINED_RAD};
use handeye_estimate::handeye::closed_form::ClosedFormSolution;
use handeye_geometry::se3;

/// How far beyond the outermost points the origin may be, relative to the size of the target: the edge of a board is a square away,
/// a third of the smallest boards that are detected.
const BESIDE: f64 = 1.0 / 3.0;
/// Squares of residuals over those that the noise of the corners causes, per degree of freedom and at the median of the views,
/// below which poses know of that noise. An arm's are 1 or more; one view is below by chance in 700 where six views leave two
/// thirds of their degrees of freedom (χ² of 6), and most of six are less than once in a million.
const KNOWS_THE_NOISE: f64 = 0.05;
/// Views from which that is judged.
const NEED: usize = 6;
/// Frames that are the same to a hundredth of the distance and 0.6°: the residual where two cameras see the same target.
const SAME: f64 = 0.01;

/// Owner of the poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PoseOwner {
    /// The camera that saw the target.
    Camera,
    /// Another camera that sees the same target; a base that was taught on the target looks the same.
    OtherCamera,
}

/// The owner of the poses by a solution; `None`: an arm, as far as can be determined. `over_noise` is the square of the residual of
/// every view over what the noise of its corners causes.
pub(super) fn whose(sight: &Sight, solution: &ClosedFormSolution, over_noise: &[f64]) -> Option<PoseOwner> {
    let is_camera = is_of_camera(solution.mount_from_camera.isometry(), sight.target.distance_m);
    let anchor_from_target = solution.anchor_from_target.isometry();
    if is_camera && (is_on_target(anchor_from_target, sight) || knows_the_noise(over_noise)) {
        return Some(PoseOwner::Camera);
    }
    let apart_m = anchor_from_target.translation.vector.norm();
    let is_same = apart_m < SAME * sight.target.distance_m && anchor_from_target.rotation.angle() < SAME;
    is_same.then_some(PoseOwner::OtherCamera)
}

fn is_of_camera(mount_from_camera: &Isometry3<f64>, distance_m: f64) -> bool {
    mount_from_camera.translation.vector.norm() < EXPLAINED * distance_m && is_along_axes(&mount_from_camera.rotation)
}

fn is_on_target(anchor_from_target: &Isometry3<f64>, sight: &Sight) -> bool {
    let origin = anchor_from_target.inverse() * Point3::origin();
    let range = |axis: usize| {
        let values = sight.target.outer.iter().map(|point| point[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (x, y) = (range(0), range(1));
    let tolerance_m = EXPLAINED * sight.target.distance_m;
    let beside_m = (BESIDE * (x.1 - x.0).max(y.1 - y.0)).max(tolerance_m);
    let is_in = |at: f64, (low, high): (f64, f64)| (low - beside_m..=high + beside_m).contains(&at);
    is_in(origin.x, x)
        && is_in(origin.y, y)
        && origin.z.abs() < tolerance_m
        && is_along_axes(&anchor_from_target.rotation)
}

fn knows_the_noise(over_noise: &[f64]) -> bool {
    let below = over_noise.iter().filter(|ratio| **ratio < KNOWS_THE_NOISE).count();
    over_noise.len() >= NEED && 2 * below > over_noise.len()
}

/// The square of a residual over what the noise of the corners causes, per degree of freedom.
pub(super) fn over_noise(expected: &Isometry3<f64>, seen: &Isometry3<f64>, covariance: &Matrix6<f64>) -> Option<f64> {
    let residual = se3::log(&(seen.inverse() * expected));
    let ratio = residual.dot(&(covariance.cholesky()?.solve(&residual))) / 6.0;
    ratio.is_finite().then_some(ratio)
}

/// Whether a rotation turns axes into axes.
fn is_along_axes(rotation: &UnitQuaternion<f64>) -> bool {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let matrix = rotation.to_rotation_matrix();
    ORDERS.iter().any(|order| {
        let mut nearest = Matrix3::zeros();
        for (row, column) in order.iter().enumerate() {
            nearest[(row, *column)] = matrix[(row, *column)].signum();
        }
        // By quaternions: the angle of a matrix is computed from its trace, which is invalid where rounding made that exceed
        // three.
        let nearest = Rotation3::from_matrix_unchecked(nearest);
        nearest.matrix().determinant() > 0.0 && UnitQuaternion::from(nearest).angle_to(rotation) < EXPLAINED_RAD
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn all_24_ways_to_name_axes_are_known_and_nothing_beside_them() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let mut count = 0;
        let mut known: Vec<UnitQuaternion<f64>> = Vec::new();
        for (a, b, c) in (0..64).map(|i| (f64::from(i % 4), f64::from(i / 4 % 4), f64::from(i / 16))) {
            let rotation = UnitQuaternion::from_euler_angles(a * quarter, b * quarter, c * quarter);
            assert!(is_along_axes(&rotation), "{rotation}");
            if known.iter().all(|it| it.angle_to(&rotation) > 0.1) {
                known.push(rotation);
                count += 1;
            }
            for axis in [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()] {
                let off = |angle: f64| rotation * UnitQuaternion::from_axis_angle(&axis, angle);
                assert!(is_along_axes(&off(0.04)) && !is_along_axes(&off(0.06)) && !is_along_axes(&off(0.7)));
            }
        }
        assert_eq!(count, 24);
    }
}
