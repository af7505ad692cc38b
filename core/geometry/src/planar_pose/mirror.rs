//! The second pose that a flat target may have in a view, from the first.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::refine::{Minimum, refine};
use crate::view_equations::ViewInput;

/// Normals nearer to the line of sight than this angle \[rad\] are their own mirror image.
const HEAD_ON: f64 = 1e-3;

/// The pose with its normal mirrored at the line of sight to `middle`, a point of the target, which stays in its place.
/// `None` for a target that is seen head-on or edge-on.
///
/// A flat target seen from afar looks the same in this pose, and near it is the second minimum of the reprojection
/// error (Schweighofer & Pinz 2006, "Robust pose estimation from a planar target").
pub fn mirrored(pose: &Isometry3<f64>, middle: &Vector3<f64>) -> Option<Isometry3<f64>> {
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

/// Where the descent from the mirror image of a pose ends, in at most `steps` steps: the other minimum of the reprojection
/// error, or `pose` again where there is no other. `None` where there is no such start.
pub fn refined(seen: &ViewInput<'_>, pose: &Isometry3<f64>, steps: usize) -> Option<Minimum> {
    let sum: Vector3<f64> = seen.corners.iter().map(|c| seen.board.point(c.index, seen.shape).coords).sum();
    refine(seen, &mirrored(pose, &(sum / seen.corners.len() as f64))?, steps)
}
