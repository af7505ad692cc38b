//! The joint estimate with the depths of the target, where views have them.
//!
//! Every view with depths adds the three numbers of a plane to its corners ([`DepthPlane`]), and the errors of the depth camera are
//! unknowns that all views share ([`DepthBias`]).
//!
//! Neighbouring depths have the same error, so a plane is treated as if all its depths had one common error, with one standard
//! deviation that all views share. It is the one that makes the residuals most likely (REML): with `w` pixels of corner error per
//! metre, and `D(w)` minus twice the log of the restricted likelihood of all residuals in pixels, `D(w) − 6 N ln w` is least for
//! `N` planes.
//!
//! Depths determine the tilt of the camera better than anything else, if they are measured along the lens itself, as a renderer
//! does and a camera whose depths are found in its own image; where a second sensor measures them its mounting is part of them. So
//! there are two models, one without a tilt and one with a tilt of unknown size, as likely as each other before any data. The
//! answer is that of the likelier one, and its covariance that of both, as likely as they are then.
//!
//! Source: Hoeting et al. 1999, "Bayesian model averaging: a tutorial", Statistical Science 14 (the mixture of two models).
//! `docs/maths/depth_camera.md`.

use nalgebra::{DMatrix, DVector, Matrix5, Vector3};

use super::problem::DepthWeight;
use super::state::State;
use super::{Free, JointProblem, JointSolution, fit};
use crate::handeye::{HandEyeError, determined};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::depth_plane::{DepthPlane, are_of_right_size};
use handeye_geometry::view_equations::{DepthBias, PredictedDepths};

/// Least number of views with depths to determine five errors of them, with thirteen numbers to spare for their noise.
pub const FEWEST: usize = 6;
/// Least standard deviation of depths, metres: what a 32-bit float resolves in some metres.
const LEAST_M: f64 = 1e-6;
/// Range in which the level is searched, as a factor of the scatter of the depths about the estimate without them: part of that
/// is the estimate's own error.
const RANGE: (f64, f64) = (0.05, 2.0);
/// Levels that are tried: the range is then down to a third of a logarithm, its last two a twelfth apart, and thirty numbers
/// determine a level to an eighth.
const TRIED: usize = 7;

/// An estimate with depths.
#[derive(Debug, Clone)]
pub struct WithDepths {
    /// Weight of the depths.
    pub weight: DepthWeight,
    /// Number of views whose depths are used.
    pub views: usize,
    /// The estimate of the likelier model.
    pub solution: JointSolution,
    /// What the other model adds.
    pub other: OtherModel,
    /// Errors of the depth camera by the model with a free tilt, and their covariance.
    pub open: (DepthBias, Matrix5<f64>),
}

/// What the less likely model adds to the uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherModel {
    pub probability: f64,
    /// Its mean squares about the answer: its covariance, and its distance from the answer squared.
    squares: DMatrix<f64>,
}

impl OtherModel {
    /// The covariance of both models about the answer of the likelier one.
    pub fn mixed(&self, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        covariance * (1.0 - self.probability) + &self.squares * self.probability
    }
}

/// The estimate with the depths of the views; `without` is the estimate without them. `None` where too few views have depths,
/// these are in another unit, or the noise levels are given.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn with_depths(
    problem: &JointProblem<'_>,
    without: &JointSolution,
    cancel: &CancelToken,
) -> Result<Option<WithDepths>, HandEyeError> {
    let views = problem.views.iter().filter(|view| view.depth.is_some()).count();
    if problem.noise.is_some() || views < FEWEST {
        return Ok(None);
    }
    let Some(scatter_m) = scatter_m(problem, without) else { return Ok(None) };
    let model = |turned| likeliest(problem, without, (turned, scatter_m, views), cancel);
    let (Some(straight), Some(turned)) = (model(false)?, model(true)?) else { return Ok(None) };
    let open = (turned.solution.depth, turned.solution.depth_covariance());
    let [answer, other] = if straight.unlikely <= turned.unlikely { [straight, turned] } else { [turned, straight] };
    let probability = (1.0 + (0.5 * (other.unlikely - answer.unlikely)).exp()).recip();
    let with = JointProblem { free: answer.solution.free, ..*problem };
    let apart = State::of(&answer.solution).step_to(&State::of(&other.solution), &with);
    let squares = &other.solution.covariance + &apart * apart.transpose();
    let other = OtherModel { probability, squares };
    Ok(Some(WithDepths { weight: answer.weight, views, solution: answer.solution, other, open }))
}

/// A model at the level of its depths that is most likely.
struct Model {
    /// Minus twice the log of its likelihood.
    unlikely: f64,
    weight: DepthWeight,
    solution: JointSolution,
}

fn likeliest(
    problem: &JointProblem<'_>,
    without: &JointSolution,
    (turned, scatter_m, views): (bool, f64, usize),
    cancel: &CancelToken,
) -> Result<Option<Model>, HandEyeError> {
    let free = Free { depth: true, ..without.free };
    let mut best: Option<Model> = None;
    let unlikely = |level_m: f64| -> Result<f64, HandEyeError> {
        let weight = DepthWeight { px_per_m: without.noise.corner_px / level_m, turned };
        let with = JointProblem { free, depth: Some(weight), ..*problem };
        let start = best.as_ref().map_or(without, |near| &near.solution).as_start();
        let Some(solution) = determined(fit(&with, &start, cancel))? else { return Ok(f64::INFINITY) };
        let Some(deviance) = solution.deviance else { return Ok(f64::INFINITY) };
        // The deviance leaves out the normalising terms of the priors.
        let unlikely = deviance - 6.0 * views as f64 * weight.px_per_m.ln() + 4.0 * weight.tilt_sigma_rad().ln();
        if best.as_ref().is_none_or(|best| unlikely < best.unlikely) {
            best = Some(Model { unlikely, weight, solution });
        }
        Ok(unlikely)
    };
    towards_least(unlikely, [RANGE.0 * scatter_m, RANGE.1 * scatter_m].map(|m| m.max(LEAST_M)))?;
    Ok(best)
}

/// Evaluates a function of a positive number that has one minimum in a range at points converging to it (golden section
/// over the logarithm).
fn towards_least(mut of: impl FnMut(f64) -> Result<f64, HandEyeError>, range: [f64; 2]) -> Result<(), HandEyeError> {
    const PART: f64 = 0.618_033_988_749_894_9;
    let [mut low, mut high] = range.map(f64::ln);
    let mut inner = [high - PART * (high - low), low + PART * (high - low)];
    let mut values = [of(inner[0].exp())?, of(inner[1].exp())?];
    for _ in 2..TRIED {
        if values[0] < values[1] {
            high = inner[1];
            (inner[1], values[1]) = (inner[0], values[0]);
            inner[0] = high - PART * (high - low);
            values[0] = of(inner[0].exp())?;
        } else {
            low = inner[0];
            (inner[0], values[0]) = (inner[1], values[1]);
            inner[1] = low + PART * (high - low);
            values[1] = of(inner[1].exp())?;
        }
    }
    Ok(())
}

/// Scatter of the depths about the targets of an estimate, once the errors of the depth camera are subtracted, metres; `None`
/// where they are not even of the right size.
fn scatter_m(problem: &JointProblem<'_>, without: &JointSolution) -> Option<f64> {
    let planes: Vec<(&DepthPlane, PredictedDepths)> = problem
        .views
        .iter()
        .zip(&without.views)
        .filter_map(|(view, fit)| {
            let plane = view.depth.as_ref()?;
            let pose = fit.camera_from_target.isometry();
            let (lens, shape) = (&without.intrinsics, &without.shape);
            Some((plane, PredictedDepths::new(lens, shape, plane, &DepthBias::default(), pose)))
        })
        .collect();
    let ratio = median_high(planes.iter().map(|(plane, predicted)| plane.depth.x / predicted.depth.x))?;
    if !are_of_right_size(ratio) {
        return None;
    }
    let numbers = 3 * planes.len();
    let mut design = DMatrix::zeros(numbers, DepthBias::COUNT);
    let mut off = DVector::zeros(numbers);
    for (i, (plane, predicted)) in planes.iter().enumerate() {
        let root = plane.information.cholesky()?.l().transpose();
        let of_view: Vector3<f64> = root * (plane.depth - predicted.depth);
        off.rows_mut(3 * i, 3).copy_from(&of_view);
        for (k, column) in predicted.by_bias.iter().enumerate() {
            design.view_mut((3 * i, k), (3, 1)).copy_from(&(root * column));
        }
    }
    let bias = design.clone().svd(true, true).solve(&off, f64::EPSILON).ok()?;
    let squares = (off - design * bias).norm_squared();
    Some((squares / (numbers - DepthBias::COUNT) as f64).sqrt().max(LEAST_M))
}
