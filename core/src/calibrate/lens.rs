//! The camera, and the target's pose in every view that goes with it.

use nalgebra::{Matrix3, SVector, Vector3};

use super::corners::Seen;
use super::{CalibrateError, CameraKnowledge, Observations};
use crate::camera::Intrinsics;
use crate::frames::{Camera, Pose, Target};
use crate::handeye::HandEyeError;
use crate::observation::Corner;
use crate::progress::{Stage, Work};
use crate::target::TargetSpec;
use crate::vision::{intrinsics, pnp};

/// Most views that go into OpenCV's calibration of the camera, which cannot be interrupted and takes a time that grows
/// with the cube of the views: sixty take seconds.
pub const MOST_LENS_VIEWS: usize = 60;
/// How many of more views are taken where the joint estimate refines the camera with all views anyway. A start needs to
/// be near, not precise, and thirty take less than a second.
pub const LENS_START_VIEWS: usize = 30;

/// Camera and target poses.
pub struct Lens {
    pub intrinsics: Intrinsics,
    pub free: bool,
    pub sigma: Option<[f64; 4]>,
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    pub rms_px: Vec<f64>,
}

impl Lens {
    /// `refined` says that the joint estimate will refine the camera with all views.
    pub fn find(
        observations: &Observations,
        seen: &[Seen<'_>],
        refined: bool,
        work: &Work<'_>,
    ) -> Result<Self, CalibrateError> {
        let (intrinsics, free, sigma) = match observations.camera {
            CameraKnowledge::Fixed(intrinsics) => (intrinsics, false, None),
            CameraKnowledge::Estimate { model, start } => {
                work.report(Stage::Intrinsics, 0, 1);
                let most = if refined { LENS_START_VIEWS } else { MOST_LENS_VIEWS };
                let chosen = if seen.len() <= MOST_LENS_VIEWS {
                    seen.iter().map(|s| s.corners).collect()
                } else {
                    most_different(observations, seen, most, work)?
                };
                let found =
                    intrinsics::calibrate(&chosen, &observations.target, observations.image_size, model, start)?;
                let sigma = found.sigma;
                (found.intrinsics, true, Some([sigma.fx, sigma.fy, sigma.cx, sigma.cy]))
            }
        };
        let mut camera_from_target = Vec::with_capacity(seen.len());
        let mut rms_px = Vec::with_capacity(seen.len());
        for (done, s) in seen.iter().enumerate() {
            if work.is_cancelled() {
                return Err(HandEyeError::Cancelled.into());
            }
            work.report(Stage::TargetPoses, done, seen.len());
            let pose = pnp::solve(s.corners, &observations.target, &intrinsics)?.best;
            camera_from_target.push(pose.camera_from_target);
            rms_px.push(pose.rms_px);
        }
        Ok(Self { intrinsics, free, sigma, camera_from_target, rms_px })
    }
}

/// Where and how the target lies in the image: see [`appearance`].
type Appearance = SVector<f64, 6>;

/// The corners of `most` views of a larger number, in the order of the views: those that differ most from each other
/// hold what there is to know of the lens, but for the averaging of noise.
///
/// Each next view is the one farthest from those taken (Gonzalez 1985, "Clustering to minimize the maximum intercluster
/// distance"), measured by [`appearance`].
fn most_different<'a>(
    observations: &Observations,
    seen: &[Seen<'a>],
    most: usize,
    work: &Work<'_>,
) -> Result<Vec<&'a [Corner]>, CalibrateError> {
    let (width, height) = observations.image_size;
    let side = f64::from(width.max(height)).max(1.0);
    let appearances: Vec<Appearance> = seen.iter().map(|s| appearance(s.corners, &observations.target, side)).collect();
    let mut distance = vec![f64::INFINITY; seen.len()];
    let mut chosen = Vec::with_capacity(most);
    let mut next = 0;
    while chosen.len() < most.min(seen.len()) {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled.into());
        }
        chosen.push(next);
        for (d, a) in distance.iter_mut().zip(&appearances) {
            *d = d.min((a - appearances[next]).norm_squared());
        }
        // A view that is taken has distance 0 and is never the farthest while another differs; where all are alike the
        // next one not taken does.
        distance[next] = f64::NEG_INFINITY;
        next = (0..distance.len()).fold(0, |best, i| if distance[i] > distance[best] { i } else { best });
    }
    chosen.sort_unstable();
    Ok(chosen.into_iter().map(|i| seen[i].corners).collect())
}

/// The affine map from the target, scaled to its own size, to the image, scaled to the larger side: six numbers that
/// tell place, size, roll and foreshortening. Zero for corners that determine none.
fn appearance(corners: &[Corner], target: &TargetSpec, side_px: f64) -> Appearance {
    let grid = target.grid();
    let half = grid.square_m * grid.columns.max(grid.rows) as f64 / 2.0;
    let centre = target.centre();
    let mut normal = Matrix3::zeros();
    let (mut by_u, mut by_v) = (Vector3::zeros(), Vector3::zeros());
    for corner in corners.iter().filter(|c| c.index < grid.len()) {
        let on_target = (grid.point(corner.index) - centre) / half;
        let row = Vector3::new(on_target.x, on_target.y, 1.0);
        normal += row * row.transpose();
        by_u += row * (corner.px.x / side_px);
        by_v += row * (corner.px.y / side_px);
    }
    let Some(inverse) = normal.try_inverse() else { return Appearance::zeros() };
    let (u, v) = (inverse * by_u, inverse * by_v);
    let all = Appearance::new(u.x, u.y, u.z, v.x, v.y, v.z);
    if all.iter().all(|x| x.is_finite()) { all } else { Appearance::zeros() }
}
