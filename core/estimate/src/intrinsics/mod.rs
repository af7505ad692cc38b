//! Fit of a camera from views of a flat target.
//!
//! # What it estimates
//! Focal lengths, principal point and distortion of one lens model, the target's pose in every view and, where the corners
//! show it or it is requested, the bend of the target ([`BoardShape`]). The size of the target cannot be determined: one
//! twice as large and twice as far away makes the same image. The estimate minimises the squared reprojection error
//! `Σ ‖W (project(camera_from_target_i * point_j) − px_ij)‖²`, where `W` is the whitener of a corner, or the identity. For
//! independent Gaussian noise of the corners that is the maximum of the likelihood.
//!
//! # How
//! A start from homographies ([`start`]), then Levenberg–Marquardt on all unknowns at once, with analytic Jacobians and
//! the poses eliminated view by view ([`adjust`]): time and memory grow linearly with the number of views. At the
//! optimum every pose is tried against its mirror image, the second minimum that a flat target has. All sums run in the
//! order of the views, so the same input gives the same bits.
//!
//! # How certain it is
//! Corners of one view have common errors, and then the covariance of independent ones is several times too small. The
//! stated uncertainty rests on the scatter of the views, and includes a bend that they may not show ([`Stated`],
//! `docs/maths/camera_alone.md`).
//!
//! # Reference
//! Zhang 2000, "A flexible new technique for camera calibration"; Triggs et al. 2000, "Bundle adjustment — a modern
//! synthesis", §6; Kannala & Brandt 2006 for the fisheye.

mod adjust;
mod error;
pub(crate) mod evidence;
mod information;
mod screened;
mod seen_view;
mod start;

pub use error::IntrinsicsError;
use nalgebra::{DMatrix, Isometry3};
pub use screened::{Screened, solve_screened};
pub use seen_view::SeenView;

use handeye_geometry::camera::Distortion;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::planar_pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::view_equations::FreeParameters;

use adjust::{Estimate, Problem};
use evidence::Evidence;

/// Views that a calibration needs: two orientations determine the four numbers of a pinhole, a third checks them.
pub const MIN_VIEWS: usize = 3;
/// Normals of the target that agree within this angle \[deg\] in all views leave the focal length undetermined.
const MIN_SPREAD_DEG: f64 = 2.0;
/// Most rounds of mirrored poses and optimum; one is usual.
const MIRROR_ROUNDS: usize = 4;

/// What to estimate, and from which start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The lens model; its coefficients do not matter.
    pub model: Distortion,
    /// Where to start; `None` finds a start from the views. Its distortion counts only when it is of the same model.
    pub start: Option<Intrinsics>,
    /// Whether the bend of the target is estimated too.
    pub bend: Bend,
}

/// What is assumed about the bend of a target. A bent one that is taken for flat moves the camera by far more than the
/// noise of its corners; a flat one that is taken for bent costs precision, most where views are few or little tilted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bend {
    /// It is flat, and no allowance is made for a bend.
    Never,
    /// It is estimated where the corners show one, which one flat target in a thousand does by chance; where they do not,
    /// the stated uncertainty of the camera allows for one that they cannot show.
    IfShown,
    /// It is estimated.
    Always,
}

impl Options {
    /// A model on a flat target, without a start.
    pub fn new(model: Distortion) -> Self {
        Self { model, start: None, bend: Bend::Never }
    }
}

/// A calibrated camera with its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// The target: flat where its bend was not estimated.
    pub shape: BoardShape,
    /// The target's pose in each view, in the order given.
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    /// For each pose the other minimum of the reprojection error of a flat target near it, where there is one.
    pub(crate) mirrored: Vec<Option<Isometry3<f64>>>,
    /// Root mean square of the 2-D residuals of each view, in the order given, pixels, without whiteners.
    pub rms_px: Vec<f64>,
    /// The cost at the optimum, `Σ ‖W r‖²`: squared pixels where all corners have equal weights.
    pub cost: f64,
    /// Number of corners in all views.
    pub corners: usize,
    /// Standard deviation per axis of a whitened residual, `√(cost / (2 corners − unknowns))`: pixels where all corners
    /// have equal weights. NaN where there are no more residuals than unknowns.
    pub sigma: f64,
    /// Covariance of `[fx fy cx cy, distortion…, warp x, warp y]` for whitened residuals of standard deviation 1; the
    /// warp only where it was estimated. The poses are unknowns in it, not constants.
    pub unit_covariance: DMatrix<f64>,
    /// Uncertainty of the camera and the bend that may be stated, whatever errors the corners of a view share.
    pub stated: Stated,
    /// Steps of the optimiser.
    pub steps: usize,
}

/// Uncertainty of an estimate by the scatter of its views.
///
/// Errors that all views share (a lens model that does not follow the lens, a target that is not flat in another way than
/// [`BoardShape`] bends) are not in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated {
    /// Standard deviations of fx, fy, cx and cy, pixels: the error is within 1.96 of them in 95 % of cases. NaN where
    /// there are no more residuals than unknowns.
    pub pinhole_sigma_px: [f64; 4],
    /// The same for `ln(fx / fy)`: fx and fy have common errors, so it is known better than either.
    pub aspect_sigma: f64,
    /// The same for the two warps, metres; `None` where the target was taken for flat.
    pub warp_sigma_m: Option<[f64; 2]>,
    /// Variance of the pinhole that the views show over that with independent corner errors.
    pub ratio: f64,
    /// Degrees of freedom of that ratio, at least 1.
    pub degrees_of_freedom: f64,
}

impl Found {
    /// Root mean square of the 2-D residuals of all views, pixels; without whiteners.
    pub fn total_rms_px(&self) -> f64 {
        (self.cost / self.corners as f64).sqrt()
    }

    /// Covariance of `[fx fy cx cy, distortion…, warp x, warp y]` for independent corner noise of the size that the
    /// residuals show; [`Found::stated`] holds when it is not independent.
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
/// [`IntrinsicsError`] states what is missing and what to do. `cancel` is polled at every view.
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
        let (weights, corners) = (view.whitener.corners(), view.corners.len());
        if let Some(weights) = weights.filter(|weights| *weights != corners) {
            return Err(IntrinsicsError::BadWeights { view: index, weights, corners });
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
    let lens = FreeParameters { lens: true, ..FreeParameters::default() };
    let bent = FreeParameters { warp: true, ..lens };
    let free = if options.bend == Bend::Always { bent } else { lens };
    let mut problem = Problem { views, board, free, cancel };
    let (mut estimate, mut steps) = first_optimum(&problem, &planes, &nominal, options)?;
    steps += mirrored_back(&problem, &mut estimate)?;
    let columns = if options.bend == Bend::Never { lens } else { bent };
    let mut evidence = Evidence::new(&problem, &estimate, columns)?;
    if options.bend == Bend::IfShown && evidence.deflection(&problem, &estimate).is_shown() {
        problem.free = bent;
        steps += adjust::minimise(&problem, &mut estimate)?.unwrap_or(0);
        steps += mirrored_back(&problem, &mut estimate)?;
        evidence = Evidence::new(&problem, &estimate, columns)?;
    }
    finish(&problem, estimate, steps, &evidence)
}

/// Replaces poses that ended as their mirror image. Returns the number of steps taken.
fn mirrored_back(problem: &Problem<'_>, estimate: &mut Estimate) -> Result<usize, IntrinsicsError> {
    let mut steps = 0;
    for _ in 0..MIRROR_ROUNDS {
        if !adjust::mirror_poses(problem, estimate)? {
            break;
        }
        steps += adjust::minimise(problem, estimate)?.unwrap_or(0);
    }
    Ok(steps)
}

/// The optimum from the first start that leads to one.
fn first_optimum(
    problem: &Problem<'_>,
    planes: &start::Planes,
    nominal: &Intrinsics,
    options: &Options,
) -> Result<(Estimate, usize), IntrinsicsError> {
    let zero = options.model.with_coefficients(&[0.0; handeye_geometry::camera::MAX_PARAMETERS]);
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
    Err(IntrinsicsError::NotACamera { reason: "no start led to an optimum" })
}

fn optimum_from(problem: &Problem<'_>, camera: Intrinsics) -> Result<Option<(Estimate, usize)>, IntrinsicsError> {
    let Some(poses) = start::poses(problem, &camera)? else { return Ok(None) };
    let mut estimate = Estimate { intrinsics: camera, shape: BoardShape::default(), poses, mirrored: Vec::new() };
    let steps = adjust::minimise(problem, &mut estimate)?;
    Ok(steps.filter(|_| estimate.intrinsics.validate().is_ok()).map(|steps| (estimate, steps)))
}

fn finish(
    problem: &Problem<'_>,
    estimate: Estimate,
    steps: usize,
    evidence: &Evidence,
) -> Result<Found, IntrinsicsError> {
    // The columns of the evidence that were fitted come first.
    let fitted = problem.free.count(&estimate.intrinsics);
    let information = evidence.information.view((0, 0), (fitted, fitted)).into_owned();
    let unit_covariance = information::covariance(&information, &estimate.intrinsics)?;
    let unknowns = fitted + 6 * problem.views.len();
    let corners: usize = problem.views.iter().map(|v| v.corners.len()).sum();
    // Four corners a view can leave no more equations than unknowns; then the noise is unknown.
    let freedom = (2 * corners).saturating_sub(unknowns);
    let sigma = if freedom > 0 { (evidence.cost / freedom as f64).sqrt() } else { f64::NAN };
    let rms_px = (0..problem.views.len()).map(|i| adjust::rms_px(problem, &estimate, i)).collect();
    Ok(Found {
        intrinsics: estimate.intrinsics,
        shape: estimate.shape,
        camera_from_target: estimate.poses.into_iter().map(Pose::from_isometry).collect(),
        mirrored: estimate.mirrored,
        rms_px,
        cost: evidence.cost,
        corners,
        sigma,
        unit_covariance,
        stated: stated(problem, &estimate.intrinsics, evidence),
        steps,
    })
}

fn stated(problem: &Problem<'_>, intrinsics: &Intrinsics, evidence: &Evidence) -> Stated {
    let pinhole = evidence.spread(0, 4);
    let warp = problem.free.warp.then(|| evidence.spread(problem.free.warp_at(intrinsics), 2));
    // Derivatives by fx, fy, cx and cy.
    let aspect = [intrinsics.fx.recip(), -intrinsics.fy.recip(), 0.0, 0.0];
    let aspect_left_out: f64 = (0..4).map(|i| aspect[i] * evidence.left_out(i)).sum();
    Stated {
        aspect_sigma: pinhole.sigma_along(&aspect).hypot(aspect_left_out),
        // The effect of the bend that was left out on the answer counts as an error of it.
        pinhole_sigma_px: std::array::from_fn(|i| pinhole.sigma(i).hypot(evidence.left_out(i))),
        warp_sigma_m: warp.map(|warp| [warp.sigma(0), warp.sigma(1)]),
        ratio: pinhole.ratio,
        degrees_of_freedom: pinhole.degrees_of_freedom,
    }
}

#[cfg(test)]
mod study_tests;
#[cfg(test)]
mod tests;
