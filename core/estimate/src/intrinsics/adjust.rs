//! Levenberg–Marquardt on lens, shape and all poses, the poses eliminated view by view.

use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Matrix6, Matrix6xX, Vector6};

use super::{IntrinsicsError, SeenView};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::planar_pose::mirror;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::view_equations::{FreeParameters, PoseEquations, ViewInput};

/// Steps of one minimisation; a handful is usual, but the rational model converges slowly along a valley.
const MAX_STEPS: usize = 100;
/// Ends when the quadratic model predicts a decrease of less than this part of the cost.
const COST_TOLERANCE: f64 = 1e-13;
/// Squared pixels per corner that are rounding: corners without noise end here.
const ROUNDING_PX2: f64 = 1e-20;
/// First damping relative to the diagonal.
const FIRST_DAMPING: f64 = 1e-3;
/// By how much the damping falls after a step that decreased the cost as predicted. It has to fall fast: the poses take
/// all but a thousandth of the information on the lens, so that a small damping still shortens the step.
const EASE: f64 = 1e-3;
/// Factor by which it rises after a step that failed.
const TIGHTEN: f64 = 10.0;
/// Least damping from which it rises.
const LEAST_RISE: f64 = 1e-8;
/// Past this damping a step is too small to matter.
const LARGEST_DAMPING: f64 = 1e10;
/// Steps of a mirrored pose.
const MIRROR_STEPS: usize = 10;
/// A mirrored pose is taken when it lowers the cost of its view by more than this part: less is rounding.
const WORTHWHILE: f64 = 1e-6;

/// The data and what is estimated from them.
pub(super) struct Problem<'a> {
    pub views: &'a [SeenView<'a>],
    pub board: &'a BoardPoints,
    pub free: FreeParameters,
    pub cancel: &'a CancelToken,
}

impl Problem<'_> {
    pub fn check_cancel(&self) -> Result<(), IntrinsicsError> {
        if self.cancel.is_cancelled() { Err(IntrinsicsError::Cancelled) } else { Ok(()) }
    }
}

/// The current values of all unknowns.
#[derive(Debug, Clone)]
pub(super) struct Estimate {
    pub intrinsics: Intrinsics,
    pub shape: BoardShape,
    pub poses: Vec<Isometry3<f64>>,
    /// For each pose the other minimum near it, where there is one; empty before any was searched for.
    pub mirrored: Vec<Option<Isometry3<f64>>>,
}

/// The equations of one view's pose.
struct Block {
    pose: Matrix6<f64>,
    pose_by_form: Matrix6xX<f64>,
    gradient: Vector6<f64>,
}

impl Block {
    fn factor(&self, damping: f64) -> Option<Cholesky<f64, nalgebra::Const<6>>> {
        let mut damped = self.pose;
        for i in 0..6 {
            damped[(i, i)] *= 1.0 + damping;
        }
        Cholesky::new(damped)
    }
}

/// All views linearised at one estimate.
pub(super) struct Linear {
    blocks: Vec<Block>,
    form: DMatrix<f64>,
    form_gradient: DVector<f64>,
    /// `Σ ‖W r‖²`
    pub cost: f64,
}

impl Linear {
    /// `None` where a corner has no image.
    pub fn new(problem: &Problem<'_>, estimate: &Estimate) -> Result<Option<Self>, IntrinsicsError> {
        let n = problem.free.count(&estimate.intrinsics);
        let blocks = Vec::with_capacity(problem.views.len());
        let mut all = Self { blocks, form: DMatrix::zeros(n, n), form_gradient: DVector::zeros(n), cost: 0.0 };
        for (view, pose) in problem.views.iter().zip(&estimate.poses) {
            problem.check_cancel()?;
            let seen = seen(view, problem.board, &estimate.shape, &estimate.intrinsics);
            let Ok(equations) = PoseEquations::new(&seen, pose, problem.free) else { return Ok(None) };
            all.form += equations.form;
            all.form_gradient += equations.form_gradient;
            all.cost += equations.squared_px;
            all.blocks.push(Block {
                pose: equations.pose,
                pose_by_form: equations.pose_by_form,
                gradient: equations.pose_gradient,
            });
        }
        Ok(all.cost.is_finite().then_some(all))
    }

    /// Normal equations of the form without the poses: their matrix and gradient, and the decrease of the cost by the
    /// poses alone. `None` where a view leaves its pose undetermined.
    fn eliminate(&self, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>, f64)> {
        let n = self.form_gradient.len();
        let (mut matrix, mut gradient, mut decrease) = (self.form.clone(), self.form_gradient.clone(), 0.0);
        let mut gains = vec![[0.0; 6]; n];
        for i in 0..n {
            matrix[(i, i)] *= 1.0 + damping;
        }
        for block in &self.blocks {
            let factor = block.factor(damping)?;
            let lower = factor.l_dirty();
            let forward = |column: [f64; 6]| {
                let mut out = [0.0; 6];
                for (i, value) in column.into_iter().enumerate() {
                    let known: f64 = out[..i].iter().enumerate().map(|(j, done)| lower[(i, j)] * done).sum();
                    out[i] = (value - known) / lower[(i, i)];
                }
                out
            };
            let dot = |a: &[f64; 6], b: &[f64; 6]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
            for (gain, column) in gains.iter_mut().zip(block.pose_by_form.column_iter()) {
                *gain = forward(column.into_owned().data.0[0]);
            }
            let own = forward(block.gradient.data.0[0]);
            decrease += dot(&own, &own);
            for (j, gain) in gains.iter().enumerate() {
                for (i, other) in gains[..=j].iter().enumerate() {
                    matrix[(i, j)] -= dot(gain, other);
                }
                gradient[j] -= dot(gain, &own);
            }
        }
        matrix.fill_lower_triangle_with_upper_triangle();
        Some((matrix, gradient, decrease))
    }

    /// The damped step from `estimate` and the decrease of the cost that it predicts.
    fn step(&self, problem: &Problem<'_>, estimate: &Estimate, damping: f64) -> Option<(Estimate, f64)> {
        let (matrix, gradient, by_poses) = self.eliminate(damping)?;
        let n = gradient.len();
        // Columns differ by many orders (pixels, lens coefficients, metres).
        let scale = DVector::from_fn(n, |i, _| matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip());
        let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
        let gradient = gradient.component_mul(&scale);
        let solved = Cholesky::new(scaled)?.solve(&gradient);
        let promised = by_poses + gradient.dot(&solved);
        let form = -solved.component_mul(&scale);
        let mut poses = Vec::with_capacity(self.blocks.len());
        for (block, pose) in self.blocks.iter().zip(&estimate.poses) {
            let own = -block.factor(damping)?.solve(&(block.gradient + &block.pose_by_form * &form));
            poses.push(pose * se3::exp(&own));
        }
        let lens: Vec<f64> = estimate.intrinsics.parameters().iter().zip(form.iter()).map(|(p, d)| p + d).collect();
        let mut shape = estimate.shape;
        if problem.free.warp {
            let at = problem.free.warp_at(&estimate.intrinsics);
            shape.warp_m[0] += form[at];
            shape.warp_m[1] += form[at + 1];
        }
        let intrinsics = estimate.intrinsics.with_parameters(&lens);
        (promised.is_finite() && intrinsics.validate().is_ok())
            .then_some((Estimate { intrinsics, shape, poses, mirrored: estimate.mirrored.clone() }, promised))
    }
}

pub(super) fn seen<'a>(
    view: &SeenView<'a>,
    board: &'a BoardPoints,
    shape: &'a BoardShape,
    intrinsics: &'a Intrinsics,
) -> ViewInput<'a> {
    ViewInput { intrinsics, board, shape, corners: view.corners, whitener: view.whitener, depths: None }
}

/// Minimises the cost from `estimate`, which holds the best point found afterwards. Returns the number of steps; `None`
/// where the start has a corner without image or no step is possible.
pub(super) fn minimise(problem: &Problem<'_>, estimate: &mut Estimate) -> Result<Option<usize>, IntrinsicsError> {
    let Some(mut linear) = Linear::new(problem, estimate)? else { return Ok(None) };
    let corners: usize = problem.views.iter().map(|v| v.corners.len()).sum();
    let rounding = ROUNDING_PX2 * corners as f64;
    let mut damping = FIRST_DAMPING;
    for step in 0..MAX_STEPS {
        loop {
            problem.check_cancel()?;
            if damping > LARGEST_DAMPING {
                return Ok((step > 0).then_some(step));
            }
            let Some((next, promised)) = linear.step(problem, estimate, damping) else {
                damping = (damping * TIGHTEN).max(LEAST_RISE);
                continue;
            };
            let negligible = COST_TOLERANCE * linear.cost + rounding;
            // A damped step predicts little decrease because it is short.
            if promised <= negligible && damping < 1e-6 {
                return Ok(Some(step));
            }
            // A step that puts the target behind the camera is as bad as one that raises the cost.
            if let Some(next_linear) = Linear::new(problem, &next)?
                && next_linear.cost < linear.cost
            {
                let kept = (linear.cost - next_linear.cost) / promised;
                damping *= if kept > 0.5 { EASE } else { 1.0 };
                (*estimate, linear) = (next, next_linear);
                break;
            }
            if promised <= negligible {
                return Ok(Some(step));
            }
            damping = (damping * TIGHTEN).max(LEAST_RISE);
        }
    }
    Ok(Some(MAX_STEPS))
}

/// Tries the mirror image of every pose and keeps the one that fits better; returns whether any was replaced. Both are
/// minima of the cost, and the descent ends in the one nearer to its start.
pub(super) fn mirror_poses(problem: &Problem<'_>, estimate: &mut Estimate) -> Result<bool, IntrinsicsError> {
    let mut improved = false;
    let Estimate { intrinsics, shape, poses, mirrored } = estimate;
    mirrored.clear();
    for (view, pose) in problem.views.iter().zip(poses.iter_mut()) {
        problem.check_cancel()?;
        let seen = seen(view, problem.board, shape, intrinsics);
        let mut other = mirror::refined(&seen, pose, MIRROR_STEPS);
        if let Some(other) = &mut other
            && let Ok(own) = PoseEquations::new(&seen, pose, FreeParameters::default())
            && other.squared_px < (1.0 - WORTHWHILE) * own.squared_px
        {
            std::mem::swap(pose, &mut other.pose);
            improved = true;
        }
        mirrored.push(other.map(|other| other.pose));
    }
    Ok(improved)
}

/// Root mean square of the 2-D residuals of one view, pixels.
pub(super) fn rms_px(problem: &Problem<'_>, estimate: &Estimate, view: usize) -> f64 {
    let (corners, pose) = (problem.views[view].corners, &estimate.poses[view]);
    let squared = |corner: &handeye_geometry::targets::observation::Corner| {
        let point = problem.board.point(corner.index, &estimate.shape);
        estimate.intrinsics.project(&(pose * point)).map_or(f64::NAN, |px| (px - corner.px).norm_squared())
    };
    (corners.iter().map(squared).sum::<f64>() / corners.len() as f64).sqrt()
}
