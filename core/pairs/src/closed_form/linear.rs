//! Least squares and null spaces of tall systems.
//!
//! Rows are folded into a triangle by Householder QR as they come. That needs no memory for the rows, keeps the
//! condition number that `AᵀA` would square, and never runs an SVD on a tall matrix. Least squares then substitute
//! back, and singular vectors come from Jacobi rotations: both are exact to rounding and always end, where nalgebra's
//! SVD now and then leaves errors of 1e-10 and more, which exact data show.

use std::ops::RangeInclusive;

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, UnitQuaternion};

use handeye_geometry::se3;

/// Singular values below this part of the largest count as zero: at 1e-10 rounding still leaves six digits.
pub(super) const RANK_TOLERANCE: f64 = 1e-10;

/// Where the translations fix the size of a rotation matrix, sizes outside are refused: the translation that comes with
/// the matrix is wrong by the same factor, and recorded sessions give 0.78 to 1.02.
const USEFUL_SIZES: RangeInclusive<f64> = 0.5..=2.0;

/// Rows gathered between two factorisations: a few hundred make the cost per row small, in a few tens of kilobytes.
const ROWS_PER_FOLD: usize = 256;

/// Jacobi rotations converge quadratically, in 6 to 10 sweeps for matrices of this size.
const MAX_SWEEPS: usize = 60;

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

    /// Right singular vectors and singular values of the rows; `None` when the numbers overflow.
    pub(super) fn singular(self) -> Option<Singular> {
        singular(&self.into_triangle()?)
    }
}

/// A singular value decomposition, largest value first.
pub(super) struct Singular {
    pub values: Vec<f64>,
    /// Left vectors times their values.
    pub scaled_left: Vec<DVector<f64>>,
    pub right: Vec<DVector<f64>>,
}

/// Singular value decomposition by one-sided Jacobi rotations; `None` when the numbers overflow.
///
/// Reference: Golub & Van Loan 2013, "Matrix computations", 4th edition, section 8.6.3.
pub(super) fn singular(m: &DMatrix<f64>) -> Option<Singular> {
    let n = m.ncols();
    let mut scaled_left: Vec<DVector<f64>> = m.column_iter().map(nalgebra::Matrix::into_owned).collect();
    let mut right: Vec<DVector<f64>> =
        DMatrix::identity(n, n).column_iter().map(nalgebra::Matrix::into_owned).collect();
    for _ in 0..MAX_SWEEPS {
        let mut orthogonal = true;
        for i in 0..n {
            for j in i + 1..n {
                let (a, b) = (scaled_left[i].norm_squared(), scaled_left[j].norm_squared());
                let dot = scaled_left[i].dot(&scaled_left[j]);
                // Two roots, because the product of the squares can underflow.
                if dot.abs() > f64::EPSILON * a.sqrt() * b.sqrt() {
                    orthogonal = false;
                    let (sin, cos) = (0.5 * (2.0 * dot).atan2(a - b)).sin_cos();
                    rotate(&mut scaled_left, i, j, sin, cos);
                    rotate(&mut right, i, j, sin, cos);
                }
            }
        }
        if orthogonal {
            break;
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| scaled_left[b].norm().total_cmp(&scaled_left[a].norm()));
    let values: Vec<f64> = order.iter().map(|&k| scaled_left[k].norm()).collect();
    values.iter().all(|v| v.is_finite()).then(|| Singular {
        scaled_left: order.iter().map(|&k| scaled_left[k].clone()).collect(),
        right: order.iter().map(|&k| right[k].clone()).collect(),
        values,
    })
}

/// Turns the columns `i` and `j` into each other.
fn rotate(columns: &mut [DVector<f64>], i: usize, j: usize, sin: f64, cos: f64) {
    let turned = &columns[i] * cos + &columns[j] * sin;
    columns[j] = &columns[j] * cos - &columns[i] * sin;
    columns[i] = turned;
}

/// The rotation nearest to a multiple of `m`, which may be negative: linear solutions come without scale or sign.
///
/// `None` when `m` is singular within [`RANK_TOLERANCE`], so that it does not represent a rotation.
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
