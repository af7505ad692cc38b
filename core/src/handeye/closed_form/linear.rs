//! Least squares and null spaces of tall systems.
//!
//! Rows are folded into a triangle by Householder QR as they come. That needs no memory for the rows, keeps the
//! condition number that `AᵀA` would square, and never runs an SVD on a tall matrix. Least squares then substitute
//! back, which is exact to rounding, where nalgebra's SVD leaves errors of 1e-10.

use std::ops::RangeInclusive;

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, UnitQuaternion};

use crate::se3;

/// Singular values below this part of the largest count as zero: at 1e-10 rounding still leaves six digits.
pub(super) const RANK_TOLERANCE: f64 = 1e-10;

/// Where the translations fix the size of a rotation matrix, sizes outside are refused: the translation that comes with
/// the matrix is wrong by the same factor, and recorded sessions give 0.78 to 1.02.
const USEFUL_SIZES: RangeInclusive<f64> = 0.5..=2.0;

/// Rows gathered between two factorisations: a few hundred make the cost per row small, in a few tens of kilobytes.
const ROWS_PER_FOLD: usize = 256;

/// More sweeps than any SVD of 25 columns takes; the bound only keeps bad numbers from looping for ever.
pub(super) const MAX_SVD_SWEEPS: usize = 10_000;

/// The triangle `R` of a matrix with `N` columns, of which only the rows are known one after another.
pub(super) struct Rows<const N: usize> {
    triangle: DMatrix<f64>,
    pending: Vec<[f64; N]>,
}

impl<const N: usize> Rows<N> {
    pub(super) fn new() -> Self {
        Self { triangle: DMatrix::zeros(0, N), pending: Vec::with_capacity(ROWS_PER_FOLD) }
    }

    /// Appends the rows of a block.
    pub(super) fn push<const R: usize>(&mut self, block: &SMatrix<f64, R, N>) {
        for row in block.row_iter() {
            self.pending.push(std::array::from_fn(|column| row[column]));
        }
        if self.pending.len() >= ROWS_PER_FOLD {
            self.fold();
        }
    }

    fn fold(&mut self) {
        let kept = self.triangle.nrows();
        let stacked = DMatrix::from_fn(kept + self.pending.len(), N, |row, column| {
            if row < kept { self.triangle[(row, column)] } else { self.pending[row - kept][column] }
        });
        self.triangle = stacked.qr().r();
        self.pending.clear();
    }

    fn into_triangle(mut self) -> Option<DMatrix<f64>> {
        self.fold();
        // A zero row changes nothing and makes the triangle square when there were fewer than N rows.
        let triangle = self.triangle.resize_vertically(N, 0.0);
        triangle.iter().all(|v| v.is_finite()).then_some(triangle)
    }

    /// The `x` that minimises `|A x - b|` where the rows are `[A | b]`, so `x` has `N - 1` elements.
    ///
    /// `None` when the columns of `A` are dependent within [`RANK_TOLERANCE`] or the numbers overflow.
    pub(super) fn least_squares(self) -> Option<DVector<f64>> {
        let unknowns = N - 1;
        let triangle = self.into_triangle()?;
        let rhs = triangle.column(unknowns).rows(0, unknowns).into_owned();
        let factor = triangle.view((0, 0), (unknowns, unknowns)).into_owned();
        // The product of the norms is at least the condition number and at most `unknowns` times it.
        let inverse = factor.solve_upper_triangular(&DMatrix::identity(unknowns, unknowns))?;
        let condition = factor.norm() * inverse.norm();
        if condition.is_nan() || condition >= 1.0 / RANK_TOLERANCE {
            return None;
        }
        let x = factor.solve_upper_triangular(&rhs)?;
        x.iter().all(|v| v.is_finite()).then_some(x)
    }

    /// Right singular vectors of the rows with their singular values, largest first; `None` when the numbers overflow.
    pub(super) fn right_singular(self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let svd = self.into_triangle()?.try_svd(false, true, f64::EPSILON, MAX_SVD_SWEEPS)?;
        Some((svd.singular_values, svd.v_t?.transpose()))
    }
}

/// The rotation nearest to a multiple of `m`, which may be negative: linear solutions come without scale or sign.
///
/// `None` when `m` is singular within [`RANK_TOLERANCE`], so that no rotation is meant by it.
pub(super) fn rotation_up_to_scale(m: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let size = m.norm();
    if !size.is_finite() || size < f64::MIN_POSITIVE {
        return None;
    }
    let unit = m / size;
    let determinant = unit.determinant();
    if determinant.abs() < RANK_TOLERANCE {
        return None;
    }
    let rotation = se3::nearest_rotation(&(unit * determinant.signum()));
    Some(UnitQuaternion::from_rotation_matrix(&rotation))
}

/// The rotation nearest to `m`, whose size was solved for and should be 1.
///
/// `None` when it is not in [`USEFUL_SIZES`].
pub(super) fn rotation_of_size_one(m: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let size = m.determinant().cbrt();
    if USEFUL_SIZES.contains(&size) { rotation_up_to_scale(m) } else { None }
}
