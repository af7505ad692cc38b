//! Where the optimisation starts: a focal length from homographies, or the best of a sweep; then the poses.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

use super::adjust::{Problem, refine_pose};
use super::homography;
use super::{IntrinsicsError, MIN_CORNERS, SeenView};
use crate::board_shape::{BoardPoints, BoardShape};
use crate::camera::{Distortion, Intrinsics};
use crate::progress::CancelToken;

/// Focal lengths that a camera may have, as parts of its larger side: from 160° of view to a long telephoto lens.
const FOCAL_RANGE: (f64, f64) = (0.1, 20.0);
/// Ratio of neighbouring focal lengths of the sweep. From a focal length that is wrong by a tenth every optimisation
/// that was tried converges.
const SWEEP_RATIO: f64 = 1.25;
/// Views that judge the focal lengths of the sweep.
const SWEEP_VIEWS: usize = 12;
/// Steps of their poses: enough to tell which focal length is near.
const SWEEP_STEPS: usize = 4;
/// Most optimisations from the sweep.
const SWEEP_STARTS: usize = 4;
/// Smallest cosine to the optical axis of the rays that start a pose: the plane z = 1 has no room for more.
const MIN_RAY_Z: f64 = 0.05;

/// The map of the target's plane to the image in every view, `None` where the corners determine none.
pub(super) struct Planes(Vec<Option<Matrix3<f64>>>);

impl Planes {
    pub fn new(views: &[SeenView<'_>], board: &BoardPoints, cancel: &CancelToken) -> Result<Self, IntrinsicsError> {
        let mut all = Vec::with_capacity(views.len());
        let mut pairs = Vec::new();
        for view in views {
            if cancel.is_cancelled() {
                return Err(IntrinsicsError::Cancelled);
            }
            pairs.clear();
            pairs.extend(view.corners.iter().map(|c| (board.drawn()[c.index].coords.xy(), c.px)));
            all.push(homography::fit(&pairs));
        }
        Ok(Self(all))
    }

    /// Largest angle between the target's normals in two views, found as the farthest from the normal that is farthest
    /// from their mean.
    ///
    /// The homography `H` from the target to the image sends the line at infinity to `H⁻ᵀ e₃`, and the normal in the
    /// camera is `Kᵀ` of that. A wrong focal length stretches the angles and leaves parallel normals parallel.
    pub fn normal_spread_deg(&self, nominal: &Intrinsics) -> f64 {
        let to_camera = nominal.matrix().transpose();
        let normal = |plane: &Matrix3<f64>| {
            let normal = to_camera * plane.try_inverse()?.transpose() * Vector3::z();
            let length = normal.norm();
            (length > 0.0 && length.is_finite()).then(|| normal * (normal.z.signum() / length))
        };
        let normals: Vec<Vector3<f64>> = self.0.iter().flatten().filter_map(normal).collect();
        let mean: Vector3<f64> = normals.iter().sum();
        let farthest = |from: &Vector3<f64>| {
            normals.iter().map(|n| (from.angle(n), *n)).fold((0.0, *from), |far, n| if n.0 > far.0 { n } else { far })
        };
        let (_, end) = farthest(&mean);
        farthest(&end).0.to_degrees()
    }

    /// `camera` with the focal length that the homographies suggest, one for both axes, its principal point kept; `None`
    /// where they suggest none, and for the fisheye, to whose images they do not apply.
    ///
    /// The columns of `K⁻¹ H` for x and y are perpendicular and of equal length: two equations per view that are linear
    /// in `1 / f²` (Zhang 2000, eq. 3 and 4).
    pub fn focal_start(&self, camera: &Intrinsics) -> Option<Intrinsics> {
        if matches!(camera.distortion, Distortion::Fisheye(_)) {
            return None;
        }
        let side = f64::from(camera.width.max(camera.height));
        let (mut pp, mut pq) = (0.0, 0.0);
        for plane in self.0.iter().flatten() {
            let column = |i: usize| {
                let c = plane.column(i);
                Vector3::new((c.x - camera.cx * c.z) / side, (c.y - camera.cy * c.z) / side, c.z)
            };
            let (a, b) = (column(0), column(1));
            let size = a.norm_squared() + b.norm_squared();
            let equations = [
                (a.x * b.x + a.y * b.y, a.z * b.z),
                (0.5 * (a.xy().norm_squared() - b.xy().norm_squared()), 0.5 * (a.z * a.z - b.z * b.z)),
            ];
            for (p, q) in equations {
                pp += (p / size).powi(2);
                pq += (p / size) * (q / size);
            }
        }
        let focal = (-pp / pq).sqrt();
        let fits = focal >= FOCAL_RANGE.0 && focal <= FOCAL_RANGE.1;
        fits.then_some(Intrinsics { fx: focal * side, fy: focal * side, ..*camera })
    }
}

/// The target's pose in every view, for a camera; `None` where a view has none.
pub(super) fn poses(
    problem: &Problem<'_>,
    camera: &Intrinsics,
) -> Result<Option<Vec<Isometry3<f64>>>, IntrinsicsError> {
    let mut poses = Vec::with_capacity(problem.views.len());
    for view in problem.views {
        if problem.cancel.is_cancelled() {
            return Err(IntrinsicsError::Cancelled);
        }
        match pose(view, problem.board, camera) {
            Some(pose) => poses.push(pose),
            None => return Ok(None),
        }
    }
    Ok(Some(poses))
}

/// The pose whose plane maps to the rays of the corners, from their homography.
fn pose(view: &SeenView<'_>, board: &BoardPoints, camera: &Intrinsics) -> Option<Isometry3<f64>> {
    let mut pairs: Vec<(Vector2<f64>, Vector2<f64>)> = Vec::with_capacity(view.corners.len());
    for corner in view.corners {
        if let Ok(ray) = camera.unproject(&corner.px)
            && ray.z > MIN_RAY_Z
        {
            pairs.push((board.drawn()[corner.index].coords.xy(), ray.xy() / ray.z));
        }
    }
    if pairs.len() < MIN_CORNERS {
        return None;
    }
    let plane = homography::fit(&pairs)?;
    let [a, b, c] = [0, 1, 2].map(|i| plane.column(i).into_owned());
    let size = 0.5 * (a.norm() + b.norm());
    // The nearest pair of perpendicular unit vectors: the diagonals of a rhombus are perpendicular.
    let (a, b) = (a.try_normalize(0.0)?, b.try_normalize(0.0)?);
    let (sum, difference) = ((a + b).try_normalize(0.0)?, (a - b).try_normalize(0.0)?);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let (x, y) = ((sum + difference) * half, (sum - difference) * half);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
    let translation = c / size;
    let pose = Isometry3::from_parts(Translation3::from(translation), UnitQuaternion::from_rotation_matrix(&rotation));
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|v| v.is_finite()).then_some(pose)
}

/// Cameras of many focal lengths without distortion, the most promising first: those that fit some of the views best.
pub(super) fn sweep(problem: &Problem<'_>, camera: &Intrinsics) -> Result<Vec<Intrinsics>, IntrinsicsError> {
    let side = f64::from(camera.width.max(camera.height));
    let count = problem.views.len();
    let judges: Vec<&SeenView<'_>> = if count <= SWEEP_VIEWS {
        problem.views.iter().collect()
    } else {
        (0..SWEEP_VIEWS).map(|i| &problem.views[i * count / SWEEP_VIEWS]).collect()
    };
    let mut ranked = Vec::new();
    let mut focal = FOCAL_RANGE.0;
    while focal <= FOCAL_RANGE.1 {
        if problem.cancel.is_cancelled() {
            return Err(IntrinsicsError::Cancelled);
        }
        let candidate = Intrinsics { fx: focal * side, fy: focal * side, ..*camera };
        let cost: Option<f64> = judges
            .iter()
            .map(|view| {
                let start = pose(view, problem.board, &candidate)?;
                let shape = BoardShape::default();
                refine_pose(view, problem.board, &shape, &candidate, &start, SWEEP_STEPS).map(|(_, cost)| cost)
            })
            .sum();
        ranked.extend(cost.filter(|cost| cost.is_finite()).map(|cost| (cost, candidate)));
        focal *= SWEEP_RATIO;
    }
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(ranked.into_iter().take(SWEEP_STARTS).map(|(_, camera)| camera).collect())
}
