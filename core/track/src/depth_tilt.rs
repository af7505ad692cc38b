//! Tilt of the board from its depths: a pose from corners determines it worst, and depths of a plane best.
//!
//! Over a plane `n · X = h` the inverse depth is linear in the ray `(x, y, 1)` of a pixel: `1/z = c · (x, y, 1)` with `c = n /
//! h`. Its two slopes determine the tilt; the constant is free, so that an error of the depth camera in the board's distance
//! does not matter. A renderer's polygon offset, which adds a part of the depth's slope in a pixel, is a constant of the
//! inverse depth as well and drops out.
//!
//! The noise is that of the depths themselves, and counts as if all of it were common to the whole board, because the errors
//! of a depth camera are correlated between neighbours: `N` depths determine the slopes as well as one plane of their
//! scatter. An error of scale or offset makes slopes wrong by as much as distances; its size follows from the distance of
//! the board by its corners.

use nalgebra::{Isometry3, Matrix2, Matrix2x6, Matrix3, Matrix6, Vector2, Vector3, Vector6};

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::{DepthImage, outlier_reach_m};
use handeye_geometry::se3;
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::TargetSpec;

/// Least part of the places that have a depth of the board's plane: with fewer an object in front of the board may be
/// mistaken for it.
const LEAST: f64 = 0.3;
const ROUNDS: usize = 4;
/// An error of scale makes the slopes wrong by as much as the distance, and an offset by twice as much.
const BY_DISTANCE: f64 = 2.0;
/// Squared distance, in standard deviations of both, that tilts by corners and by depth stay below by chance in all but one
/// image in ten thousand; where they differ by more the depth counts for as much less.
const AGREES: f64 = 18.4;
/// Steps of a pose to the optimum of corners and tilt.
const STEPS: usize = 4;

/// Slopes of the inverse depth along x and y of the rays, 1/m.
#[derive(Debug, Clone, Copy)]
pub(super) struct DepthTilt {
    slopes: Vector2<f64>,
    covariance: Matrix2<f64>,
}

/// A pose with the tilt by depth in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tilted {
    pub camera_from_target: Isometry3<f64>,
    /// Right perturbation `[t; r]`.
    pub covariance: Matrix6<f64>,
}

impl DepthTilt {
    /// For a board near `camera_from_target`; `None` where too little of it has depths of one plane.
    pub fn new(
        depth: &DepthImage,
        far_m: f32,
        camera: &Intrinsics,
        target: &TargetSpec,
        camera_from_target: &Isometry3<f64>,
    ) -> Option<Self> {
        let places = target.places_all_over();
        let mut samples: Vec<Sample> = Vec::with_capacity(places.len());
        for place in &places {
            let point = camera_from_target * place;
            let Ok(px) = camera.project(&point) else { continue };
            let Some(depth_m) = depth.at(px, far_m) else { continue };
            let ray = Vector3::new(point.x / point.z, point.y / point.z, 1.0);
            samples.push(Sample { ray, inverse: 1.0 / depth_m, depth_m, off_m: depth_m - point.z });
        }
        // A common offset of all depths does not affect the tilt.
        let middle = median_high(samples.iter().map(|sample| sample.off_m))?;
        for sample in &mut samples {
            sample.off_m -= middle;
        }
        keep_near(&mut samples);
        let least = (LEAST * places.len() as f64) as usize;
        let mut plane = None;
        for _ in 0..ROUNDS {
            if samples.len() < least.max(4) {
                return None;
            }
            let found = Plane::of(&samples)?;
            for sample in &mut samples {
                sample.off_m = (1.0 / found.inverse.dot(&sample.ray)) - sample.depth_m;
            }
            let before = samples.len();
            plane = Some(found);
            keep_near(&mut samples);
            if samples.len() == before {
                break;
            }
        }
        let plane = plane?;
        let count = samples.len() as f64;
        let squared = |sample: &Sample| (plane.inverse.dot(&sample.ray) - sample.inverse).powi(2);
        let variance = samples.iter().map(squared).sum::<f64>() / (count - 3.0);
        let by_chance = plane.information.try_inverse()? * (variance * count);
        let middle = camera_from_target * target.centre();
        let ray = middle.coords / middle.z;
        let farther = plane.inverse.dot(&ray) * middle.z - 1.0;
        let slopes: Vector2<f64> = plane.inverse.xy();
        let of_scale = slopes * (BY_DISTANCE * farther);
        let covariance: Matrix2<f64> = by_chance.fixed_view::<2, 2>(0, 0) + of_scale * of_scale.transpose();
        let usable = covariance.iter().chain(&slopes).all(|value| value.is_finite());
        usable.then_some(Self { slopes, covariance })
    }

    /// A pose by corners, with its covariance, and this tilt together; `None` where the covariance has no inverse.
    pub fn with(&self, by_corners: &Isometry3<f64>, covariance: &Matrix6<f64>) -> Option<Tilted> {
        let corners = covariance.cholesky()?.inverse();
        let (expected, by_pose) = slopes_at(by_corners)?;
        let apart = self.slopes - expected;
        let spread = (self.covariance + by_pose * covariance * by_pose.transpose()).try_inverse()?;
        let too_far = (apart.dot(&(spread * apart)) / AGREES).max(1.0);
        let information = (self.covariance * too_far).try_inverse()?;
        let mut pose = *by_corners;
        let mut whole = corners;
        for _ in 0..STEPS {
            let (expected, by_pose) = slopes_at(&pose)?;
            whole = corners + by_pose.transpose() * information * by_pose;
            let gone: Vector6<f64> = se3::log(&(by_corners.inverse() * pose));
            let pull = by_pose.transpose() * (information * (self.slopes - expected)) - corners * gone;
            pose *= se3::exp(&whole.cholesky()?.solve(&pull));
        }
        Some(Tilted { camera_from_target: pose, covariance: whole.cholesky()?.inverse() })
    }
}

struct Sample {
    ray: Vector3<f64>,
    inverse: f64,
    depth_m: f64,
    off_m: f64,
}

/// A plane by its inverse depth.
struct Plane {
    inverse: Vector3<f64>,
    /// Its information matrix, for samples of a variance of one.
    information: Matrix3<f64>,
}

impl Plane {
    fn of(samples: &[Sample]) -> Option<Self> {
        let (mut information, mut pull) = (Matrix3::zeros(), Vector3::zeros());
        for sample in samples {
            information += sample.ray * sample.ray.transpose();
            pull += sample.ray * sample.inverse;
        }
        Some(Self { inverse: information.cholesky()?.solve(&pull), information })
    }
}

fn keep_near(samples: &mut Vec<Sample>) {
    let off: Vec<f64> = samples.iter().map(|sample| sample.off_m.abs()).collect();
    let reach = outlier_reach_m(&off);
    samples.retain(|sample| sample.off_m.abs() <= reach);
}

/// The slopes of the inverse depth of the board at a pose, and how they turn with it (right perturbation).
fn slopes_at(camera_from_target: &Isometry3<f64>) -> Option<(Vector2<f64>, Matrix2x6<f64>)> {
    let rotation = camera_from_target.rotation.to_rotation_matrix().into_inner();
    let (x, y, normal) = (rotation.column(0), rotation.column(1), rotation.column(2).into_owned());
    let place = camera_from_target.translation.vector;
    let height = normal.dot(&place);
    if height.abs() < f64::EPSILON {
        return None;
    }
    // A turn (a, b, ·) of the target moves its normal by b x − a y, a shift along it the height.
    let mut by_pose = Matrix2x6::zeros();
    for (column, moved) in [(3, -y), (4, x.into_owned())] {
        let by = moved / height - normal * (moved.dot(&place) / height.powi(2));
        by_pose.set_column(column, &by.xy());
    }
    by_pose.set_column(2, &(-normal / height.powi(2)).xy());
    Some(((normal / height).xy(), by_pose))
}

#[cfg(test)]
#[path = "depth_tilt_tests.rs"]
mod tests;
