//! The pose of the target from its corners in one image.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, SMatrix, SymmetricEigen, Vector2, Vector6};
use opencv::calib3d::{SolvePnPMethod, solve_pnp_generic};
use opencv::core::{Mat, Vector, no_array};

use super::VisionError;
use super::bridge::{failed, isometry, mat_from_matrix3, numbers, to_points2d, to_points3d};
use crate::camera::Intrinsics;
use crate::frames::{Camera, Pose, Target};
use crate::observation::Corner;
use crate::target::TargetSpec;

/// Corners that fix a planar pose.
const MIN_CORNERS: usize = 4;
/// Smallest cosine to the optical axis of the rays that start a solution: the plane z = 1 has no room for more.
const MIN_RAY_Z: f64 = 0.05;
/// Ratio of extents below which corners are taken for collinear.
const MIN_FLATNESS: f64 = 1e-4;
const MAX_STEPS: usize = 50;
/// A step whose rotation \[rad\] and translation [part of the distance] are below this ends the refinement.
const CONVERGED: f64 = 1e-12;
/// Two solutions closer than this angle \[rad\] are one: a tenth of what corner noise of 0.1 px does to a pose.
const SAME_ROTATION: f64 = 1e-4;

/// A pose and how well it explains the corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// The target's pose in the camera.
    pub camera_from_target: Pose<Camera, Target>,
    /// Root mean square of the 2-D distances between seen and projected corners, pixels.
    pub rms_px: f64,
}

/// The poses that a flat target may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose {
    /// The one with the smaller error.
    pub best: Solution,
    /// The other minimum of the reprojection error, roughly `best` mirrored at the line of sight; `None` where there
    /// is only one.
    pub alternative: Option<Solution>,
}

impl PlanarPose {
    /// Error of the best solution over that of the alternative: near 0 the pose is certain, near 1 it is a guess
    /// (small or distant targets seen almost head-on). `None` without alternative.
    pub fn ambiguity(&self) -> Option<f64> {
        // Two perfect solutions cannot be told apart.
        self.alternative.map(|a| if a.rms_px > 0.0 { self.best.rms_px / a.rms_px } else { 1.0 })
    }
}

/// The best of [`solve`], for callers to whom ambiguity does not matter.
///
/// # Errors
/// As [`solve`].
pub fn camera_from_target(
    corners: &[Corner],
    target: &TargetSpec,
    intrinsics: &Intrinsics,
) -> Result<Pose<Camera, Target>, VisionError> {
    solve(corners, target, intrinsics).map(|pose| pose.best.camera_from_target)
}

/// Estimates `camera_from_target` from the corners of a flat target by least squares on the reprojection error.
///
/// Both solutions of IPPE on the corners' rays are refined by Levenberg–Marquardt on
/// `Σ ‖corner_px − project(camera_from_target * corner_in_target)‖²` with the camera's own Jacobians, so every lens
/// model is served, rays far off the axis included. A minimum with part of the target behind the camera is dropped.
///
/// # Needs
/// Four corners that do not lie on one line; more than half of them may not lie beyond 87° from the optical axis.
/// Solutions that fall together count as one.
///
/// # Errors
/// [`VisionError::TooFewCorners`], [`VisionError::BadCorner`], [`VisionError::CollinearCorners`],
/// [`VisionError::Camera`] for unusable intrinsics or a corner outside the lens model, [`VisionError::NoPose`].
///
/// # Reference
/// Collins & Bartoli 2014, "Infinitesimal plane-based pose estimation", IJCV 109; OpenCV's `SOLVEPNP_IPPE`.
pub fn solve(corners: &[Corner], target: &TargetSpec, intrinsics: &Intrinsics) -> Result<PlanarPose, VisionError> {
    intrinsics.validate()?;
    check_corners(corners, target, 0)?;
    let seen: Vec<(Point3<f64>, Vector2<f64>)> =
        corners.iter().map(|corner| (target.point(corner.index), corner.px)).collect();
    let mut solutions: Vec<Solution> = initial_poses(&seen, intrinsics)?
        .iter()
        .filter_map(|start| refine(&seen, intrinsics, start))
        .map(|(pose, rms_px)| Solution { camera_from_target: Pose::from_isometry(pose), rms_px })
        .collect();
    solutions.sort_by(|a, b| a.rms_px.total_cmp(&b.rms_px));
    let mut solutions = solutions.into_iter();
    let best = solutions.next().ok_or(VisionError::NoPose { corners: corners.len() })?;
    let alternative = solutions.find(|other| {
        other.camera_from_target.rotation().angle_to(&best.camera_from_target.rotation()) > SAME_ROTATION
    });
    Ok(PlanarPose { best, alternative })
}

/// Checks that the corners of view `view` are points of the target, are numbers and span a plane.
pub(super) fn check_corners(corners: &[Corner], target: &TargetSpec, view: usize) -> Result<(), VisionError> {
    let grid = target.grid();
    if !(grid.square_m.is_finite() && grid.square_m > 0.0) {
        return Err(VisionError::BadSquare { square_m: grid.square_m });
    }
    if corners.len() < MIN_CORNERS {
        return Err(VisionError::TooFewCorners { view, got: corners.len(), need: MIN_CORNERS });
    }
    let mut taken = vec![false; grid.len()];
    for corner in corners {
        let bad = |reason| {
            let (u_px, v_px) = (corner.px.x, corner.px.y);
            Err(VisionError::BadCorner { view, index: corner.index, u_px, v_px, reason })
        };
        if !(corner.px.x.is_finite() && corner.px.y.is_finite()) {
            return bad("is not a number");
        }
        match taken.get_mut(corner.index) {
            None => return bad("is no point of the target; check its columns and rows"),
            Some(true) => return bad("is listed twice"),
            Some(slot) => *slot = true,
        }
    }
    let on_target: Vec<Vector2<f64>> = corners.iter().map(|c| target.point(c.index).coords.xy()).collect();
    let in_image: Vec<Vector2<f64>> = corners.iter().map(|c| c.px).collect();
    if is_collinear(&on_target) || is_collinear(&in_image) {
        return Err(VisionError::CollinearCorners { view });
    }
    Ok(())
}

fn is_collinear(points: &[Vector2<f64>]) -> bool {
    let mean = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let scatter: SMatrix<f64, 2, 2> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let extents = SymmetricEigen::new(scatter).eigenvalues;
    extents.min() <= MIN_FLATNESS * MIN_FLATNESS * extents.max()
}

/// Both IPPE solutions on the plane z = 1.
fn initial_poses(
    seen: &[(Point3<f64>, Vector2<f64>)],
    intrinsics: &Intrinsics,
) -> Result<Vec<Isometry3<f64>>, VisionError> {
    let mut points = Vec::with_capacity(seen.len());
    let mut normalised = Vec::with_capacity(seen.len());
    for (point, px) in seen {
        let ray = intrinsics.unproject(px)?;
        if ray.z > MIN_RAY_Z {
            points.push(*point);
            normalised.push(ray.xy() / ray.z);
        }
    }
    if points.len() < MIN_CORNERS || is_collinear(&normalised) {
        return Err(VisionError::NoPose { corners: seen.len() });
    }
    let (mut rotations, mut translations) = (Vector::<Mat>::new(), Vector::<Mat>::new());
    solve_pnp_generic(
        &to_points3d(&points),
        &to_points2d(&normalised),
        &mat_from_matrix3(&Matrix3::identity())?,
        &no_array(),
        &mut rotations,
        &mut translations,
        false,
        SolvePnPMethod::SOLVEPNP_IPPE,
        &no_array(),
        &no_array(),
        &mut no_array(),
    )
    .map_err(failed("solve for the target's pose"))?;
    let mut poses = Vec::new();
    for (rotation, translation) in rotations.iter().zip(translations.iter()) {
        if let (&[rx, ry, rz], &[x, y, z]) = (&numbers(&rotation)?[..], &numbers(&translation)?[..]) {
            poses.push(isometry(&[rx, ry, rz], &[x, y, z]));
        }
    }
    Ok(poses)
}

/// Levenberg–Marquardt over `start * exp(delta)`; the pose and its RMS in pixels. `None` when the start has a corner
/// without image, which no later step would mend.
fn refine(
    seen: &[(Point3<f64>, Vector2<f64>)],
    intrinsics: &Intrinsics,
    start: &Isometry3<f64>,
) -> Option<(Isometry3<f64>, f64)> {
    let mut pose = *start;
    let (mut cost, mut hessian, mut gradient) = normal_equations(seen, intrinsics, &pose)?;
    let mut damping = 1e-6;
    for _ in 0..MAX_STEPS {
        let mut damped = hessian;
        for i in 0..6 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step: Vector6<f64> = -damped.cholesky()?.solve(&gradient);
        let candidate = pose * crate::se3::exp(&step);
        match normal_equations(seen, intrinsics, &candidate) {
            Some((new_cost, new_hessian, new_gradient)) if new_cost <= cost => {
                (pose, cost, hessian, gradient) = (candidate, new_cost, new_hessian, new_gradient);
                damping = f64::max(damping * 0.1, 1e-12);
            }
            _ => damping = f64::max(damping * 10.0, 1e-6),
        }
        let distance = pose.translation.vector.norm();
        let small = step.fixed_rows::<3>(0).norm() < CONVERGED * distance && step.fixed_rows::<3>(3).norm() < CONVERGED;
        if small || damping > 1e8 {
            break;
        }
    }
    Some((pose, (cost / seen.len() as f64).sqrt()))
}

/// Sum of squared errors, JᵀJ and Jᵀr by the pose's right perturbation; `None` when a corner has no image.
fn normal_equations(
    seen: &[(Point3<f64>, Vector2<f64>)],
    intrinsics: &Intrinsics,
    pose: &Isometry3<f64>,
) -> Option<(f64, Matrix6<f64>, Vector6<f64>)> {
    let mut cost = 0.0;
    let mut hessian = Matrix6::zeros();
    let mut gradient = Vector6::zeros();
    let rotation = pose.rotation.to_rotation_matrix();
    for (point, px) in seen {
        let projection = intrinsics.project_with_jacobians(&(pose * point)).ok()?;
        let residual = projection.px - px;
        let by_pose = px_by_pose(&projection.px_by_point, rotation.matrix(), point);
        cost += residual.norm_squared();
        hessian += by_pose.transpose() * by_pose;
        gradient += by_pose.transpose() * residual;
    }
    cost.is_finite().then_some((cost, hessian, gradient))
}

/// Derivative of a pixel by `delta` in `project(pose * exp(delta) * point)`.
pub(crate) fn px_by_pose(
    px_by_point: &nalgebra::Matrix2x3<f64>,
    rotation: &Matrix3<f64>,
    point: &Point3<f64>,
) -> SMatrix<f64, 2, 6> {
    let by_translation = px_by_point * rotation;
    let by_rotation = -by_translation * crate::se3::skew(&point.coords);
    let mut out = SMatrix::<f64, 2, 6>::zeros();
    out.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_translation);
    out.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_rotation);
    out
}
