//! The equations of the coefficients of a residual distortion, and its level.

use nalgebra::{DMatrix, DVector, Matrix6xX};

use super::GAIN;
use crate::estimate::handeye::HandEyeError;
use crate::estimate::handeye::joint::normal::Reduced;
use crate::estimate::handeye::joint::state::State;
use crate::estimate::handeye::joint::view_block::{Layout, Own, PixelWeights, ViewBlock, whitened};
use crate::estimate::handeye::joint::{JointProblem, JointSolution, Noise};
use crate::geometry::camera::residual_distortion::{basis, functions};
use crate::geometry::view_equations::{MAX_FORM, POSE, Pair, Rows};
use crate::progress::CancelToken;

/// Part of [`GAIN`] that the square of the score, which follows from one product, has to reach for the rest to be computed. Of
/// 276 simulated sessions that gain enough none was missed, and nine in ten spectra of healthy ones were spared.
const NEARLY: f64 = 0.4;
/// Standard deviations of a coefficient that are tried, pixels: from the least to the largest by this factor.
const LEVELS: (f64, f64, f64) = (1e-4, 1.0, 1.1);
/// Information below this part of the largest counts as none: a direction known a hundred times worse than the best says
/// nothing of a field of a pixel, and where lens and poses take one up, rounding leaves 2e-5 of the largest on recorded sets.
const UNSEEN: f64 = 1e-4;

/// The normal equations of the coefficients once all else is eliminated.
#[derive(Clone)]
pub struct Equations {
    /// Of the coefficients, per squared pixel.
    pub information: DMatrix<f64>,
    /// At coefficients of zero: the right side.
    pub pull: DVector<f64>,
    /// How the shared unknowns follow the coefficients, with the opposite sign.
    pub follow: DMatrix<f64>,
    /// Residuals less the unknowns of the views and of the lens.
    pub residuals: f64,
}

/// A field at the level that it most likely has.
pub struct MostLikely {
    pub level_px: f64,
    pub gain: f64,
    pub coefficients: DVector<f64>,
    /// Trace of what the coefficients take up.
    pub freedom: f64,
}

impl Equations {
    /// Of all polynomials up to a degree, at an optimum; `None` where there are too few residuals for them to be shown.
    pub fn new(
        problem: &JointProblem<'_>,
        solution: &JointSolution,
        degree: usize,
        cancel: &CancelToken,
    ) -> Result<Option<Self>, HandEyeError> {
        let (state, noise) = (State::of(solution), &solution.noise);
        let system = solution.linearised(problem)?;
        let unknowns = 6 * problem.views.len() + system.layout.form;
        let residuals = system.residual_count().saturating_sub(unknowns) as f64;
        if residuals <= 0.0 {
            return Ok(None);
        }
        let reduced = system.reduce(noise)?;
        let (n, k) = (system.layout.count(), 2 * functions(degree));
        let mut sums =
            Sums { information: DMatrix::zeros(k, k), gradient: DVector::zeros(k), cross: DMatrix::zeros(n, k) };
        for index in 0..problem.views.len() {
            if cancel.is_cancelled() {
                return Err(HandEyeError::Cancelled);
            }
            let Some(products) = Products::new(problem, &state, index, degree) else { return Ok(None) };
            let (block, own) = (&system.blocks[index], &reduced.own[index]);
            sums.add(&products, block, own, noise);
        }
        Ok(Some(Self::eliminated(&sums, &reduced, residuals)))
    }

    fn eliminated(sums: &Sums, reduced: &Reduced, residuals: f64) -> Self {
        let mut follow = sums.cross.clone();
        for mut column in follow.column_iter_mut() {
            let solved = reduced.solve(&column.clone_owned());
            column.copy_from(&solved);
        }
        let information = &sums.information - sums.cross.tr_mul(&follow);
        let information = 0.5 * (&information + information.transpose());
        // What is left of the gradient where the optimum has a step to go.
        let gradient = &sums.gradient + sums.cross.tr_mul(&reduced.shared_step());
        Self { information, pull: -gradient, follow, residuals }
    }

    /// Those of the polynomials up to a lower degree.
    pub fn up_to(&self, degree: usize) -> Self {
        let (all, some) = (self.pull.len() / 2, functions(degree));
        let kept: Vec<usize> = (0..some).chain(all..all + some).collect();
        Self {
            information: self.information.select_rows(&kept).select_columns(&kept),
            pull: self.pull.select_rows(&kept),
            follow: self.follow.select_columns(&kept),
            residuals: self.residuals,
        }
    }

    /// The same where a field with these coefficients was taken off before.
    pub fn beyond(mut self, coefficients: &DVector<f64>) -> Self {
        self.pull += &self.information * coefficients;
        self
    }

    /// The same for corners of another noise.
    pub fn times(mut self, factor: f64) -> Self {
        self.information *= factor;
        self.pull *= factor;
        self
    }

    /// The level with the largest gain; `None` where the score says that there is none to speak of.
    pub fn most_likely(&self) -> Option<MostLikely> {
        let score = self.pull.norm_squared() - self.information.trace();
        let spread = (2.0 * self.information.norm_squared()).sqrt();
        if score <= 0.0 || (score / spread).powi(2) < NEARLY * GAIN {
            return None;
        }
        Some(self.spectrum().most_likely())
    }

    /// Along the axes of the information.
    pub fn spectrum(&self) -> Spectrum {
        let eigen = self.information.clone().symmetric_eigen();
        let least = UNSEEN * eigen.eigenvalues.max();
        let pull = eigen.eigenvectors.tr_mul(&self.pull);
        let seen = |a: f64, value: f64| if a > least { value } else { 0.0 };
        Spectrum {
            information: eigen.eigenvalues.map(|a| seen(a, a)),
            pull: eigen.eigenvalues.zip_map(&pull, seen),
            axes: eigen.eigenvectors,
        }
    }
}

/// The equations of the coefficients along the axes of their information.
pub struct Spectrum {
    pub axes: DMatrix<f64>,
    information: DVector<f64>,
    pull: DVector<f64>,
}

impl Spectrum {
    /// Gain of twice the log-likelihood by a field of a level.
    fn gain(&self, level_px: f64) -> f64 {
        let square = level_px.powi(2);
        let of = |(a, h): (&f64, &f64)| square * h * h / (1.0 + square * a) - (square * a).ln_1p();
        self.information.iter().zip(&self.pull).map(of).sum()
    }

    pub fn most_likely(&self) -> MostLikely {
        let (least, most, factor) = LEVELS;
        let (mut level_px, mut gain) = (least, self.gain(least));
        let mut tried = least;
        while tried < most {
            tried *= factor;
            let found = self.gain(tried);
            if found > gain {
                (level_px, gain) = (tried, found);
            }
        }
        let variances = self.variances(level_px);
        let freedom = self.information.component_mul(&variances).sum();
        MostLikely { level_px, gain, coefficients: &self.axes * self.pull.component_mul(&variances), freedom }
    }

    /// Of the coefficients along the axes.
    pub fn variances(&self, level_px: f64) -> DVector<f64> {
        self.information.map(|a| (a + level_px.powi(-2)).recip())
    }

    /// Length of a way of the coefficients in its standard deviations, squared.
    pub fn length(&self, way: &DVector<f64>, level_px: f64) -> f64 {
        let along = self.axes.tr_mul(way);
        along.component_mul(&along).component_div(&self.variances(level_px)).sum()
    }
}

/// Inner products of the columns of the coefficients with all columns of a view, those of the displacement along x first.
struct Products {
    by_pose: Matrix6xX<f64>,
    by_form: DMatrix<f64>,
    by_residual: DVector<f64>,
    own: DMatrix<f64>,
}

impl Products {
    /// `None` where a corner has no image.
    fn new(problem: &JointProblem<'_>, state: &State, index: usize, degree: usize) -> Option<Self> {
        let view = &problem.views[index];
        let chain = state.chain(problem, view, &state.corrections[index]);
        let sqrt_weights = problem.sqrt_weights(view);
        let seen = problem.seen(state, view, &sqrt_weights);
        let rows = Rows::new(&seen, &chain.camera_from_target, problem.free.form());
        let (n, f) = (view.corners.len(), functions(degree));
        let columns = POSE + rows.count + 1;
        let size = (state.intrinsics.width, state.intrinsics.height);
        let mut functions = DMatrix::zeros(f, n);
        let mut weights = [vec![1.0; n], vec![0.0; n], vec![1.0; n]];
        let mut others: [DMatrix<f64>; 2] = std::array::from_fn(|_| DMatrix::zeros(columns, n));
        let mut row = [Pair::default(); POSE + MAX_FORM + 1];
        for (i, corner) in view.corners.iter().enumerate() {
            rows.fill(i, corner, &mut row).ok()?;
            let basis = DVector::from_vec(basis(size, degree, &corner.px));
            let [[a, b], [c, d]] =
                sqrt_weights.get(i).map_or([[1.0, 0.0], [0.0, 1.0]], |w| [[w.m11, w.m12], [w.m21, w.m22]]);
            for (weights, weight) in weights.iter_mut().zip([a * a + c * c, a * b + c * d, b * b + d * d]) {
                weights[i] = weight;
            }
            functions.set_column(i, &basis);
            for (j, [x, y]) in row[..columns].iter().enumerate() {
                others[0][(j, i)] = a * x + c * y;
                others[1][(j, i)] = b * x + d * y;
            }
        }
        let transposed = functions.transpose();
        let weighed = |weights: &[f64]| DMatrix::from_fn(f, n, |i, j| functions[(i, j)] * weights[j]) * &transposed;
        let xx = weighed(&weights[0]);
        // Corners that count alike have the same weight along both axes, and none between them.
        let (xy, yy) = if sqrt_weights.is_empty() {
            (DMatrix::zeros(f, f), xx.clone())
        } else {
            (weighed(&weights[1]), weighed(&weights[2]))
        };
        let mut own = DMatrix::zeros(2 * f, 2 * f);
        own.view_mut((0, 0), (f, f)).copy_from(&xx);
        own.view_mut((0, f), (f, f)).copy_from(&xy);
        own.view_mut((f, 0), (f, f)).copy_from(&xy);
        own.view_mut((f, f), (f, f)).copy_from(&yy);
        let mut by = DMatrix::zeros(columns, 2 * f);
        for (half, others) in others.iter().enumerate() {
            by.columns_mut(half * f, f).copy_from(&(others * &transposed));
        }
        Some(Self {
            by_pose: by.fixed_rows::<POSE>(0).into_owned(),
            by_form: by.rows(POSE, rows.count).into_owned(),
            by_residual: by.row(columns - 1).transpose(),
            own,
        })
    }
}

/// Weighted sums over the views with the corrections of their robot poses eliminated.
struct Sums {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Between shared unknowns and coefficients.
    cross: DMatrix<f64>,
}

impl Sums {
    /// Adds a view.
    fn add(&mut self, products: &Products, block: &ViewBlock, own: &Own, noise: &Noise) {
        let weights = PixelWeights::new(noise);
        let excess = weights.pose - weights.rest;
        // As the residuals are, what the coefficients do is split into what a pose could explain and the rest.
        let of_pose = whitened(&block.root(), products.by_pose.clone());
        self.information += &products.own * weights.rest + of_pose.tr_mul(&of_pose) * excess;
        self.gradient += &products.by_residual * weights.rest + of_pose.tr_mul(&block.residual) * excess;
        let mut cross = &block.by_shared * &of_pose * weights.pose;
        let mut of_form = cross.rows_mut(Layout::FORM_AT, products.by_form.nrows());
        of_form *= excess / weights.pose;
        of_form += &products.by_form * weights.rest;
        let taken = whitened(own.factor.l_dirty(), block.by_correction.tr_mul(&of_pose) * weights.pose);
        self.information -= taken.tr_mul(&taken);
        self.gradient -= taken.tr_mul(&own.whitened_gradient);
        self.cross += cross - &own.whitened * &taken;
    }
}
