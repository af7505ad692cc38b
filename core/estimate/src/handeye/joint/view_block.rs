//! The normal equations of one view in the unknowns that all views share and in its own pose correction.
//!
//! The shared unknowns are `[mount_from_camera (6), anchor_from_target (6), lens and shape of the target, slopes of the robot's
//! field, errors of its arm]`.
//! Blocks are kept without the noise levels, so that these can be varied cheaply.

use std::ops::Range;

use nalgebra::{Cholesky, Const, DMatrix, DVector, Matrix6, Matrix6xX, MatrixXx6, Vector6};

use super::Noise;
use super::arm_errors::KINDS;
use super::chain::Chain;
use super::pose_dependent_error::PoseDependentError;
use super::pose_part::{PosePart, Rest, forward, split};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::view_equations::PoseEquations;

/// Places of the shared unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Number of unknowns of lens and target shape.
    pub form: usize,
    /// Number of slopes of the robot's field.
    pub field: usize,
    /// Numbers of angles, lengths and compliances of the arm.
    pub arm: [usize; KINDS],
}

/// Kinds of random effects, each with a level of its own: slopes of the field's position and orientation, and the kinds of errors
/// of an arm.
pub const EFFECTS: usize = 2 + KINDS;

impl Layout {
    /// First unknown of lens and shape.
    pub const FORM_AT: usize = 12;

    pub fn field_at(self) -> usize {
        Self::FORM_AT + self.form
    }

    pub fn arm_at(self) -> usize {
        self.field_at() + self.field
    }

    /// Puts the columns of an arm where its errors are, at the end of all unknowns.
    pub fn of_arm_in(self, by_shared: &mut Matrix6xX<f64>, by_arm: &Matrix6xX<f64>) {
        let count = by_arm.ncols();
        by_shared.columns_mut(self.count() - count, count).copy_from(by_arm);
    }

    /// Number of shared unknowns.
    pub fn count(self) -> usize {
        self.arm_at() + self.arm.iter().sum::<usize>()
    }

    /// Where the effects of each kind are.
    pub fn effects(self) -> [Range<usize>; EFFECTS] {
        let [angles, lengths, compliances] = self.arm;
        let half = self.field / 2;
        let mut at = self.field_at();
        [half, half, angles, lengths, compliances].map(|count| {
            at += count;
            at - count..at
        })
    }
}

/// Weights of the two parts of a view's residuals: inverse variances, per squared pixel.
#[derive(Debug, Clone, Copy)]
pub struct PixelWeights {
    /// Weight of the six numbers that a pose of the view could explain.
    pub pose: f64,
    /// Weight of all others.
    pub rest: f64,
}

impl PixelWeights {
    pub fn new(noise: &Noise) -> Self {
        Self { pose: (noise.corner_px.powi(2) + noise.view_px.powi(2)).recip(), rest: noise.corner_px.powi(-2) }
    }
}

/// Weight matrix of a pose correction: the inverse of its prior covariance.
pub fn prior_weight(noise: &Noise) -> Vector6<f64> {
    let (t, r) = (noise.robot_m.powi(-2), noise.robot_rad.powi(-2));
    Vector6::new(t, t, t, r, r, r)
}

/// One view, linearised: `r` are its pixel residuals, `s` the shared unknowns, `d` its correction, `p` its own pose.
///
/// The residuals are split into the six numbers that a pose of the view could explain and the rest, because errors that
/// all corners of a view share (lens, shape of the target, blur, light) look like a pose and weigh more than with `n`
/// corners of independent errors. All members but [`Self::rest`] are those of the six, `z = L⁻¹ Jpᵀ r` with
/// `L Lᵀ = Jpᵀ Jp`.
///
/// A fit of ten thousand views has as many of these, so nothing is kept that follows from the rest of it.
#[derive(Debug, Clone)]
pub struct ViewBlock {
    /// `z`, pixels.
    pub residual: Vector6<f64>,
    /// Derivatives of `z` by the shared unknowns, a row for each.
    pub by_shared: MatrixXx6<f64>,
    /// Jacobian of `z` with respect to the correction.
    pub by_correction: Matrix6<f64>,
    /// `Jdᵀ Jd`
    pub own: Matrix6<f64>,
    pub rest: Rest,
    pub corners: usize,
    /// Number of residuals of depths.
    pub depths: usize,
}

impl ViewBlock {
    /// `None` when the corners of the view determine no pose. `field` is that of the robot and the reported pose, if there is one
    /// that is not part of an arm's errors.
    pub fn new(
        chain: &Chain,
        equations: &PoseEquations,
        layout: Layout,
        field: Option<(&PoseDependentError, &Pose<Base, Tip>)>,
    ) -> Option<Self> {
        let (PosePart { root, by_form, residual }, rest) = split(equations)?;
        let by_pose = root.transpose();
        let by_correction = by_pose * chain.by_correction;
        let mut by_shared = Matrix6xX::zeros(layout.count());
        by_shared.fixed_columns_mut::<6>(0).copy_from(&(by_pose * chain.by_hand_eye));
        by_shared.fixed_columns_mut::<6>(6).copy_from(&by_pose);
        by_shared.columns_mut(Layout::FORM_AT, layout.form).copy_from(&by_form);
        layout.of_arm_in(&mut by_shared, &(by_pose * &chain.by_arm));
        if let Some((field, base_from_tip)) = field {
            let columns = field.columns(base_from_tip, &by_correction);
            by_shared.columns_mut(layout.field_at(), layout.field).copy_from(&columns);
        }
        let by_shared = by_shared.transpose();
        let own = by_correction.tr_mul(&by_correction);
        Some(Self {
            residual,
            by_shared,
            by_correction,
            own,
            rest,
            corners: equations.corners,
            depths: equations.depths,
        })
    }

    /// `L`: the pose that the target's place in the anchor turns is the view's own.
    pub fn root(&self) -> Matrix6<f64> {
        self.by_shared.fixed_rows::<6>(6).into_owned()
    }

    /// Weighted squares of all residuals.
    pub fn weighted_squares(&self, weights: PixelWeights) -> f64 {
        self.residual.norm_squared() * weights.pose + self.rest.squared_px * weights.rest
    }

    /// `Jsᵀ r`
    pub fn shared_gradient(&self) -> DVector<f64> {
        let mut gradient = &self.by_shared * self.residual;
        let mut of_form = gradient.rows_mut(Layout::FORM_AT, self.rest.gradient.len());
        of_form += &self.rest.gradient;
        gradient
    }

    /// `tr(Jsᵀ Js C)`: the expected squares of the residuals that shared unknowns of covariance `C` cause.
    pub fn shared_trace(&self, covariance: &DMatrix<f64>) -> f64 {
        let of_form = covariance.view((Layout::FORM_AT, Layout::FORM_AT), self.rest.form.shape());
        (covariance * &self.by_shared).dot(&self.by_shared) + self.rest.form.dot(&of_form)
    }

    /// The squares of the changes of the residuals by a step of the shared unknowns.
    pub fn shared_squares(&self, step: &DVector<f64>) -> f64 {
        let of_form = step.rows(Layout::FORM_AT, self.rest.gradient.len());
        self.by_shared.tr_mul(step).norm_squared() + of_form.dot(&(&self.rest.form * of_form))
    }

    /// The information of the view on the shared unknowns once its correction is eliminated, and the gradient that goes
    /// with it at a correction; `None` when the correction is undetermined.
    pub fn information(&self, noise: &Noise, correction: &Vector6<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let weights = PixelWeights::new(noise);
        let own = Own::new(self, correction, weights.pose, &prior_weight(noise), 0.0)?;
        let n = self.by_shared.nrows();
        let mut matrix = DMatrix::zeros(n, n);
        add_square(&mut matrix, columns(&self.by_shared), weights.pose);
        let mut gradient = &self.by_shared * self.residual * weights.pose;
        add_rest(&self.rest, weights.rest, &mut matrix, &mut gradient);
        own.take_from(&mut matrix, &mut gradient);
        matrix.fill_lower_triangle_with_upper_triangle();
        Some((matrix, gradient))
    }
}

/// Adds the rest of views to the normal matrix and the gradient of the shared unknowns.
pub fn add_rest(rest: &Rest, weight: f64, matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
    let mut of_form = matrix.view_mut((Layout::FORM_AT, Layout::FORM_AT), rest.form.shape());
    of_form += &rest.form * weight;
    let mut of_form = gradient.rows_mut(Layout::FORM_AT, rest.gradient.len());
    of_form += &rest.gradient * weight;
}

/// The six columns of a matrix.
pub fn columns(matrix: &MatrixXx6<f64>) -> [&[f64]; 6] {
    let n = matrix.nrows();
    std::array::from_fn(|k| &matrix.as_slice()[k * n..(k + 1) * n])
}

/// Adds `factor · B Bᵀ` to the upper triangle of a sum, where `B` has these columns.
pub fn add_square<const K: usize>(sum: &mut DMatrix<f64>, columns: [&[f64]; K], factor: f64) {
    let n = sum.nrows();
    for (j, sums) in sum.as_mut_slice().chunks_exact_mut(n).enumerate() {
        let sums = &mut sums[..=j];
        let columns = columns.map(|column| &column[..=j]);
        let at_j = columns.map(|column| factor * column[j]);
        for (i, sum) in sums.iter_mut().enumerate() {
            let mut square = 0.0;
            for k in 0..K {
                square += columns[k][i] * at_j[k];
            }
            *sum += square;
        }
    }
}

/// One view's correction, ready to be eliminated.
pub struct Own {
    pub factor: Cholesky<f64, Const<6>>,
    /// Weighted `Jsᵀ Jd` times the inverse of the upper factor.
    pub whitened: MatrixXx6<f64>,
    /// The weighted gradient times the inverse of the lower factor.
    pub whitened_gradient: Vector6<f64>,
}

impl Own {
    pub fn new(
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
        let factor = Cholesky::new(own)?;
        let mut gradient = block.by_correction.tr_mul(&block.residual) * weight + prior.component_mul(correction);
        forward(factor.l_dirty(), gradient.as_mut_slice());
        let mut by = block.by_correction.transpose() * weight;
        by.as_mut_slice().chunks_exact_mut(6).for_each(|column| forward(factor.l_dirty(), column));
        Some(Self { factor, whitened: times(&block.by_shared, &by.transpose()), whitened_gradient: gradient })
    }

    /// Subtracts from the upper triangle and the gradient of the shared unknowns what the correction absorbs.
    pub fn take_from(&self, matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
        add_square(matrix, columns(&self.whitened), -1.0);
        gradient.gemv(-1.0, &self.whitened, &self.whitened_gradient, 1.0);
    }

    /// The step of the correction that belongs to a shared step.
    pub fn step(&self, shared: &DVector<f64>) -> Vector6<f64> {
        let mut out = -(self.whitened_gradient + self.whitened.tr_mul(shared));
        backward(self.factor.l_dirty(), out.as_mut_slice());
        out
    }

    /// How the correction follows each of the shared unknowns, with the opposite sign; a row for each.
    pub fn follows(&self) -> MatrixXx6<f64> {
        let mut follows = self.whitened.clone();
        let n = follows.nrows();
        for i in (0..6).rev() {
            let (rest, done) = follows.as_mut_slice().split_at_mut((i + 1) * n);
            for j in i + 1..6 {
                take(&mut rest[i * n..], &done[(j - i - 1) * n..], self.factor.l_dirty()[(j, i)]);
            }
            scale(&mut rest[i * n..], self.factor.l_dirty()[(i, i)].recip());
        }
        follows
    }

    /// How much a full step of the correction lowers the quadratic cost.
    pub fn decrease(&self) -> f64 {
        self.whitened_gradient.norm_squared()
    }

    pub fn log_determinant(&self) -> f64 {
        self.factor.l_dirty().diagonal().iter().map(|p| 2.0 * p.ln()).sum()
    }
}

/// The product of a tall matrix and a small one, without the detour of a product of large ones.
fn times(tall: &MatrixXx6<f64>, small: &Matrix6<f64>) -> MatrixXx6<f64> {
    let n = tall.nrows();
    let mut product = MatrixXx6::zeros(n);
    let from = columns(tall);
    for (column, by) in product.as_mut_slice().chunks_exact_mut(n).zip(small.column_iter()) {
        for (i, value) in column.iter_mut().enumerate() {
            *value = (0..6).map(|k| from[k][i] * by[k]).sum();
        }
    }
    product
}

/// Subtracts a multiple of one column from another.
fn take(to: &mut [f64], from: &[f64], factor: f64) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to -= factor * from);
}

fn scale(column: &mut [f64], factor: f64) {
    for value in column {
        *value *= factor;
    }
}

/// Solves `Lᵀ x = v` in place.
fn backward(l: &Matrix6<f64>, v: &mut [f64]) {
    for i in (0..6).rev() {
        let mut sum = v[i];
        for j in i + 1..6 {
            sum -= l[(j, i)] * v[j];
        }
        v[i] = sum / l[(i, i)];
    }
}
