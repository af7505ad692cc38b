//! The second pose that a flat target may have in a view.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::IntrinsicsError;
use super::adjust::{Estimate, Problem, refine_pose, seen};
use crate::handeye::joint::equations::{FreeForm, PoseEquations};

/// Normals nearer to the line of sight than this angle \[rad\] are their own mirror image.
const HEAD_ON: f64 = 1e-3;
/// Steps of a mirrored pose.
const STEPS: usize = 10;
/// A mirrored pose is taken when it lowers the cost of its view by more than this part: less is rounding.
const WORTHWHILE: f64 = 1e-6;

/// Tries the mirror image of every pose and keeps what fits better; whether any did.
///
/// A flat target seen from afar looks the same when its normal is mirrored at the line of sight. Both are minima of the
/// cost, and the descent ends in the one nearer to its start.
pub(super) fn improve(problem: &Problem<'_>, estimate: &mut Estimate) -> Result<bool, IntrinsicsError> {
    let mut improved = false;
    let Estimate { intrinsics, shape, poses } = estimate;
    for (view, pose) in problem.views.iter().zip(poses.iter_mut()) {
        if problem.cancel.is_cancelled() {
            return Err(IntrinsicsError::Cancelled);
        }
        let sum: Vector3<f64> = view.corners.iter().map(|c| problem.board.point(c.index, shape).coords).sum();
        let Some(start) = mirrored(pose, &(sum / view.corners.len() as f64)) else { continue };
        let Some((other, cost)) = refine_pose(view, problem.board, shape, intrinsics, &start, STEPS) else { continue };
        let seen = seen(view, problem.board, shape, intrinsics);
        let Ok(own) = PoseEquations::new(&seen, pose, FreeForm::default()) else { continue };
        if cost < (1.0 - WORTHWHILE) * own.squared_px {
            *pose = other;
            improved = true;
        }
    }
    Ok(improved)
}

/// The pose with its normal mirrored at the line of sight to `middle`, a point of the target, which stays in its place.
pub(super) fn mirrored(pose: &Isometry3<f64>, middle: &Vector3<f64>) -> Option<Isometry3<f64>> {
    let in_camera = pose.rotation * middle + pose.translation.vector;
    let sight = in_camera.try_normalize(0.0)?;
    let normal = pose.rotation * Vector3::z();
    let other = 2.0 * normal.dot(&sight) * sight - normal;
    if normal.angle(&other) < 2.0 * HEAD_ON {
        return None;
    }
    let rotation = UnitQuaternion::rotation_between(&normal, &other)? * pose.rotation;
    Some(Isometry3::from_parts(Translation3::from(in_camera - rotation * middle), rotation))
}
