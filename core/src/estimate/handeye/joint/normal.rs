//! The normal equations of all views and their reduction to the unknowns that these share.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Point3, Vector6};

use super::field::HALF;
use super::view_block::{
    Layout, Own, PixelWeights, Rest, SharedMatrix, SharedVector, ViewBlock, add_form, add_form_gradient, prior_weight,
};
use super::{JOINT_PRIOR_RAD, JointProblem, Noise};
use crate::estimate::handeye::HandEyeError;
use crate::estimate::handeye::joint::state::State;
use crate::geometry::se3::skew;
use crate::geometry::view_equations::PoseEquations;
use crate::progress::CancelToken;

/// Name of the method in errors.
const METHOD: &str = "the joint estimator";

/// What is known of one shared unknown beforehand.
#[derive(Debug, Clone, Copy)]
struct SharedPrior {
    index: usize,
    /// Current value minus the one expected.
    offset: f64,
    /// Inverse variance.
    precision: f64,
}

/// What is known of the lens beforehand.
#[derive(Clone)]
struct KnownLens {
    /// Current values minus those expected.
    offset: DVector<f64>,
    information: DMatrix<f64>,
}

/// All views linearised at one estimate.
pub struct System {
    pub blocks: Vec<ViewBlock>,
    pub corrections: Vec<Vector6<f64>>,
    pub layout: Layout,
    /// Of all but the lens and the robot's field, whose priors are its noise levels.
    priors: Vec<SharedPrior>,
    known_lens: Option<KnownLens>,
    /// Slopes of the field.
    pub slopes: Vec<f64>,
    /// Sum of `Jsᵀ Js` over the poses' parts of the views, upper triangle.
    shared: SharedMatrix,
    shared_gradient: SharedVector,
    /// Sum of the rests of the views.
    rest: Rest,
    /// Polled at every view by whatever loops over them.
    pub cancel: CancelToken,
}

impl System {
    pub fn new(problem: &JointProblem<'_>, state: &State, cancel: &CancelToken) -> Result<Self, HandEyeError> {
        let layout = state.layout(problem);
        let mut system = Self {
            blocks: Vec::with_capacity(problem.views.len()),
            corrections: state.corrections.clone(),
            layout,
            priors: priors(state, layout),
            known_lens: known_lens(problem, state),
            slopes: state.field.as_ref().map_or_else(Vec::new, |field| field.slopes().to_vec()),
            shared: SharedMatrix::zeros(),
            shared_gradient: SharedVector::zeros(),
            rest: Rest::nothing(),
            cancel: cancel.clone(),
        };
        for index in 0..problem.views.len() {
            if cancel.is_cancelled() {
                return Err(HandEyeError::Cancelled);
            }
            system.add(linearise(problem, state, index)?);
        }
        Ok(system)
    }

    fn add(&mut self, block: ViewBlock) {
        block.add_shared(self.layout, &mut self.shared);
        self.shared_gradient += block.shared_gradient;
        self.rest.form += block.rest.form;
        self.rest.gradient += block.rest.gradient;
        self.rest.squared_px += block.rest.squared_px;
        self.blocks.push(block);
    }

    /// The same with the views alone that are asked for.
    pub fn of_views(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept = |index: &usize| keep(*index);
        let corrections = (0..self.blocks.len()).filter(kept).map(|i| self.corrections[i]).collect();
        let mut system = Self {
            blocks: Vec::with_capacity(self.blocks.len()),
            corrections,
            layout: self.layout,
            priors: self.priors.clone(),
            known_lens: self.known_lens.clone(),
            slopes: self.slopes.clone(),
            shared: SharedMatrix::zeros(),
            shared_gradient: SharedVector::zeros(),
            rest: Rest::nothing(),
            cancel: self.cancel.clone(),
        };
        for index in (0..self.blocks.len()).filter(kept) {
            system.add(self.blocks[index].clone());
        }
        system
    }

    /// Weighted squares of the rests after a step of the shared unknowns, and their expectation on top of it when these
    /// have the covariance given; both unweighted, squared pixels.
    pub fn rest_squares(&self, step: &DVector<f64>, covariance: &DMatrix<f64>) -> (f64, f64) {
        let f = self.layout.form;
        let moved = step.rows(Layout::FORM_AT, f);
        let (mut squares, mut expected) = (self.rest.squared_px, 0.0);
        for j in 0..f {
            squares += 2.0 * self.rest.gradient[j] * moved[j];
            for i in 0..f {
                squares += self.rest.form[(i, j)] * moved[i] * moved[j];
                expected += self.rest.form[(i, j)] * covariance[(Layout::FORM_AT + i, Layout::FORM_AT + j)];
            }
        }
        (squares.max(0.0), expected)
    }

    /// What the rests of the views say of the shared unknowns, for corners of a noise of one pixel.
    pub fn rest_information(&self) -> DMatrix<f64> {
        let (n, f) = (self.layout.count(), self.layout.form);
        let mut out = DMatrix::zeros(n, n);
        out.view_mut((Layout::FORM_AT, Layout::FORM_AT), (f, f)).copy_from(&self.rest.form.view((0, 0), (f, f)));
        out
    }

    pub fn residual_count(&self) -> usize {
        2 * self.blocks.iter().map(ViewBlock::corner_count).sum::<usize>()
    }

    /// Minus twice the log of the joint density at the point of linearisation, without the normalising terms.
    pub fn cost(&self, noise: &Noise) -> f64 {
        let prior = prior_weight(noise);
        let weights = PixelWeights::new(noise);
        self.blocks.iter().map(|block| block.weighted_squares(weights)).sum::<f64>()
            + self.corrections.iter().map(|c| c.component_mul(c).dot(&prior)).sum::<f64>()
            + self.prior_cost(noise, None)
    }

    fn known(&self, noise: &Noise) -> impl Iterator<Item = SharedPrior> {
        let at = self.layout.field_at();
        let precisions = [noise.field_m.powi(-2), noise.field_rad.powi(-2)];
        let of_field = self.slopes.iter().enumerate().map(move |(k, slope)| SharedPrior {
            index: at + k,
            offset: *slope,
            precision: precisions[k / HALF],
        });
        self.priors.iter().copied().chain(of_field)
    }

    /// The cost of what is known beforehand of the shared unknowns, after a step of them.
    pub fn prior_cost(&self, noise: &Noise, step: Option<&DVector<f64>>) -> f64 {
        let single = self.known(noise).map(|p| p.precision * (p.offset + step.map_or(0.0, |s| s[p.index])).powi(2));
        let of_lens = self.known_lens.as_ref().map_or(0.0, |known| {
            let at = step.map_or_else(
                || known.offset.clone(),
                |step| &known.offset + step.rows(Layout::FORM_AT, known.offset.len()),
            );
            at.dot(&(&known.information * &at))
        });
        single.sum::<f64>() + of_lens
    }

    /// What is known beforehand, as an information matrix.
    pub fn prior_information(&self, noise: &Noise) -> DMatrix<f64> {
        let n = self.layout.count();
        let mut known = DMatrix::zeros(n, n);
        for p in self.known(noise) {
            known[(p.index, p.index)] += p.precision;
        }
        if let Some(KnownLens { information, .. }) = &self.known_lens {
            let mut of_lens = known.view_mut((Layout::FORM_AT, Layout::FORM_AT), information.shape());
            of_lens += information;
        }
        known
    }

    /// The part of the unknowns that is known beforehand: `tr(C P)` over the priors of the shared unknowns.
    pub fn prior_trace(&self, noise: &Noise, covariance: &DMatrix<f64>) -> f64 {
        let of_lens = self.known_lens.as_ref().map_or(0.0, |known| {
            let at = (Layout::FORM_AT, Layout::FORM_AT);
            known.information.dot(&covariance.view(at, known.information.shape()))
        });
        self.known(noise).map(|p| p.precision * covariance[(p.index, p.index)]).sum::<f64>() + of_lens
    }

    /// Eliminates the corrections.
    pub fn reduce(&self, noise: &Noise) -> Result<Reduced, HandEyeError> {
        self.reduce_damped(noise, 0.0)
    }

    /// As [`Self::reduce`], with every diagonal entry raised by the factor `1 + damping` (Marquardt).
    pub fn reduce_damped(&self, noise: &Noise, damping: f64) -> Result<Reduced, HandEyeError> {
        let weights = PixelWeights::new(noise);
        let prior = prior_weight(noise);
        let n = self.layout.count();
        let mut matrix = self.shared * weights.pose;
        let mut gradient = self.shared_gradient * weights.pose;
        add_form(self.layout, &self.rest.form, weights.rest, &mut matrix);
        add_form_gradient(self.layout, &self.rest.gradient, weights.rest, &mut gradient);
        for p in self.known(noise) {
            matrix[(p.index, p.index)] += p.precision;
            gradient[p.index] += p.precision * p.offset;
        }
        if let Some(KnownLens { offset, information }) = &self.known_lens {
            let pull = information * offset;
            for j in 0..offset.len() {
                gradient[Layout::FORM_AT + j] += pull[j];
                for i in 0..=j {
                    matrix[(Layout::FORM_AT + i, Layout::FORM_AT + j)] += information[(i, j)];
                }
            }
        }
        for i in 0..n {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut eliminated = Vec::with_capacity(self.blocks.len());
        for (block, correction) in self.blocks.iter().zip(&self.corrections) {
            if self.cancel.is_cancelled() {
                return Err(HandEyeError::Cancelled);
            }
            let own = Own::new(block, n, correction, weights.pose, &prior, damping)
                .ok_or_else(|| self.singular("the pose correction of a view is undetermined"))?;
            own.take_from(n, &mut matrix, &mut gradient);
            eliminated.push(own);
        }
        let full = DMatrix::from_fn(n, n, |i, j| matrix[(i.min(j), i.max(j))]);
        let Some((factor, scale)) = scaled_cholesky(&full) else {
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

/// Prior of a joint whose offset cannot be told: as good as none.
const HELD_JOINT_RAD: f64 = 1e-8;

fn priors(state: &State, layout: Layout) -> Vec<SharedPrior> {
    // The target takes up an offset of the first joint, and the hand-eye or the target one of the last: freeing them adds
    // nothing but the width of their prior.
    let last = state.joints_rad.len().saturating_sub(1);
    let sigma = |j: usize| if j == 0 || j == last { HELD_JOINT_RAD } else { JOINT_PRIOR_RAD };
    let joints = state.joints_rad.iter().enumerate().map(|(j, offset)| SharedPrior {
        index: layout.joints_at() + j,
        offset: *offset,
        precision: sigma(j).powi(-2),
    });
    joints.collect()
}

fn known_lens(problem: &JointProblem<'_>, state: &State) -> Option<KnownLens> {
    let prior = problem.lens_prior.filter(|_| problem.free.intrinsics)?;
    let (now, expected) = (state.intrinsics.parameters(), prior.expected.parameters());
    let offset = DVector::from_iterator(now.len(), now.iter().zip(&expected).map(|(now, expected)| now - expected));
    Some(KnownLens { offset, information: prior.information.clone() })
}

fn linearise(problem: &JointProblem<'_>, state: &State, index: usize) -> Result<ViewBlock, HandEyeError> {
    let view = &problem.views[index];
    let chain = state.chain(problem, view, &state.corrections[index]);
    let sqrt_weights = problem.sqrt_weights(view);
    let seen = problem.seen(state, view, &sqrt_weights);
    let equations = PoseEquations::new(&seen, &chain.camera_from_target, problem.free.form()).map_err(|_behind| {
        HandEyeError::NoSolution {
            method: METHOD,
            views: problem.views.len(),
            reason: "the estimate puts the target behind the camera",
        }
    })?;
    let place = state.field.as_ref().map(|field| field.place(&view.base_from_tip));
    ViewBlock::new(&chain, equations, state.layout(problem), place.as_ref()).ok_or(HandEyeError::NoSolution {
        method: METHOD,
        views: problem.views.len(),
        reason: "the corners of a view lie on a line and determine no pose",
    })
}

/// Smallest pivot of the scaled Cholesky factor taken as non-zero: `sqrt(f64::EPSILON)` is where the squared factor
/// has lost all digits.
const SINGULAR_PIVOT: f64 = 1.5e-8;

/// Cholesky factor of an information matrix scaled to unit diagonal, and the scale; `None` when singular.
fn scaled_cholesky(matrix: &DMatrix<f64>) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
    let n = matrix.nrows();
    let scale = DVector::from_fn(n, |i, _| matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip());
    // Columns differ by many orders (metres, radians, lens coefficients); scaled, the pivots say what is singular.
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let factor = Cholesky::new(scaled).filter(|f| f.l_dirty().diagonal().iter().all(|p| *p > SINGULAR_PIVOT))?;
    Some((factor, scale))
}

fn scaled_inverse(factor: &Cholesky<f64, Dyn>, scale: &DVector<f64>) -> DMatrix<f64> {
    let inverse = factor.inverse();
    DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j])
}

/// Inverse of an information matrix; `None` when it leaves a direction free.
pub fn covariance_of(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    scaled_cholesky(information).map(|(factor, scale)| scaled_inverse(&factor, &scale))
}

/// The system in the shared unknowns alone.
pub struct Reduced {
    factor: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
    gradient: DVector<f64>,
    pub own: Vec<Own>,
}

impl Reduced {
    /// Length of a step of the shared unknowns in units of their standard deviation.
    pub fn length(&self, step: &DVector<f64>) -> f64 {
        (self.factor.l().tr_mul(&step.component_div(&self.scale))).norm()
    }

    /// The covariance of the shared unknowns times a vector.
    pub fn solve(&self, rhs: &DVector<f64>) -> DVector<f64> {
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
        self.own.iter().map(|own| own.step(&wide)).collect()
    }

    /// Inverse of the reduced matrix: the covariance of the shared unknowns when the system is undamped.
    pub fn inverse(&self) -> DMatrix<f64> {
        scaled_inverse(&self.factor, &self.scale)
    }

    /// The reduced matrix itself.
    pub fn information(&self) -> DMatrix<f64> {
        let lower = self.factor.l();
        let scaled = &lower * lower.transpose();
        DMatrix::from_fn(scaled.nrows(), scaled.ncols(), |i, j| scaled[(i, j)] / (self.scale[i] * self.scale[j]))
    }

    /// Log-determinant of the whole normal matrix, shared unknowns and corrections.
    pub fn log_determinant(&self) -> f64 {
        let shared: f64 = self.factor.l_dirty().diagonal().iter().map(|p| 2.0 * p.ln()).sum::<f64>()
            - self.scale.iter().map(|s| 2.0 * s.ln()).sum::<f64>();
        shared + self.own.iter().map(Own::log_determinant).sum::<f64>()
    }

    /// How much a full step lowers the quadratic cost.
    pub fn decrease(&self) -> f64 {
        let shared = self.gradient.dot(&self.solve(&self.gradient));
        shared + self.own.iter().map(Own::decrease).sum::<f64>()
    }

    /// The step of the shared unknowns when one view is taken away: one Newton step of the remaining system, whose
    /// gradient is minus that of the view. `None` when the rest does not determine an answer.
    pub fn step_without(
        &self,
        block: &ViewBlock,
        layout: Layout,
        noise: &Noise,
        correction: &Vector6<f64>,
    ) -> Option<DVector<f64>> {
        let (matrix, gradient) = block.information(layout, noise, correction)?;
        let n = self.gradient.len();
        let full = self.factor.l() * self.factor.l().transpose();
        let rest = DMatrix::from_fn(n, n, |i, j| full[(i, j)] - matrix[(i, j)] * self.scale[i] * self.scale[j]);
        let factor = Cholesky::new(rest).filter(|f| f.l_dirty().diagonal().iter().all(|p| *p > SINGULAR_PIVOT))?;
        let rhs = DVector::from_fn(n, |i, _| gradient[i] * self.scale[i]);
        Some(factor.solve(&rhs).component_mul(&self.scale))
    }

    /// Displacement of `point` (camera coordinates) in the mount when one view is taken away.
    pub fn influence_of(
        &self,
        block: &ViewBlock,
        layout: Layout,
        noise: &Noise,
        correction: &Vector6<f64>,
        point: &Point3<f64>,
    ) -> Option<f64> {
        let step = self.step_without(block, layout, noise, correction)?;
        let translation = step.fixed_rows::<3>(0) - skew(&point.coords) * step.fixed_rows::<3>(3);
        Some(translation.norm())
    }
}
