//! Calibration of a camera from views of a flat target.
//!
//! # What it estimates
//! Focal lengths, principal point and distortion of one lens model, the target's pose in every view and, where it is
//! asked for, the bend of the target ([`BoardShape`]). The estimate minimises the squared reprojection error
//! `Σ ‖W (project(camera_from_target_i * point_j) − px_ij)‖²`, where `W` is the whitener of a corner, or the identity.
//! For independent Gaussian noise of the corners that is the maximum of the likelihood.
//!
//! # How
//! A start from homographies ([`start`]), then Levenberg–Marquardt on all unknowns at once, with analytic Jacobians and
//! the poses eliminated view by view ([`adjust`]): time and memory grow linearly with the number of views. At the
//! optimum every pose is tried against its mirror image, the second minimum that a flat target has. All sums run in the
//! order of the views, so the same input gives the same bits.
//!
//! # Reference
//! Zhang 2000, "A flexible new technique for camera calibration"; Triggs et al. 2000, "Bundle adjustment — a modern
//! synthesis", §6; Kannala & Brandt 2006 for the fisheye.

mod adjust;
mod error;
mod information;
mod seen_view;
mod start;

pub use error::IntrinsicsError;
use nalgebra::DMatrix;
pub use seen_view::SeenView;

use crate::estimate::handeye::joint::equations::FreeParameters;
use crate::geometry::camera::Distortion;
use crate::geometry::camera::Intrinsics;
use crate::geometry::frames::{Camera, Pose, Target};
use crate::geometry::planar_pose;
use crate::progress::CancelToken;
use crate::targets::TargetSpec;
use crate::targets::bent::{BoardPoints, BoardShape};

use adjust::{Estimate, Problem};

/// Views that a calibration needs: two orientations determine the four numbers of a pinhole, a third checks them.
pub const MIN_VIEWS: usize = 3;
/// Normals of the target that agree within this angle \[deg\] in all views leave the focal length undetermined.
const MIN_SPREAD_DEG: f64 = 2.0;
/// Rounds of mirrored poses and optimum at the most; one is usual.
const MIRROR_ROUNDS: usize = 4;

/// What to estimate, and from where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The lens model; its coefficients do not matter.
    pub model: Distortion,
    /// Where to start; `None` finds a start from the views. Its distortion counts only when it is of the same model.
    pub start: Option<Intrinsics>,
    /// Whether the bend of the target is estimated too. A bent target that is taken for flat moves the camera by far
    /// more than the noise of its corners, and a flat one that is taken for bent costs little.
    pub free_warp: bool,
}

impl Options {
    /// A model on a flat target, without a start.
    pub fn new(model: Distortion) -> Self {
        Self { model, start: None, free_warp: false }
    }
}

/// A calibrated camera with the evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// The target: flat where its bend was not estimated.
    pub shape: BoardShape,
    /// The target's pose in each view, in the order given.
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    /// Root mean square of the 2-D residuals of each view, in the order given, pixels, without whiteners.
    pub rms_px: Vec<f64>,
    /// The cost at the optimum, `Σ ‖W r‖²`: squared pixels where all corners count alike.
    pub cost: f64,
    /// Number of corners in all views.
    pub corners: usize,
    /// Standard deviation per axis of a whitened residual, `√(cost / (2 corners − unknowns))`: pixels where all corners
    /// count alike. Not a number where there are no more residuals than unknowns.
    pub sigma: f64,
    /// Covariance of `[fx fy cx cy, distortion…, warp x, warp y]` for whitened residuals of standard deviation 1; the
    /// warp only where it was estimated. The poses are unknowns in it, not constants.
    pub unit_covariance: DMatrix<f64>,
    /// Steps of the optimiser.
    pub steps: usize,
}

impl Found {
    /// Root mean square of the 2-D residuals of all views, pixels; without whiteners.
    pub fn total_rms_px(&self) -> f64 {
        (self.cost / self.corners as f64).sqrt()
    }

    /// Standard deviations of fx, fy, cx and cy in pixels, for independent corner noise of the size that the residuals
    /// show. Errors of the board (bent, misprinted) are not in them.
    pub fn pinhole_sigma_px(&self) -> [f64; 4] {
        std::array::from_fn(|i| self.sigma * self.unit_covariance[(i, i)].sqrt())
    }

    /// Covariance of `[fx fy cx cy, distortion…, warp x, warp y]` for the noise that the residuals show.
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.unit_covariance * (self.sigma * self.sigma)
    }
}

/// Calibrates a camera of `(width, height)` pixels.
///
/// # Needs
/// [`MIN_VIEWS`] views with corners, tilted in different directions; partial views are welcome. For the bend of the target,
/// views tilted by 20° or more.
///
/// # Errors
/// [`IntrinsicsError`] says what is missing and what to do. `cancel` is polled at every view.
pub fn solve(
    views: &[SeenView<'_>],
    target: &TargetSpec,
    (width, height): (u32, u32),
    options: &Options,
    cancel: &CancelToken,
) -> Result<Found, IntrinsicsError> {
    if views.len() < MIN_VIEWS {
        return Err(IntrinsicsError::TooFewViews { got: views.len(), need: MIN_VIEWS });
    }
    for (index, view) in views.iter().enumerate() {
        planar_pose::check_corners(view.corners, target, index)?;
        let (sqrt_weights, corners) = (view.sqrt_weights.len(), view.corners.len());
        if sqrt_weights > 0 && sqrt_weights != corners {
            return Err(IntrinsicsError::BadWeights { view: index, sqrt_weights, corners });
        }
    }
    let board = &BoardPoints::new(&target.points());
    let usual = Intrinsics::pinhole(width, height, f64::from(width.max(height)));
    let nominal = options.start.map_or(usual, |start| Intrinsics { width, height, ..start });
    nominal.validate()?;
    let planes = start::Planes::new(views, board, cancel)?;
    let spread_deg = planes.normal_spread_deg(&nominal);
    if spread_deg < MIN_SPREAD_DEG {
        return Err(IntrinsicsError::ParallelViews { views: views.len(), spread_deg });
    }
    let free = FreeParameters { lens: true, warp: options.free_warp, scale: false };
    let problem = Problem { views, board, free, cancel };
    let (mut estimate, mut steps) = first_optimum(&problem, &planes, &nominal, options)?;
    for _ in 0..MIRROR_ROUNDS {
        if !adjust::mirror_poses(&problem, &mut estimate)? {
            break;
        }
        steps += adjust::minimise(&problem, &mut estimate)?.unwrap_or(0);
    }
    finish(&problem, estimate, steps)
}

/// The optimum from the first start that leads to one.
fn first_optimum(
    problem: &Problem<'_>,
    planes: &start::Planes,
    nominal: &Intrinsics,
    options: &Options,
) -> Result<(Estimate, usize), IntrinsicsError> {
    let zero = options.model.with_coefficients(&[0.0; crate::geometry::camera::MAX_PARAMETERS]);
    let mut starts = Vec::new();
    match options.start {
        Some(given) if given.distortion.name() == zero.name() => starts.push(*nominal),
        Some(_) => starts.push(Intrinsics { distortion: zero, ..*nominal }),
        None => starts.extend(planes.focal_start(&Intrinsics { distortion: zero, ..*nominal })),
    }
    for camera in starts {
        if let Some(found) = optimum_from(problem, camera)? {
            return Ok(found);
        }
    }
    let plain = Intrinsics::pinhole(nominal.width, nominal.height, nominal.fx);
    for camera in start::sweep(problem, &Intrinsics { distortion: zero, ..plain })? {
        if let Some(found) = optimum_from(problem, camera)? {
            return Ok(found);
        }
    }
    Err(IntrinsicsError::NotACamera { reason: "no start led to an optimum".into() })
}

fn optimum_from(problem: &Problem<'_>, camera: Intrinsics) -> Result<Option<(Estimate, usize)>, IntrinsicsError> {
    let Some(poses) = start::poses(problem, &camera)? else { return Ok(None) };
    let mut estimate = Estimate { intrinsics: camera, shape: BoardShape::default(), poses };
    let steps = adjust::minimise(problem, &mut estimate)?;
    Ok(steps.filter(|_| estimate.intrinsics.validate().is_ok()).map(|steps| (estimate, steps)))
}

fn finish(problem: &Problem<'_>, estimate: Estimate, steps: usize) -> Result<Found, IntrinsicsError> {
    let linear = adjust::Linear::new(problem, &estimate)?
        .ok_or_else(|| IntrinsicsError::NotACamera { reason: "a corner is not in front of it".into() })?;
    let information = linear.information(problem, &estimate)?;
    let unit_covariance = information::covariance(&information, &estimate.intrinsics)?;
    let unknowns = information.nrows() + 6 * problem.views.len();
    let corners: usize = problem.views.iter().map(|v| v.corners.len()).sum();
    // Four corners a view can leave no more equations than unknowns; then nothing is known of the noise.
    let freedom = (2 * corners).saturating_sub(unknowns);
    let sigma = if freedom > 0 { (linear.cost / freedom as f64).sqrt() } else { f64::NAN };
    let rms_px = (0..problem.views.len()).map(|i| adjust::rms_px(problem, &estimate, i)).collect();
    Ok(Found {
        intrinsics: estimate.intrinsics,
        shape: estimate.shape,
        camera_from_target: estimate.poses.into_iter().map(Pose::from_isometry).collect(),
        rms_px,
        cost: linear.cost,
        corners,
        sigma,
        unit_covariance,
        steps,
    })
}

#[cfg(test)]
mod study_tests;
#[cfg(test)]
mod tests;
