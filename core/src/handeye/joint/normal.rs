//! The normal equations, view by view, and their reduction to the unknowns that all views share.
//!
//! Shared unknowns are `[mount_from_camera (6), anchor_from_target (6), free intrinsics (≤ 12)]`; each view adds the
//! six of its pose correction. Blocks are kept without weights, so that the noise levels can be varied cheaply.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, Point3, SMatrix, SVector, Vector6};

use super::chain::Chain;
use super::equations::PoseEquations;
use super::optimise::State;
use super::{JointProblem, Noise};
use crate::camera::MAX_PARAMETERS;
use crate::handeye::HandEyeError;
use crate::progress::CancelToken;
use crate::se3::skew;

/// Most shared unknowns.
pub const MAX_SHARED: usize = 12 + MAX_PARAMETERS;

pub type SharedMatrix = SMatrix<f64, MAX_SHARED, MAX_SHARED>;
pub type SharedVector = SVector<f64, MAX_SHARED>;
type SharedBySix = SMatrix<f64, MAX_SHARED, 6>;

/// Name of the method in errors.
const METHOD: &str = "the joint estimator";

/// Unweighted normal equations of one view: `r` are its pixel residuals, `s` the shared unknowns, `d` its correction.
#[derive(Debug, Clone)]
pub struct ViewBlock {
    /// `Jsᵀ Js`
    pub shared: Box<SharedMatrix>,
    /// `Jsᵀ Jd`
    pub cross: Box<SharedBySix>,
    /// `Jdᵀ Jd`
    pub own: Matrix6<f64>,
    /// `Jsᵀ r`
    pub shared_gradient: Box<SharedVector>,
    /// `Jdᵀ r`
    pub own_gradient: Vector6<f64>,
    /// `rᵀ r`, squared pixels.
    pub squared_px: f64,
    /// Number of scalar residuals.
    pub residuals: usize,
}

impl ViewBlock {
    pub fn corner_count(&self) -> usize {
        self.residuals / 2
    }

    fn new(problem: &JointProblem<'_>, state: &State, view: usize) -> Result<Self, HandEyeError> {
        let data = &problem.views[view];
        let chain = state.chain(problem, data, &state.corrections[view]);
        let equations = PoseEquations::new(
            &state.intrinsics,
            &chain.camera_from_target,
            problem.points,
            &data.corners,
            problem.free_intrinsics,
        )
        .map_err(|_behind| HandEyeError::NoSolution {
            method: METHOD,
            views: problem.views.len(),
            reason: "the estimate puts the target behind the camera",
        })?;
        Ok(Self::from_parts(&chain, &equations))
    }

    /// Turns equations in the view's own pose into those of the unknowns.
    pub fn from_parts(chain: &Chain, equations: &PoseEquations) -> Self {
        let PoseEquations { pose, pose_by_lens, lens, pose_gradient, lens_gradient, squared_px, corners } = equations;
        // xi = by_hand_eye x + y + by_correction d turns the six pose columns into those of the unknowns.
        let a = &chain.by_hand_eye;
        let d = &chain.by_correction;
        let pose_d = pose * d;
        let mut shared = Box::new(SharedMatrix::zeros());
        shared.fixed_view_mut::<6, 6>(0, 0).copy_from(&(a.transpose() * pose * a));
        shared.fixed_view_mut::<6, 6>(0, 6).copy_from(&(a.transpose() * pose));
        shared.fixed_view_mut::<6, 6>(6, 0).copy_from(&(pose * a));
        shared.fixed_view_mut::<6, 6>(6, 6).copy_from(pose);
        let hand_eye_lens = a.transpose() * pose_by_lens;
        shared.fixed_view_mut::<6, MAX_PARAMETERS>(0, 12).copy_from(&hand_eye_lens);
        shared.fixed_view_mut::<6, MAX_PARAMETERS>(6, 12).copy_from(pose_by_lens);
        shared.fixed_view_mut::<MAX_PARAMETERS, 6>(12, 0).copy_from(&hand_eye_lens.transpose());
        shared.fixed_view_mut::<MAX_PARAMETERS, 6>(12, 6).copy_from(&pose_by_lens.transpose());
        shared.fixed_view_mut::<MAX_PARAMETERS, MAX_PARAMETERS>(12, 12).copy_from(lens);
        let mut cross = Box::new(SharedBySix::zeros());
        cross.fixed_view_mut::<6, 6>(0, 0).copy_from(&(a.transpose() * pose_d));
        cross.fixed_view_mut::<6, 6>(6, 0).copy_from(&pose_d);
        cross.fixed_view_mut::<MAX_PARAMETERS, 6>(12, 0).copy_from(&(pose_by_lens.transpose() * d));
        let mut shared_gradient = Box::new(SharedVector::zeros());
        shared_gradient.fixed_rows_mut::<6>(0).copy_from(&(a.transpose() * pose_gradient));
        shared_gradient.fixed_rows_mut::<6>(6).copy_from(pose_gradient);
        shared_gradient.fixed_rows_mut::<MAX_PARAMETERS>(12).copy_from(lens_gradient);
        Self {
            shared,
            cross,
            own: d.transpose() * pose_d,
            shared_gradient,
            own_gradient: d.transpose() * pose_gradient,
            squared_px: *squared_px,
            residuals: 2 * corners,
        }
    }

    /// What the view says about the shared unknowns once its correction is eliminated; `None` when the correction is
    /// undetermined.
    pub fn information(&self, noise: &Noise) -> Option<SharedMatrix> {
        let weight = noise.corner_px.powi(-2);
        let own = Own::new(self, &Vector6::zeros(), weight, &prior_weight(noise), 0.0)?;
        Some(*self.shared * weight - own.gain.transpose() * own.factor.solve(&own.gain))
    }
}

/// Weight matrix of a pose correction: the inverse of its prior covariance.
pub fn prior_weight(noise: &Noise) -> Vector6<f64> {
    let (t, r) = (noise.robot_m.powi(-2), noise.robot_rad.powi(-2));
    Vector6::new(t, t, t, r, r, r)
}

/// All views linearised at one estimate.
pub struct System {
    pub blocks: Vec<ViewBlock>,
    pub corrections: Vec<Vector6<f64>>,
    /// How many of [`MAX_SHARED`] unknowns are in use.
    pub shared_count: usize,
    /// Polled at every view by whatever loops over them.
    pub cancel: CancelToken,
}

impl System {
    pub fn new(problem: &JointProblem<'_>, state: &State, cancel: &CancelToken) -> Result<Self, HandEyeError> {
        let blocks =
            (0..problem.views.len())
                .map(|i| {
                    if cancel.is_cancelled() { Err(HandEyeError::Cancelled) } else { ViewBlock::new(problem, state, i) }
                })
                .collect::<Result<Vec<_>, _>>()?;
        let lens = if problem.free_intrinsics { state.intrinsics.parameter_count() } else { 0 };
        Ok(Self { blocks, corrections: state.corrections.clone(), shared_count: 12 + lens, cancel: cancel.clone() })
    }

    pub fn squared_px(&self) -> f64 {
        self.blocks.iter().map(|b| b.squared_px).sum()
    }

    pub fn residual_count(&self) -> usize {
        self.blocks.iter().map(|b| b.residuals).sum()
    }

    /// Minus twice the log of the joint density at the point of linearisation, without the normalising terms.
    pub fn cost(&self, noise: &Noise) -> f64 {
        let prior = prior_weight(noise);
        self.squared_px() / noise.corner_px.powi(2)
            + self.corrections.iter().map(|c| c.component_mul(c).dot(&prior)).sum::<f64>()
    }

    /// Eliminates the corrections.
    pub fn reduce(&self, noise: &Noise) -> Result<Reduced, HandEyeError> {
        self.reduce_damped(noise, 0.0)
    }

    /// As [`Self::reduce`], with every diagonal entry raised by the factor `1 + damping` (Marquardt).
    pub fn reduce_damped(&self, noise: &Noise, damping: f64) -> Result<Reduced, HandEyeError> {
        let weight = noise.corner_px.powi(-2);
        let prior = prior_weight(noise);
        let mut matrix = SharedMatrix::zeros();
        let mut gradient = SharedVector::zeros();
        for block in &self.blocks {
            matrix += *block.shared * weight;
            gradient += *block.shared_gradient * weight;
        }
        for i in 0..self.shared_count {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut eliminated = Vec::with_capacity(self.blocks.len());
        for (block, correction) in self.blocks.iter().zip(&self.corrections) {
            if self.cancel.is_cancelled() {
                return Err(HandEyeError::Cancelled);
            }
            let own = Own::new(block, correction, weight, &prior, damping)
                .ok_or_else(|| self.singular("the pose correction of a view is undetermined"))?;
            matrix -= own.gain.transpose() * own.factor.solve(&own.gain);
            gradient -= own.gain.transpose() * own.factor.solve(&own.gradient);
            eliminated.push(own);
        }
        let n = self.shared_count;
        let Some((factor, scale)) = scaled_cholesky(&matrix, n) else {
            return Err(self.singular(
                "some direction of the answer leaves every residual unchanged: add views turned about other axes",
            ));
        };
        Ok(Reduced { factor, scale, gradient: DVector::from_fn(n, |i, _| gradient[i]), own: eliminated })
    }

    fn singular(&self, reason: &'static str) -> HandEyeError {
        HandEyeError::NoSolution { method: METHOD, views: self.blocks.len(), reason }
    }
}

/// Smallest pivot of the scaled Cholesky factor taken as non-zero: `sqrt(f64::EPSILON)` is where the squared factor
/// has lost all digits.
const SINGULAR_PIVOT: f64 = 1.5e-8;

/// Cholesky factor of the first `n` rows and columns, scaled to unit diagonal, and the scale; `None` when singular.
fn scaled_cholesky(matrix: &SharedMatrix, n: usize) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
    let active = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)]);
    let scale = DVector::from_fn(n, |i, _| active[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip());
    // Columns differ by many orders (metres, radians, lens coefficients); scaled, the pivots say what is singular.
    let scaled = DMatrix::from_fn(n, n, |i, j| active[(i, j)] * scale[i] * scale[j]);
    let factor = Cholesky::new(scaled).filter(|f| f.l_dirty().diagonal().iter().all(|p| *p > SINGULAR_PIVOT))?;
    Some((factor, scale))
}

fn scaled_inverse(factor: &Cholesky<f64, Dyn>, scale: &DVector<f64>) -> DMatrix<f64> {
    let inverse = factor.inverse();
    DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j])
}

/// Inverse of the first `n` rows and columns of an information matrix; `None` when it leaves a direction free.
pub fn covariance_of(information: &SharedMatrix, n: usize) -> Option<DMatrix<f64>> {
    scaled_cholesky(information, n).map(|(factor, scale)| scaled_inverse(&factor, &scale))
}

/// One view's correction, ready to be eliminated.
pub struct Own {
    pub factor: Cholesky<f64, nalgebra::Const<6>>,
    /// Weighted `Jdᵀ Js`, six rows.
    pub gain: SMatrix<f64, 6, MAX_SHARED>,
    pub gradient: Vector6<f64>,
}

impl Own {
    fn new(
        block: &ViewBlock,
        correction: &Vector6<f64>,
        weight: f64,
        prior: &Vector6<f64>,
        damping: f64,
    ) -> Option<Self> {
        let mut own = block.own * weight + Matrix6::from_diagonal(prior);
        for i in 0..6 {
            own[(i, i)] *= 1.0 + damping;
        }
        Some(Self {
            factor: Cholesky::new(own)?,
            gain: block.cross.transpose() * weight,
            gradient: block.own_gradient * weight + prior.component_mul(correction),
        })
    }
}

/// The system in the shared unknowns alone.
pub struct Reduced {
    factor: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
    gradient: DVector<f64>,
    pub own: Vec<Own>,
}

impl Reduced {
    fn solve(&self, rhs: &DVector<f64>) -> DVector<f64> {
        self.factor.solve(&rhs.component_mul(&self.scale)).component_mul(&self.scale)
    }

    /// The Gauss–Newton (or Marquardt) step of the shared unknowns.
    pub fn shared_step(&self) -> DVector<f64> {
        -self.solve(&self.gradient)
    }

    /// The step of every correction that goes with a shared step.
    pub fn own_steps(&self, shared_step: &DVector<f64>) -> Vec<Vector6<f64>> {
        let mut wide = SharedVector::zeros();
        wide.rows_mut(0, shared_step.len()).copy_from(shared_step);
        self.own.iter().map(|own| -own.factor.solve(&(own.gradient + own.gain * wide))).collect()
    }

    /// Inverse of the reduced matrix: the covariance of the shared unknowns when the system is undamped.
    pub fn inverse(&self) -> DMatrix<f64> {
        scaled_inverse(&self.factor, &self.scale)
    }

    /// Log-determinant of the whole normal matrix, shared unknowns and corrections.
    pub fn log_determinant(&self) -> f64 {
        let shared: f64 = self.factor.l_dirty().diagonal().iter().map(|p| 2.0 * p.ln()).sum::<f64>()
            - self.scale.iter().map(|s| 2.0 * s.ln()).sum::<f64>();
        let own: f64 =
            self.own.iter().map(|o| o.factor.l_dirty().diagonal().iter().map(|p| 2.0 * p.ln()).sum::<f64>()).sum();
        shared + own
    }

    /// How much a full step lowers the quadratic cost.
    pub fn decrease(&self) -> f64 {
        let shared = self.gradient.dot(&self.solve(&self.gradient));
        let own: f64 = self.own.iter().map(|o| o.gradient.dot(&o.factor.solve(&o.gradient))).sum();
        shared + own
    }

    /// Displacement of `point` (camera coordinates) in the mount when one view is taken away: one Newton step of the
    /// remaining system, whose gradient is minus that of the view.
    pub fn influence_of(
        &self,
        block: &ViewBlock,
        noise: &Noise,
        correction: &Vector6<f64>,
        point: &Point3<f64>,
    ) -> Option<f64> {
        let weight = noise.corner_px.powi(-2);
        let own = Own::new(block, correction, weight, &prior_weight(noise), 0.0)?;
        let matrix = *block.shared * weight - own.gain.transpose() * own.factor.solve(&own.gain);
        let gradient = *block.shared_gradient * weight - own.gain.transpose() * own.factor.solve(&own.gradient);
        let n = self.gradient.len();
        let full = self.factor.l() * self.factor.l().transpose();
        let rest = DMatrix::from_fn(n, n, |i, j| full[(i, j)] - matrix[(i, j)] * self.scale[i] * self.scale[j]);
        let factor = Cholesky::new(rest).filter(|f| f.l_dirty().diagonal().iter().all(|p| *p > SINGULAR_PIVOT))?;
        let rhs = DVector::from_fn(n, |i, _| gradient[i] * self.scale[i]);
        let step = factor.solve(&rhs).component_mul(&self.scale);
        let translation = step.fixed_rows::<3>(0) - skew(&point.coords) * step.fixed_rows::<3>(3);
        Some(translation.norm())
    }
}
