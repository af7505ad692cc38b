//! A result compared with the truth that a simulated cell publishes. Reports only: nothing here reaches a solver.

use handeye_estimate::handeye::HandEye;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Tip};
use handeye_result::{CalibrationResult, TruthComparison};

/// Errors of an eye-in-hand result; `None` for a result of another kind.
pub fn comparison(
    result: &CalibrationResult,
    tip_from_camera: &Pose<Tip, Camera>,
    intrinsics: &Intrinsics,
) -> Option<TruthComparison> {
    let Some(HandEye::EyeInHand { tip_from_camera: found, .. }) = result.links() else { return None };
    let (metres, radians) = found.distance_to(tip_from_camera);
    let focal = result.intrinsics.as_ref().map(|i| {
        let relative = |found: f64, truth: f64| (found / truth - 1.0).abs();
        relative(i.fx, intrinsics.fx).max(relative(i.fy, intrinsics.fy)) * 100.0
    });
    Some(TruthComparison {
        translation_error_mm: Some(metres * 1e3),
        rotation_error_deg: Some(radians.to_degrees()),
        focal_error_percent: focal,
    })
}
