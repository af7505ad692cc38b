//! The normal equations of all views and their reduction to the unknowns that these share.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Point3, Vector6};

use super::pose_part::Rest;
use super::variance::levels_of_effects;
use super::view_block::{Layout, Own, PixelWeights, ViewBlock, add_rest, add_square, columns, prior_weight};
use super::{DepthWeight, JointProblem, Noise, SIZE_SIGMA};
use crate::handeye::HandEyeError;
use crate::handeye::joint::state::State;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3::skew;
use handeye_geometry::view_equations::PoseEquations;

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
#[derive(Debug, Clone)]
struct PriorOfLens {
    /// Current values minus those expected.
    offset: DVector<f64>,
    information: DMatrix<f64>,
}

/// All views linearised at one estimate.
#[derive(Debug)]
pub struct System {
    pub blocks: Vec<ViewBlock>,
    pub corrections: Vec<Vector6<f64>>,
    pub layout: Layout,
    /// Priors of all unknowns but the lens and the effects, whose priors are their levels.
    priors: Vec<SharedPrior>,
    known_lens: Option<PriorOfLens>,
    /// Slopes of the field and errors of the arm, as they are now.
    pub effects: Vec<f64>,
    /// Sum of `Jsᵀ Js` over the poses' parts of the views, upper triangle.
    shared: DMatrix<f64>,
    /// Sum of `Jsᵀ r` over the same parts.
    shared_gradient: DVector<f64>,
    /// Sum of the rests of the views.
    rest: Rest,
    /// Polled at every view by loops over them.
    pub cancel: CancelToken,
}

impl System {
    pub fn new(problem: &JointProblem<'_>, state: &State, cancel: &CancelToken) -> Result<Self, HandEyeError> {
        let layout = state.layout(problem);
        let n = layout.count();
        let mut system = Self {
            blocks: Vec::with_capacity(problem.views.len()),
            corrections: state.corrections.clone(),
            layout,
            priors: priors(problem, state),
            known_lens: known_lens(problem, state),
            effects: state.effects(),
            shared: DMatrix::zeros(n, n),
            shared_gradient: DVector::zeros(n),
            rest: Rest::nothing(layout.form),
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
        add_square(&mut self.shared, columns(&block.by_shared), 1.0);
        self.shared_gradient.gemv(1.0, &block.by_shared, &block.residual, 1.0);
        self.rest.add(&block.rest);
        self.blocks.push(block);
    }

    /// Weighted squares of the rests after a step of the shared unknowns, and their expectation on top of it when these
    /// have the covariance given; both unweighted, squared pixels.
    pub fn rest_squares(&self, step: &DVector<f64>, covariance: &DMatrix<f64>) -> (f64, f64) {
        let (at, f) = (Layout::FORM_AT, self.layout.form);
        let moved = step.rows(at, f);
        let squares = self.rest.squared_px + moved.dot(&(&self.rest.form * moved + &self.rest.gradient * 2.0));
        (squares.max(0.0), self.rest.form.dot(&covariance.view((at, at), (f, f))))
    }

    /// Information of the rests of the views on the form, for corners with a noise of one pixel.
    pub fn rest_information(&self) -> &DMatrix<f64> {
        &self.rest.form
    }

    pub fn residual_count(&self) -> usize {
        self.blocks.iter().map(|block| 2 * block.corners + block.depths).sum()
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
        let of_kinds = self.layout.effects().into_iter().zip(levels_of_effects(noise));
        let of_effects = of_kinds.flat_map(move |(kind, level)| {
            let precision = level.powi(-2);
            kind.map(move |index| SharedPrior { index, offset: self.effects[index - at], precision })
        });
        self.priors.iter().copied().chain(of_effects)
    }

    /// The cost of the priors of the shared unknowns, after a step of them.
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

    /// The priors, as an information matrix.
    pub fn prior_information(&self, noise: &Noise) -> DMatrix<f64> {
        let n = self.layout.count();
        let mut known = DMatrix::zeros(n, n);
        for p in self.known(noise) {
            known[(p.index, p.index)] += p.precision;
        }
        if let Some(PriorOfLens { information, .. }) = &self.known_lens {
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
        let mut matrix = &self.shared * weights.pose;
        let mut gradient = &self.shared_gradient * weights.pose;
        add_rest(&self.rest, weights.rest, &mut matrix, &mut gradient);
        for p in self.known(noise) {
            matrix[(p.index, p.index)] += p.precision;
            gradient[p.index] += p.precision * p.offset;
        }
        if let Some(PriorOfLens { offset, information }) = &self.known_lens {
            let mut of_lens = matrix.view_mut((Layout::FORM_AT, Layout::FORM_AT), information.shape());
            of_lens += information;
            let mut of_lens = gradient.rows_mut(Layout::FORM_AT, offset.len());
            of_lens += information * offset;
        }
        for i in 0..gradient.len() {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut eliminated = Vec::with_capacity(self.blocks.len());
        for (block, correction) in self.blocks.iter().zip(&self.corrections) {
            if self.cancel.is_cancelled() {
                return Err(HandEyeError::Cancelled);
            }
            let own = Own::new(block, correction, weights.pose, &prior, damping)
                .ok_or_else(|| self.singular("the pose correction of a view is undetermined"))?;
            own.take_from(&mut matrix, &mut gradient);
            eliminated.push(own);
        }
        matrix.fill_lower_triangle_with_upper_triangle();
        let Some((factor, scale)) = scaled_cholesky(&matrix) else {
            return Err(self.singular(
                "some direction of the answer leaves every residual unchanged: add views turned about other axes",
            ));
        };
        Ok(Reduced { information: matrix, factor, scale, gradient, own: eliminated })
    }

    fn singular(&self, reason: &'static str) -> HandEyeError {
        HandEyeError::NoSolution { method: METHOD, views: self.blocks.len(), reason }
    }
}

/// Standard deviations of offset, scale and slope of a depth camera before any data: metres, a part, pixels. They are not prior
/// knowledge, but where the board is always at the same distance, offset and scale cannot be separated.
const DEPTH_PRIOR: [f64; 3] = [0.1, 0.1, 3.0];

fn priors(problem: &JointProblem<'_>, state: &State) -> Vec<SharedPrior> {
    let depth_at = Layout::FORM_AT + problem.free.form().depth_at(&state.intrinsics);
    // Where the depths do not count nothing determines the tilt.
    let tilt = problem.depth.map_or(1.0, DepthWeight::tilt_sigma_rad);
    let sigmas = DEPTH_PRIOR.into_iter().chain([tilt; 2]);
    let depth = state.depth.values().into_iter().zip(sigmas).enumerate().map(|(k, (offset, sigma))| SharedPrior {
        index: depth_at + k,
        offset,
        precision: sigma.powi(-2),
    });
    // A print is known no better than printers and rulers are, and an arm determines its size only as well as its own.
    let scale = (problem.free.arm && problem.free.scale).then(|| SharedPrior {
        index: Layout::FORM_AT + problem.free.form().scale_at(&state.intrinsics),
        offset: state.shape.scale - 1.0,
        precision: SIZE_SIGMA.powi(-2),
    });
    depth.filter(|_| problem.free.depth).chain(scale).collect()
}

fn known_lens(problem: &JointProblem<'_>, state: &State) -> Option<PriorOfLens> {
    let prior = problem.lens_prior.filter(|_| problem.free.intrinsics)?;
    let (now, expected) = (state.intrinsics.parameters(), prior.expected.parameters());
    let offset = DVector::from_iterator(now.len(), now.iter().zip(&expected).map(|(now, expected)| now - expected));
    Some(PriorOfLens { offset, information: prior.information.clone() })
}

fn linearise(problem: &JointProblem<'_>, state: &State, index: usize) -> Result<ViewBlock, HandEyeError> {
    let view = &problem.views[index];
    let chain = state.chain(problem, view, &state.corrections[index]);
    let whitener = problem.whitener(view);
    let seen = problem.seen(state, view, &whitener);
    let equations = PoseEquations::new(&seen, &chain.camera_from_target, problem.free.form()).map_err(|_behind| {
        HandEyeError::NoSolution {
            method: METHOD,
            views: problem.views.len(),
            reason: "the estimate puts the target behind the camera",
        }
    })?;
    let field = state.field.as_ref().map(|field| (field, &view.base_from_tip));
    ViewBlock::new(&chain, &equations, state.layout(problem), field).ok_or(HandEyeError::NoSolution {
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
    let scale = matrix.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt().recip());
    Some((cholesky(matrix, &scale)?, scale))
}

/// Columns differ by many orders (metres, radians, lens coefficients); scaled, the pivots show what is singular.
fn cholesky(matrix: &DMatrix<f64>, scale: &DVector<f64>) -> Option<Cholesky<f64, Dyn>> {
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    Cholesky::new(scaled).filter(|f| f.l_dirty().diagonal().iter().all(|p| *p > SINGULAR_PIVOT))
}

/// The inverse of the unscaled matrix, from the inverse of its factor: every column of `L⁻ᵀ` adds to the entries that it
/// has.
fn scaled_inverse(factor: &Cholesky<f64, Dyn>, scale: &DVector<f64>) -> DMatrix<f64> {
    let upper = factor.l_dirty().transpose();
    let n = upper.nrows();
    let mut inverse = DMatrix::zeros(n, n);
    let mut column = vec![0.0; n];
    for k in 0..n {
        column.fill(0.0);
        column[k] = 1.0;
        for i in (0..=k).rev() {
            column[i] /= upper[(i, i)];
            let (above, at) = column.split_at_mut(i);
            above.iter_mut().zip(&upper.as_slice()[i * n..]).for_each(|(value, u)| *value -= at[0] * u);
        }
        for j in 0..=k {
            let sums = &mut inverse.as_mut_slice()[j * n..][..=j];
            sums.iter_mut().zip(&column).for_each(|(sum, value)| *sum += column[j] * value);
        }
    }
    for j in 0..n {
        for i in 0..=j {
            inverse[(i, j)] *= scale[i] * scale[j];
        }
    }
    inverse.fill_lower_triangle_with_upper_triangle();
    inverse
}

/// Inverse of an information matrix; `None` when it leaves a direction free.
pub fn covariance_of(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    scaled_cholesky(information).map(|(factor, scale)| scaled_inverse(&factor, &scale))
}

/// The system in the shared unknowns alone.
pub struct Reduced {
    /// Information matrix of the shared unknowns.
    pub information: DMatrix<f64>,
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

    /// The step of every correction that belongs to a shared step.
    pub fn own_steps(&self, shared_step: &DVector<f64>) -> Vec<Vector6<f64>> {
        self.own.iter().map(|own| own.step(shared_step)).collect()
    }

    /// Inverse of the reduced matrix: the covariance of the shared unknowns when the system is undamped.
    pub fn inverse(&self) -> DMatrix<f64> {
        scaled_inverse(&self.factor, &self.scale)
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

    /// The step of the shared unknowns from an optimum when views are taken away: one Newton step of the remaining system,
    /// whose gradient is minus theirs. `None` when the rest does not determine an answer.
    pub fn step_without<'a>(
        &self,
        views: impl IntoIterator<Item = (&'a ViewBlock, &'a Vector6<f64>)>,
        noise: &Noise,
    ) -> Option<DVector<f64>> {
        let (mut rest, mut pull) = (self.information.clone(), DVector::zeros(self.gradient.len()));
        for (block, correction) in views {
            let (information, gradient) = block.information(noise, correction)?;
            rest -= information;
            pull += gradient;
        }
        let factor = cholesky(&rest, &self.scale)?;
        Some(factor.solve(&pull.component_mul(&self.scale)).component_mul(&self.scale))
    }

    /// Displacement of `point` (camera coordinates) in the mount when one view is taken away.
    pub fn influence_of(
        &self,
        block: &ViewBlock,
        noise: &Noise,
        correction: &Vector6<f64>,
        point: &Point3<f64>,
    ) -> Option<f64> {
        let step = self.step_without([(block, correction)], noise)?;
        let translation = step.fixed_rows::<3>(0) - skew(&point.coords) * step.fixed_rows::<3>(3);
        Some(translation.norm())
    }
}
