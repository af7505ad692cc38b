//! Effects that displace the corners of all views, linear in many small coefficients: their equations, and their level.
//!
//! The residual distortion of a lens is one ([`super::residual_distortion`]), and print errors of a target are another
//! ([`super::print_errors`]). The coefficients `c` are random effects. All other unknowns are eliminated from the normal
//! equations of an optimum, so that the cost as a function of `c` is `cᵀ S c − 2 hᵀ c`. Where they are independent with one
//! standard deviation `s`, with the eigenvalues `a_k` of `S` and `h` in its axes, twice the logarithm of the restricted
//! likelihood gains
//!
//! `Σ s² h_k² / (1 + s² a_k) − ln (1 + s² a_k)`
//!
//! over a model without them.
//!
//! Source: Henderson 1975, "Best linear unbiased estimation and prediction under a selection model"; Patterson & Thompson
//! 1971 (restricted likelihood).

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix6xX};

use super::normal::{Reduced, System};
use super::pose_part::whitened;
use super::state::State;
use super::view_block::{Layout, Own, PixelWeights, ViewBlock, prior_weight};
use super::{JointProblem, JointSolution, Noise};
use crate::handeye::HandEyeError;
use crate::intrinsics::evidence::Score;
use handeye_geometry::camera::residual_distortion::{basis, functions};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::view_equations::{MAX_FORM, POSE, Pair, Rows, ViewInput, Whitener};

/// Part of a gain that the square of the score, which follows from one product, has to reach for the rest to be computed. Of
/// 276 simulated sessions that gain enough by a residual distortion none was missed, and nine in ten spectra of healthy ones
/// were spared.
const NEARLY: f64 = 0.4;
/// Factor between the standard deviations that are tried.
const FACTOR: f64 = 1.1;
/// Information below this part of the largest counts as zero: a direction known a hundred times worse than the best does not
/// determine a field of a pixel, and where lens and poses absorb one, rounding leaves 2e-5 of the largest on recorded sets.
const UNSEEN: f64 = 1e-4;

/// An effect that displaces the corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// Polynomials up to a degree over the image, first those of the displacement along x, pixels.
    Distortion(usize),
    /// The points of the target in its plane, first all along x, metres.
    Print,
}

impl Effect {
    /// Number of coefficients, on a target with this many points.
    fn count(self, points: usize) -> usize {
        2 * match self {
            Self::Distortion(degree) => functions(degree),
            Self::Print => points,
        }
    }
}

/// The normal equations of the coefficients once all else is eliminated.
#[derive(Clone)]
pub struct Equations {
    /// Information matrix of the coefficients.
    pub information: DMatrix<f64>,
    /// The right side at coefficients of zero.
    pub pull: DVector<f64>,
    /// How the shared unknowns follow the coefficients, with the opposite sign.
    pub follow: DMatrix<f64>,
    /// Number of residuals less the unknowns of the views and of the lens.
    pub residuals: f64,
}

/// Score of a view in the shared unknowns and, behind them, the coefficients of effects, with its correction eliminated. `None`
/// where the view has no information.
pub fn score(
    problem: &JointProblem<'_>,
    state: &State,
    system: &System,
    noise: &Noise,
    effects: &[Effect],
    index: usize,
) -> Option<Score> {
    let (block, correction) = (&system.blocks[index], &system.corrections[index]);
    let (information, gradient) = block.information(noise, correction)?;
    if effects.is_empty() {
        return Some(Score { information, gradient });
    }
    let products = Products::new(problem, state, index, effects)?;
    let own = Own::new(block, correction, PixelWeights::new(noise).pose, &prior_weight(noise), 0.0)?;
    let (n, k) = (gradient.len(), products.own.nrows());
    let mut of_effects =
        Sums { information: DMatrix::zeros(k, k), gradient: DVector::zeros(k), cross: DMatrix::zeros(n, k) };
    of_effects.add(&products, block, &own, noise);
    let mut all = DMatrix::zeros(n + k, n + k);
    all.view_mut((0, 0), (n, n)).copy_from(&information);
    all.view_mut((0, n), (n, k)).copy_from(&of_effects.cross);
    all.view_mut((n, 0), (k, n)).copy_from(&of_effects.cross.transpose());
    all.view_mut((n, n), (k, k)).copy_from(&of_effects.information);
    let mut pull = gradient.resize_vertically(n + k, 0.0);
    pull.rows_mut(n, k).copy_from(&of_effects.gradient);
    Some(Score { information: all, gradient: pull })
}

/// An effect at the level that it most likely has.
pub struct MostLikely {
    pub level: f64,
    pub gain: f64,
    pub coefficients: DVector<f64>,
    /// Degrees of freedom that the coefficients use up.
    pub freedom: f64,
}

impl Equations {
    /// Equations of the coefficients of an effect, at an optimum; `None` where there are too few residuals for it to be
    /// shown.
    pub fn new(
        problem: &JointProblem<'_>,
        solution: &JointSolution,
        effect: Effect,
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
        let (n, k) = (system.layout.count(), effect.count(problem.board.len()));
        let mut sums =
            Sums { information: DMatrix::zeros(k, k), gradient: DVector::zeros(k), cross: DMatrix::zeros(n, k) };
        for index in 0..problem.views.len() {
            if cancel.is_cancelled() {
                return Err(HandEyeError::Cancelled);
            }
            let Some(products) = Products::new(problem, &state, index, &[effect]) else { return Ok(None) };
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

    /// The equations of the coefficients `x` with `c = B x`.
    pub fn along(&self, by: &DMatrix<f64>) -> Self {
        let information = by.tr_mul(&(&self.information * by));
        Self {
            information: 0.5 * (&information + information.transpose()),
            pull: by.tr_mul(&self.pull),
            follow: &self.follow * by,
            residuals: self.residuals,
        }
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

    /// The same where an effect with these coefficients was subtracted before.
    pub fn beyond(mut self, coefficients: &DVector<f64>) -> Self {
        self.pull += &self.information * coefficients;
        self
    }

    /// The same for corners with another noise level.
    pub fn times(mut self, factor: f64) -> Self {
        self.information *= factor;
        self.pull *= factor;
        self
    }

    /// Whether by the score a level may gain as much as `gain`.
    pub fn may_gain(&self, gain: f64) -> bool {
        let score = self.pull.norm_squared() - self.information.trace();
        let spread = (2.0 * self.information.norm_squared()).sqrt();
        score > 0.0 && (score / spread).powi(2) >= NEARLY * gain
    }

    /// The equations along the axes of the information.
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
    /// Gain of twice the log-likelihood by an effect of a level.
    pub fn gain(&self, level: f64) -> f64 {
        let square = level.powi(2);
        let of = |(a, h): (&f64, &f64)| square * h * h / (1.0 + square * a) - (square * a).ln_1p();
        self.information.iter().zip(&self.pull).map(of).sum()
    }

    /// The level within a range with the largest gain.
    pub fn most_likely(&self, range: &Range<f64>) -> MostLikely {
        let gains = levels(range).map(|level| (level, self.gain(level)));
        let (level, gain) = gains.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((range.start, 0.0));
        let variances = self.variances(level);
        MostLikely { level, gain, coefficients: self.coefficients(&variances), freedom: self.freedom(&variances) }
    }

    /// Variances of the coefficients along the axes.
    pub fn variances(&self, level: f64) -> DVector<f64> {
        self.information.map(|a| (a + level.powi(-2)).recip())
    }

    /// The coefficients that are most likely where they have these variances.
    pub fn coefficients(&self, variances: &DVector<f64>) -> DVector<f64> {
        &self.axes * self.pull.component_mul(variances)
    }

    /// Degrees of freedom that the coefficients use up.
    pub fn freedom(&self, variances: &DVector<f64>) -> f64 {
        self.information.component_mul(variances).sum()
    }

    /// Squared length of a change of the coefficients in standard deviations.
    pub fn length(&self, way: &DVector<f64>, level: f64) -> f64 {
        let along = self.axes.tr_mul(way);
        along.component_mul(&along).component_div(&self.variances(level)).sum()
    }
}

/// Standard deviations that are tried.
pub fn levels(range: &Range<f64>) -> impl Iterator<Item = f64> {
    let (first, end) = (range.start, range.end);
    std::iter::successors(Some(first), |level| Some(level * FACTOR)).take_while(move |level| *level < end)
}

/// Jacobian of a corner by the place of its point on the target as drawn, from that by the pose: the same except for the scale.
fn by_point(by_pose: Pair, seen: &ViewInput<'_>) -> Pair {
    by_pose.map(|value| value * seen.shape.scale)
}

/// Inner products of the columns of the coefficients with all columns of a view.
struct Products {
    by_pose: Matrix6xX<f64>,
    by_form: DMatrix<f64>,
    by_residual: DVector<f64>,
    own: DMatrix<f64>,
}

impl Products {
    /// Products of several effects, one behind the other; `None` where a corner has no image.
    fn new(problem: &JointProblem<'_>, state: &State, index: usize, effects: &[Effect]) -> Option<Self> {
        let view = &problem.views[index];
        let chain = state.chain(problem, view, &state.corrections[index]);
        let whitener = problem.whitener(view);
        let seen = problem.seen(state, view, &whitener);
        let rows = Rows::new(&seen, &chain.camera_from_target, problem.free.form());
        // Where the errors of the corners of the view are not independent every column covers all rows.
        let apart = !matches!(whitener, Whitener::Together { .. });
        let (by, own) = match effects {
            [Effect::Distortion(degree)] if apart => of_distortion(&seen, &rows, *degree),
            [Effect::Print] if apart => of_print(&seen, &rows),
            [Effect::Print, Effect::Distortion(degree)] if apart => of_print_and_distortion(&seen, &rows, *degree),
            _ => of_all_rows(&seen, &rows, effects),
        }?;
        let last = by.nrows() - 1;
        Some(Self {
            by_pose: by.fixed_rows::<POSE>(0).into_owned(),
            by_form: by.rows(POSE, last - POSE).into_owned(),
            by_residual: by.row(last).transpose(),
            own,
        })
    }
}

/// Inner products of the columns of coefficients with those of the pose, those of the form and the residual, and with each other.
type OfColumns = (DMatrix<f64>, DMatrix<f64>);

/// Products of any effects, one behind the other.
fn of_all_rows(seen: &ViewInput<'_>, rows: &Rows<'_>, effects: &[Effect]) -> Option<OfColumns> {
    let size = (seen.intrinsics.width, seen.intrinsics.height);
    let points = seen.board.len();
    let count = effects.iter().map(|effect| effect.count(points)).sum();
    let fill = |corner: &Corner, row: &[Pair], columns: &mut [Pair]| {
        let mut from = 0;
        for effect in effects {
            let columns = &mut columns[from..from + effect.count(points)];
            from += columns.len();
            match effect {
                Effect::Distortion(degree) => {
                    let half = columns.len() / 2;
                    for (k, value) in basis(size, *degree, &corner.px).into_iter().enumerate() {
                        columns[k] = [value, 0.0];
                        columns[half + k] = [0.0, value];
                    }
                }
                Effect::Print => {
                    columns[corner.index] = by_point(row[0], seen);
                    columns[points + corner.index] = by_point(row[1], seen);
                }
            }
        }
    };
    let all = rows.all(count, fill).ok()?;
    let columns = all.ncols() - count;
    let effect = all.columns(columns, count);
    Some((all.columns(0, columns).tr_mul(&effect), effect.tr_mul(&effect)))
}

fn of_distortion(seen: &ViewInput<'_>, rows: &Rows<'_>, degree: usize) -> Option<OfColumns> {
    let (n, f) = (seen.corners.len(), functions(degree));
    let columns = POSE + rows.count + 1;
    let size = (seen.intrinsics.width, seen.intrinsics.height);
    let mut functions = DMatrix::zeros(f, n);
    let mut weights = [vec![1.0; n], vec![0.0; n], vec![1.0; n]];
    let mut others: [DMatrix<f64>; 2] = std::array::from_fn(|_| DMatrix::zeros(columns, n));
    let mut row = [Pair::default(); POSE + MAX_FORM + 1];
    for (i, corner) in seen.corners.iter().enumerate() {
        rows.fill(i, corner, &mut row).ok()?;
        let basis = DVector::from_vec(basis(size, degree, &corner.px));
        let [[a, b], [c, d]] = whitening(seen, i);
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
    // Corners with equal weights have the same weight along both axes, and none between them.
    let (xy, yy) = if matches!(seen.whitener, Whitener::Alike) {
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
    Some((by, own))
}

/// Products of the print alone: a corner depends only on its own point.
fn of_print(seen: &ViewInput<'_>, rows: &Rows<'_>) -> Option<OfColumns> {
    let n = seen.board.len();
    let columns = POSE + rows.count + 1;
    let mut own = DMatrix::zeros(2 * n, 2 * n);
    let mut by = DMatrix::zeros(columns, 2 * n);
    let mut row = [Pair::default(); POSE + MAX_FORM + 1];
    for (i, corner) in seen.corners.iter().enumerate() {
        rows.fill(i, corner, &mut row).ok()?;
        let by_point = [row[0], row[1]].map(|column| by_point(column, seen));
        let product = |a: &Pair, b: &Pair| a[0] * b[0] + a[1] * b[1];
        let at = [corner.index, n + corner.index];
        for (&k, column) in at.iter().zip(&by_point) {
            for (&l, other) in at.iter().zip(&by_point) {
                own[(k, l)] += product(column, other);
            }
            for (j, other) in row[..columns].iter().enumerate() {
                by[(j, k)] += product(column, other);
            }
        }
    }
    Some((by, own))
}

/// Products of print and distortion, the print first.
fn of_print_and_distortion(seen: &ViewInput<'_>, rows: &Rows<'_>, degree: usize) -> Option<OfColumns> {
    let ((by_print, of_print), (by_distortion, of_distortion)) =
        (of_print(seen, rows)?, of_distortion(seen, rows, degree)?);
    let (n, f) = (seen.board.len(), functions(degree));
    let size = (seen.intrinsics.width, seen.intrinsics.height);
    let mut row = [Pair::default(); POSE + MAX_FORM + 1];
    let mut own = DMatrix::zeros(2 * (n + f), 2 * (n + f));
    for (i, corner) in seen.corners.iter().enumerate() {
        rows.fill(i, corner, &mut row).ok()?;
        let [[a, b], [c, d]] = whitening(seen, i);
        let basis = basis(size, degree, &corner.px);
        for (k, column) in [corner.index, n + corner.index].into_iter().zip(&row) {
            let [x, y] = by_point(*column, seen);
            for (j, value) in basis.iter().enumerate() {
                own[(k, 2 * n + j)] += (a * x + c * y) * value;
                own[(k, 2 * n + f + j)] += (b * x + d * y) * value;
            }
        }
    }
    own.view_mut((0, 0), of_print.shape()).copy_from(&of_print);
    own.view_mut((2 * n, 2 * n), of_distortion.shape()).copy_from(&of_distortion);
    own.fill_lower_triangle_with_upper_triangle();
    let mut by = by_print.resize_horizontally(2 * (n + f), 0.0);
    by.columns_mut(2 * n, 2 * f).copy_from(&by_distortion);
    Some((by, own))
}

/// Weight matrix of the residual of a corner with its own weight.
fn whitening(seen: &ViewInput<'_>, corner: usize) -> [[f64; 2]; 2] {
    seen.whitener.of(corner).map_or([[1.0, 0.0], [0.0, 1.0]], |w| [[w.m11, w.m12], [w.m21, w.m22]])
}

/// Weighted sums over the views with the corrections of their robot poses eliminated.
struct Sums {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Products of shared unknowns and coefficients.
    cross: DMatrix<f64>,
}

impl Sums {
    /// Adds a view.
    fn add(&mut self, products: &Products, block: &ViewBlock, own: &Own, noise: &Noise) {
        let weights = PixelWeights::new(noise);
        let excess = weights.pose - weights.rest;
        // Like the residuals, the effect of the coefficients is split into what a pose could explain and the rest.
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

#[cfg(test)]
#[path = "effects_tests.rs"]
mod tests;
