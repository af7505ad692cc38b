//! Residuals of corners by a chain of transforms.

use nalgebra::Point3;

use crate::CornerResidual;
use crate::handeye::closed_form::ClosedFormSolution;
use crate::handeye::joint::{JointProblem, camera_from_target};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::observation::{Corner, View};

/// Residuals of a view at a pose of the target; none at all when a corner has no image there.
pub(super) fn residuals(
    intrinsics: &Intrinsics,
    camera_from_target: &Pose<Camera, Target>,
    points: &[Point3<f64>],
    corners: &[Corner],
) -> Vec<CornerResidual> {
    let residual = |corner: &Corner| {
        let predicted = intrinsics.project(&(camera_from_target.isometry() * points[corner.index])).ok()?;
        Some(CornerResidual { index: corner.index, px: corner.px, residual_px: corner.px - predicted })
    };
    corners.iter().map(residual).collect::<Option<_>>().unwrap_or_default()
}

/// Sum of squared residuals of one view by the bare chain; a point without an image counts as the cap.
pub(super) fn squared_residuals(
    problem: &JointProblem<'_>,
    (intrinsics, shape): (&Intrinsics, &BoardShape),
    solution: &ClosedFormSolution,
    view: &View,
    cap_px: f64,
) -> f64 {
    let chain = camera_from_target(
        problem.mode,
        &view.base_from_tip,
        &solution.mount_from_camera,
        &solution.anchor_from_target,
    );
    view.corners
        .iter()
        .map(|corner| {
            let residual = intrinsics
                .project(&(chain.isometry() * problem.board.point(corner.index, shape)))
                .map_or(cap_px, |px| (px - corner.px).norm());
            residual.min(cap_px).powi(2)
        })
        .sum()
}
