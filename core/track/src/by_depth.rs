//! The board from depths: every corner becomes a point by its own depth, and a rigid board is laid through the points.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

use super::pose;
use super::{BoardDetection, ByDepth, Image};
use handeye_estimate::verify::Predictor;
use handeye_geometry::depth::{DepthImage, outlier_reach_m};
use handeye_geometry::frames::{Base, Camera, PointIn, Pose};
use handeye_geometry::se3;
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corner;

/// Points that fix a board with one to spare, so that a wrong one shows.
const MIN_POINTS: usize = 4;
const ROUNDS: usize = 4;

/// A corner with depth.
struct Point {
    index: usize,
    on_board: Point3<f64>,
    in_camera: Point3<f64>,
}

/// The board by the depths at the corners `seen`; `None` when fewer than four corners, or corners on one line only, have
/// one. The pose by corners only serves to distinguish depths of the board from depths of other objects.
pub(super) fn by_depth(
    image: &Image<'_>,
    depth: &DepthImage,
    seen: &BoardDetection,
    calibrated: &Predictor,
    target: &TargetSpec,
) -> Option<ByDepth> {
    let base_from_camera = calibrated.base_from_camera(&image.base_from_tip);
    let mut points: Vec<Point> = Vec::with_capacity(seen.corners.len());
    for corner in &seen.corners {
        if let Some(in_camera) = point_at(depth, corner, image.far_plane_m, calibrated) {
            points.push(Point { index: corner.index, on_board: target.point(corner.index), in_camera });
        }
    }
    // One wrong offset of all depths must not empty the set, hence the deviation from the median.
    let ahead: Vec<f64> =
        points.iter().map(|p| p.in_camera.z - (seen.camera_from_target.isometry() * p.on_board).z).collect();
    let middle = median_high(ahead.iter().copied())?;
    let off: Vec<f64> = ahead.iter().map(|a| (a - middle).abs()).collect();
    let reach = outlier_reach_m(&off);
    let mut off = off.into_iter();
    points.retain(|_| off.next().is_some_and(|off| off <= reach));
    let camera_from_target = fit(&mut points, target)?;
    let squares: f64 = points.iter().map(|p| (camera_from_target * p.on_board - p.in_camera).norm_squared()).sum();
    let first = points.iter().find(|p| p.index == 0);
    Some(ByDepth {
        base_from_target: base_from_camera * Pose::from_isometry(camera_from_target),
        first_corner_in_base: first.map(|p| in_base(&base_from_camera, p.in_camera)),
        corners: points.len(),
        rms_m: (squares / points.len() as f64).sqrt(),
    })
}

fn in_base(base_from_camera: &Pose<Base, Camera>, point: Point3<f64>) -> Point3<f64> {
    (*base_from_camera * PointIn::<Camera>::new(point)).point()
}

/// Point on the ray through the corner at the corner's depth.
fn point_at(depth: &DepthImage, corner: &Corner, far_m: f32, calibrated: &Predictor) -> Option<Point3<f64>> {
    let depth_m = depth.at(corner.px, far_m)?;
    let ray = calibrated.intrinsics.unproject(&corner.px).ok()?;
    (ray.z > 0.0).then(|| Point3::from(ray.into_inner() * (depth_m / ray.z)))
}

/// Rigid fit; points that do not fit are taken out of the set.
fn fit(points: &mut Vec<Point>, target: &TargetSpec) -> Option<Isometry3<f64>> {
    let mut pose = None;
    for _ in 0..ROUNDS {
        let spread = 0.4 * target.grid().square_m;
        if points.len() < MIN_POINTS || !pose::spans(points.iter().map(|p| p.on_board), spread) {
            return None;
        }
        let found = rigid(points);
        pose = Some(found);
        let off: Vec<f64> = points.iter().map(|p| (found * p.on_board - p.in_camera).norm()).collect();
        let reach = outlier_reach_m(&off);
        if off.iter().all(|off| *off <= reach) {
            break;
        }
        let mut off = off.into_iter();
        points.retain(|_| off.next().is_some_and(|off| off <= reach));
    }
    pose
}

/// Kabsch 1976, "A solution for the best rotation to relate two sets of vectors".
fn rigid(points: &[Point]) -> Isometry3<f64> {
    let count = points.len().max(1) as f64;
    let from: Vector3<f64> = points.iter().map(|p| p.on_board.coords).sum::<Vector3<f64>>() / count;
    let to: Vector3<f64> = points.iter().map(|p| p.in_camera.coords).sum::<Vector3<f64>>() / count;
    let mut cross = Matrix3::zeros();
    for point in points {
        cross += (point.in_camera.coords - to) * (point.on_board.coords - from).transpose();
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&se3::nearest_rotation(&cross));
    Isometry3::from_parts(Translation3::from(to - rotation * from), rotation)
}

#[cfg(test)]
#[path = "by_depth_tests.rs"]
mod tests;
