//! The errors of all corners of an image together.

use nalgebra::{Cholesky, DMatrix};

/// The part of the mean variance that every corner has independently, whatever its detector states. A tenth costs one part in a
/// hundred where the statement is true and corners are independent, and keeps a single corner from counting more than ten typical
/// ones.
pub const COMMON: f64 = 0.1;

/// Covariance of all corners of an image, with what they share: where corners are the ends of edges, the errors of
/// neighbours are correlated.
#[derive(Debug, Clone, PartialEq)]
pub struct CornerCovariance {
    /// `W` of the covariance `C` with the mean variance `v` per number, lower triangular: `WᵀW = ((1 − c) C / v + c 1)⁻¹` with
    /// [`COMMON`] for `c`.
    whitener: DMatrix<f64>,
    mean_px2: f64,
}

impl CornerCovariance {
    /// The whitener of a covariance of x and y of each corner in turn, squared pixels; `None` where that is not a valid
    /// covariance.
    pub fn new(px2: &DMatrix<f64>) -> Option<Self> {
        let numbers = px2.nrows();
        let mean_px2 = px2.trace() / numbers.max(1) as f64;
        let is_sound = px2.is_square() && numbers.is_multiple_of(2) && mean_px2.is_finite() && mean_px2 > 0.0;
        if !is_sound {
            return None;
        }
        let mut shared = px2 * ((1.0 - COMMON) / mean_px2);
        for i in 0..numbers {
            shared[(i, i)] += COMMON;
        }
        let whitener = lower_inverse(&Cholesky::new(shared)?.unpack())?;
        whitener.iter().all(|value| value.is_finite()).then_some(Self { whitener, mean_px2 })
    }

    /// Number of corners.
    pub(crate) fn len(&self) -> usize {
        self.whitener.nrows() / 2
    }

    /// Whether it has no corners.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The covariance of x and y of each corner in turn, squared pixels.
    fn px2(&self) -> Option<DMatrix<f64>> {
        let numbers = self.whitener.nrows();
        let factor = lower_inverse(&self.whitener)?;
        let mut px2 = &factor * factor.transpose();
        for i in 0..numbers {
            px2[(i, i)] -= COMMON;
        }
        Some(px2 * (self.mean_px2 / (1.0 - COMMON)))
    }

    /// The covariance of some of the corners, in the order of their numbers here.
    pub(crate) fn of(&self, corners: &[usize]) -> Option<Self> {
        let kept: Vec<usize> = corners.iter().flat_map(|i| [2 * i, 2 * i + 1]).collect();
        let px2 = self.px2()?;
        Self::new(&px2.select_rows(&kept).select_columns(&kept))
    }

    /// The residuals of all corners, x and y of each in turn, one column or more, converted to residuals of independent
    /// corners with the variance `unit_px2`.
    pub(crate) fn whitened(&self, residuals: &DMatrix<f64>, unit_px2: f64) -> DMatrix<f64> {
        &self.whitener * residuals * (unit_px2 / self.mean_px2).sqrt()
    }
}

/// The inverse of a lower triangular matrix; `None` where it has none. Half of the right side, the identity, is zero, which a
/// solution by columns of full length would process all the same.
pub(crate) fn lower_inverse(lower: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let size = lower.nrows();
    let mut inverse = DMatrix::identity(size, size);
    for j in 0..size {
        let left = size - j;
        let solved =
            lower.view((j, j), (left, left)).solve_lower_triangular_mut(&mut inverse.view_mut((j, j), (left, 1)));
        if !solved {
            return None;
        }
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four corners of which neighbours share a half.
    fn neighbours() -> DMatrix<f64> {
        DMatrix::from_fn(8, 8, |i, j| {
            let apart = (i / 2).abs_diff(j / 2);
            if i % 2 == j % 2 { 0.04 * 0.5_f64.powi(apart as i32) } else { 0.0 }
        })
    }

    #[test]
    fn whitened_errors_are_independent_but_for_the_common_part() {
        let px2 = neighbours();
        let all = CornerCovariance::new(&px2).expect("a covariance");
        let identity = DMatrix::identity(8, 8);
        // W C Wᵀ, times a unit of four hundredths, is the identity except for a tenth of it.
        let whitener = all.whitened(&identity, 0.04);
        let common = &px2 * (1.0 - COMMON) + &identity * (0.04 * COMMON);
        let white = &whitener * common * whitener.transpose();
        assert!((white - &identity * 0.04).amax() < 1e-12);
    }

    #[test]
    fn some_of_the_corners_have_the_covariance_that_they_had() {
        let px2 = neighbours();
        let all = CornerCovariance::new(&px2).expect("a covariance");
        let some = all.of(&[3, 1]).expect("a covariance");
        let expected = px2.select_rows(&[6, 7, 2, 3]).select_columns(&[6, 7, 2, 3]);
        assert!((some.px2().expect("regular") - expected).amax() < 1e-12);
    }

    #[test]
    fn a_lower_triangular_matrix_times_its_inverse_is_the_identity_and_one_without_has_none() {
        let lower = Cholesky::new(neighbours() + DMatrix::identity(8, 8)).expect("positive").unpack();
        let inverse = lower_inverse(&lower).expect("regular");
        assert!((&lower * &inverse - DMatrix::identity(8, 8)).amax() < 1e-14);
        assert_eq!(inverse.upper_triangle().iter().filter(|value| **value != 0.0).count(), 8, "but for its diagonal");
        assert_eq!(lower_inverse(&DMatrix::zeros(2, 2)), None);
    }

    #[test]
    fn what_is_no_covariance_is_refused() {
        for bad in [DMatrix::zeros(4, 4), DMatrix::identity(3, 3), DMatrix::from_element(4, 4, f64::NAN)] {
            assert_eq!(CornerCovariance::new(&bad), None, "{bad}");
        }
        let mut indefinite = DMatrix::identity(4, 4);
        indefinite[(0, 1)] = 3.0;
        indefinite[(1, 0)] = 3.0;
        assert_eq!(CornerCovariance::new(&indefinite), None);
    }
}
