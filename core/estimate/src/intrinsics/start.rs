//! Where the optimisation starts: a focal length from homographies, or the best of a sweep; then the poses.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::adjust::{Problem, seen};
use super::{IntrinsicsError, SeenView};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::planar_pose::homography::homography;
use handeye_geometry::planar_pose::refine::refine;
use handeye_geometry::planar_pose::start::{pair, starts};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};

/// Focal lengths that a camera may have, as parts of its larger side: from 160° of view to a long telephoto lens.
const FOCAL_RANGE: (f64, f64) = (0.1, 20.0);
/// Ratio of neighbouring focal lengths of the sweep. From a focal length that is wrong by a tenth every optimisation
/// that was tried converges.
const SWEEP_RATIO: f64 = 1.25;
/// Views that judge the focal lengths of the sweep.
const SWEEP_VIEWS: usize = 12;
/// Steps of their poses: enough to determine which focal length is near.
const SWEEP_STEPS: usize = 4;
/// Most optimisations from the sweep.
const SWEEP_STARTS: usize = 4;

/// The map of the target's plane to the image in every view, `None` where the corners do not determine it.
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
            all.push(homography(&pairs));
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
        match pose(problem, view, camera) {
            Some(pose) => poses.push(pose),
            None => return Ok(None),
        }
    }
    Ok(Some(poses))
}

/// The better of both starts of a pose, from the corners that have a ray.
fn pose(problem: &Problem<'_>, view: &SeenView<'_>, camera: &Intrinsics) -> Option<Isometry3<f64>> {
    let seen = seen(view, problem.board, &BoardShape::FLAT, camera);
    let pairs: Vec<_> = view.corners.iter().filter_map(|corner| pair(&seen, corner).ok().flatten()).collect();
    starts(&pairs).map(|[best, _]| best)
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
                let start = pose(problem, view, &candidate)?;
                let seen = seen(view, problem.board, &BoardShape::FLAT, &candidate);
                refine(&seen, &start, SWEEP_STEPS).map(|minimum| minimum.squared_px)
            })
            .sum();
        ranked.extend(cost.filter(|cost| cost.is_finite()).map(|cost| (cost, candidate)));
        focal *= SWEEP_RATIO;
    }
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(ranked.into_iter().take(SWEEP_STARTS).map(|(_, camera)| camera).collect())
}
