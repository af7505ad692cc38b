//! Pose of a flat target in the camera from its corners.
//!
//! A flat target seen from afar has two poses that explain it almost equally well, mirrored about the line of sight. Both
//! are refined, and the caller is told how clear the choice is.
//!
//! Reference: Schweighofer & Pinz 2006, "Robust pose estimation from a planar target"; Hartley & Zisserman 2004, §4.1
//! (homography).

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, SMatrix, SVector, SymmetricEigen, Translation3, UnitQuaternion, Vector2,
    Vector3, Vector6,
};

use super::VisionError;
use crate::camera::Intrinsics;
use crate::frames::{Camera, Pose, Target};
use crate::observation::Corner;
use crate::se3;
use crate::target::TargetSpec;

/// Least number of corners.
const NEED: usize = 4;
/// Steps of the refinement.
const MAX_STEPS: usize = 50;
/// A refinement ends when the cost falls by less than this part.
const COST_TOLERANCE: f64 = 1e-14;

/// A pose and how well it fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose {
    /// Target in the camera.
    pub camera_from_target: Pose<Camera, Target>,
    /// RMS of the 2-D residuals, pixels.
    pub rms_px: f64,
    /// The mirrored pose, where it is a second minimum in front of the camera, and its RMS in pixels.
    pub second: Option<(Pose<Camera, Target>, f64)>,
}

impl PlanarPose {
    /// RMS of this pose over that of the mirrored one: near 0 the choice is clear, near 1 it is a guess.
    pub fn ambiguity(&self) -> f64 {
        self.second.map_or(0.0, |(_, second)| if second > 0.0 { self.rms_px / second } else { 1.0 })
    }
}

/// Estimates `camera_from_target` by least squares of the reprojection error, for every lens model.
///
/// # Needs
/// Four corners, not on a line, seen in front of the camera plane.
///
/// # Errors
/// [`VisionError::TooFewCorners`], [`VisionError::NoPose`].
pub fn camera_from_target(
    corners: &[Corner],
    target: &TargetSpec,
    intrinsics: &Intrinsics,
) -> Result<PlanarPose, VisionError> {
    if corners.len() < NEED {
        return Err(VisionError::TooFewCorners { got: corners.len(), need: NEED });
    }
    let grid = target.grid();
    let points: Vec<Point3<f64>> = corners.iter().map(|c| grid.point(c.index)).collect();
    let problem = Problem { points: &points, corners, intrinsics };
    let start = from_homography(&problem)?;
    let first = problem.refine(start);
    let (first, first_cost) = first.ok_or(VisionError::NoPose { reason: "the fit puts it behind the camera" })?;
    let mirrored = problem.refine(mirrored(&first, &centroid(&points)));
    let rms = |cost: f64| (cost / corners.len() as f64).sqrt();
    // The same minimum reached twice is no ambiguity.
    let other = mirrored.filter(|(pose, _)| pose.rotation.angle_to(&first.rotation) > 1e-3);
    let ((best, best_cost), second) = match other {
        Some((pose, cost)) if cost < first_cost => ((pose, cost), Some((first, first_cost))),
        other => ((first, first_cost), other),
    };
    Ok(PlanarPose {
        camera_from_target: Pose::from_isometry(best),
        rms_px: rms(best_cost),
        second: second.map(|(pose, cost)| (Pose::from_isometry(pose), rms(cost))),
    })
}

struct Problem<'a> {
    points: &'a [Point3<f64>],
    corners: &'a [Corner],
    intrinsics: &'a Intrinsics,
}

impl Problem<'_> {
    /// Sum of squared residuals; `None` when a point is behind the camera.
    fn cost(&self, pose: &Isometry3<f64>) -> Option<f64> {
        self.points
            .iter()
            .zip(self.corners)
            .map(|(point, corner)| Some((self.intrinsics.project(&(pose * point)).ok()? - corner.px).norm_squared()))
            .sum()
    }

    /// Levenberg–Marquardt; the pose and its cost.
    fn refine(&self, start: Isometry3<f64>) -> Option<(Isometry3<f64>, f64)> {
        let mut pose = start;
        let mut cost = self.cost(&pose)?;
        let mut damping = 1e-3;
        for _ in 0..MAX_STEPS {
            let (normal, gradient) = self.normal_equations(&pose)?;
            let before = cost;
            while damping < 1e10 {
                let damped = normal + Matrix6::from_diagonal(&(normal.diagonal() * damping));
                let next = damped.cholesky().map(|c| pose * se3::exp(&-c.solve(&gradient)));
                match next.and_then(|p| Some((p, self.cost(&p)?))) {
                    Some((next_pose, next_cost)) if next_cost <= cost => {
                        (pose, cost) = (next_pose, next_cost);
                        damping = (damping * 0.1).max(1e-12);
                        break;
                    }
                    _ => damping *= 10.0,
                }
            }
            if before - cost <= COST_TOLERANCE * before {
                break;
            }
        }
        Some((pose, cost))
    }

    fn normal_equations(&self, pose: &Isometry3<f64>) -> Option<(Matrix6<f64>, Vector6<f64>)> {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let mut normal = Matrix6::zeros();
        let mut gradient = Vector6::zeros();
        for (point, corner) in self.points.iter().zip(self.corners) {
            let projection = self.intrinsics.project_with_jacobians(&(pose * point)).ok()?;
            let by_point = projection.px_by_point * rotation;
            let mut jacobian = SMatrix::<f64, 2, 6>::zeros();
            jacobian.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_point);
            jacobian.fixed_view_mut::<2, 3>(0, 3).copy_from(&(-by_point * se3::skew(&point.coords)));
            normal += jacobian.transpose() * jacobian;
            gradient += jacobian.transpose() * (projection.px - corner.px);
        }
        Some((normal, gradient))
    }
}

fn centroid(points: &[Point3<f64>]) -> Point3<f64> {
    Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64)
}

/// The pose whose plane is tilted the other way about the line of sight to the target's middle.
fn mirrored(pose: &Isometry3<f64>, centre: &Point3<f64>) -> Isometry3<f64> {
    let middle = pose * centre;
    let sight = middle.coords.normalize();
    let normal = pose.rotation * Vector3::z();
    // Turning the normal by twice its angle to the line of sight mirrors it about that line.
    let axis = normal.cross(&sight);
    let angle = 2.0 * axis.norm().atan2(normal.dot(&sight));
    let turn = axis.try_normalize(1e-12).map_or_else(UnitQuaternion::identity, |axis| {
        UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_unchecked(axis), angle)
    });
    let rotation = turn * pose.rotation;
    Isometry3::from_parts(Translation3::from(middle.coords - rotation * centre.coords), rotation)
}

/// A start from the homography between the target's plane and the undistorted image plane.
fn from_homography(problem: &Problem<'_>) -> Result<Isometry3<f64>, VisionError> {
    let rays: Vec<Vector2<f64>> = problem
        .corners
        .iter()
        .map(|corner| {
            let ray = problem.intrinsics.unproject(&corner.px).ok().filter(|ray| ray.z > 1e-3);
            ray.map(|ray| Vector2::new(ray.x / ray.z, ray.y / ray.z))
                .ok_or(VisionError::NoPose { reason: "a corner lies outside the range of the lens model" })
        })
        .collect::<Result<_, _>>()?;
    let plane: Vec<Vector2<f64>> = problem.points.iter().map(|p| p.coords.xy()).collect();
    let h = homography(&plane, &rays).ok_or(VisionError::NoPose { reason: "the corners lie on a line" })?;
    let (a, b, t) = (h.column(0).into_owned(), h.column(1).into_owned(), h.column(2).into_owned());
    let mut scale = 2.0 / (a.norm() + b.norm());
    // In front of the camera.
    if t.z < 0.0 {
        scale = -scale;
    }
    let (a, b, t) = (a * scale, b * scale, t * scale);
    let rotation = se3::nearest_rotation(&Matrix3::from_columns(&[a, b, a.cross(&b)]));
    if !(scale.is_finite() && t.z > 0.0) {
        return Err(VisionError::NoPose { reason: "the corners lie on a line" });
    }
    Ok(Isometry3::from_parts(Translation3::from(t), UnitQuaternion::from_rotation_matrix(&rotation)))
}

/// Shift and scale that bring points to mean zero and mean distance √2.
fn normalisation(points: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector2<f64>>() / n;
    let distance = points.iter().map(|p| (p - mean).norm()).sum::<f64>() / n;
    (distance > 0.0).then(|| {
        let s = std::f64::consts::SQRT_2 / distance;
        Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0)
    })
}

/// Direct linear transform on normalised coordinates; `None` for points on a line.
fn homography(from: &[Vector2<f64>], to: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    let (normalise_from, normalise_to) = (normalisation(from)?, normalisation(to)?);
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (p, q) in from.iter().zip(to) {
        let p = normalise_from * p.push(1.0);
        let q = normalise_to * q.push(1.0);
        let zero = Vector3::zeros();
        for (first, second, third) in [(zero, -p, p * q.y), (p, zero, -p * q.x)] {
            let row = SVector::<f64, 9>::from_iterator(first.iter().chain(second.iter()).chain(third.iter()).copied());
            normal.ger(1.0, &row, &row, 1.0);
        }
    }
    let eigen = SymmetricEigen::new(normal);
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    // Two vanishing eigenvalues: more than one homography fits, the points lie on a line.
    if eigen.eigenvalues[order[1]] < 1e-9 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h = eigen.eigenvectors.column(order[0]);
    let h = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
    Some(normalise_to.try_inverse()? * h * normalise_from)
}
