//! Symmetric positive definite matrices with a band: only neighbours have to do with each other.
//!
//! Reference for the inverse within the band: Erisman & Tinney 1975, "On computing certain elements of the inverse of a sparse
//! matrix" (after Takahashi).

use nalgebra::DMatrix;

/// The lower part of a matrix whose elements further than `width` below the diagonal are zero.
#[derive(Debug, Clone)]
pub(super) struct Banded {
    /// By row: the diagonal, then the entries left of it.
    rows: Vec<f64>,
    width: usize,
}

/// The lower triangular factor `L` of `L Lᵀ`.
#[derive(Debug, Clone)]
pub(super) struct Factor(Banded);

impl Banded {
    pub fn zeros(size: usize, width: usize) -> Self {
        Self { rows: vec![0.0; size * (width + 1)], width }
    }

    fn size(&self) -> usize {
        self.rows.len() / (self.width + 1)
    }

    /// Row `i`, from the diagonal to the left.
    fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * (self.width + 1)..(i + 1) * (self.width + 1)]
    }

    /// First column of row `i`.
    fn first(&self, i: usize) -> usize {
        i.saturating_sub(self.width)
    }

    /// An element of the lower part, within the band.
    fn at(&self, i: usize, j: usize) -> f64 {
        self.row(i)[i - j]
    }

    /// An element of the lower part, within the band.
    pub fn at_mut(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.rows[i * (self.width + 1) + (i - j)]
    }

    /// `None` where it is not positive definite.
    pub fn cholesky(mut self) -> Option<Factor> {
        for i in 0..self.size() {
            let first = self.first(i);
            for j in first..=i {
                let from = first.max(self.first(j));
                let (left, right) = (&self.row(i)[i - j + 1..=i - from], &self.row(j)[1..=j - from]);
                let value = self.at(i, j) - left.iter().zip(right).map(|(a, b)| a * b).sum::<f64>();
                *self.at_mut(i, j) = if i > j {
                    value / self.at(j, j)
                } else if value > 0.0 {
                    value.sqrt()
                } else {
                    return None;
                };
            }
        }
        Some(Factor(self))
    }
}

impl Factor {
    /// `L⁻¹ B`.
    pub fn solve_lower(&self, mut right: DMatrix<f64>) -> DMatrix<f64> {
        let lower = &self.0;
        for mut column in right.column_iter_mut() {
            let x = column.as_mut_slice();
            for i in 0..lower.size() {
                let (row, first) = (lower.row(i), lower.first(i));
                let known: f64 = row[1..=i - first].iter().rev().zip(&x[first..i]).map(|(a, b)| a * b).sum();
                x[i] = (x[i] - known) / row[0];
            }
        }
        right
    }

    /// `(L Lᵀ)⁻¹ B`.
    pub fn solve(&self, right: DMatrix<f64>) -> DMatrix<f64> {
        let lower = &self.0;
        let mut right = self.solve_lower(right);
        for mut column in right.column_iter_mut() {
            let x = column.as_mut_slice();
            for i in (0..lower.size()).rev() {
                let (row, first) = (lower.row(i), lower.first(i));
                x[i] /= row[0];
                let by = x[i];
                for (value, element) in x[first..i].iter_mut().zip(row[1..=i - first].iter().rev()) {
                    *value -= element * by;
                }
            }
        }
        right
    }

    /// `(L Lᵀ)⁻¹` within the band, and zeros beyond it.
    pub fn inverse_in_band(&self) -> DMatrix<f64> {
        let lower = &self.0;
        let size = lower.size();
        let mut inverse = DMatrix::zeros(size, size);
        for j in (0..size).rev() {
            let after = (j + lower.width + 1).min(size);
            let diagonal = lower.at(j, j);
            let below: Vec<f64> = (j + 1..after).map(|k| lower.at(k, j)).collect();
            for i in (j..after).rev() {
                let column = &inverse.as_slice()[i * size..][j + 1..after];
                let known: f64 = below.iter().zip(column).map(|(a, b)| a * b).sum();
                let right = if i == j { 1.0 / diagonal } else { 0.0 };
                let value = (right - known) / diagonal;
                (inverse[(i, j)], inverse[(j, i)]) = (value, value);
            }
        }
        inverse
    }

    /// `(L Lᵀ)⁻¹`.
    pub fn inverse(&self) -> DMatrix<f64> {
        let half = self.solve_lower(DMatrix::identity(self.0.size(), self.0.size()));
        half.transpose() * half
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten numbers, each correlated with the next three.
    fn sample() -> (Banded, DMatrix<f64>) {
        let mut banded = Banded::zeros(10, 3);
        let mut dense = DMatrix::zeros(10, 10);
        for i in 0..10_usize {
            for j in i.saturating_sub(3)..=i {
                let value = if i == j { 3.0 + 0.1 * i as f64 } else { ((3 * i + 7 * j) as f64).sin() };
                *banded.at_mut(i, j) = value;
                (dense[(i, j)], dense[(j, i)]) = (value, value);
            }
        }
        (banded, dense)
    }

    #[test]
    fn solutions_and_inverse_are_those_of_the_whole_matrix() {
        let (banded, dense) = sample();
        let factor = banded.cholesky().expect("positive definite");
        let right = DMatrix::from_fn(10, 2, |i, j| (i as f64 - 3.0 * j as f64).cos());
        assert!((&dense * factor.solve(right.clone()) - &right).amax() < 1e-13);
        let half = dense.clone().cholesky().expect("positive definite").unpack();
        assert!((half * factor.solve_lower(right.clone()) - right).amax() < 1e-13);
        let inverse = dense.try_inverse().expect("regular");
        assert!((factor.inverse() - &inverse).amax() < 1e-13);
        let in_band = factor.inverse_in_band();
        for i in 0..10_usize {
            for j in i.saturating_sub(3)..(i + 4).min(10) {
                assert!((in_band[(i, j)] - inverse[(i, j)]).abs() < 1e-13, "{i} {j}");
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let (mut banded, _) = sample();
        *banded.at_mut(5, 5) = 0.2;
        assert!(banded.cholesky().is_none());
    }
}
