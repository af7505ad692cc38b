//! By how much a covariance is widened, and by which evidence.

use std::ops::Range;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use handeye_wording::Text;
use handeye_wording::text;

/// What a ratio was found by; see the table of [this module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Evidence {
    /// Robot corrections of neighbouring poses resemble each other.
    Neighbours,
    /// Leaving out one view at a time.
    Jackknife,
    /// Prediction of views left out.
    CrossValidation,
    /// Pulls of single views on an estimated lens.
    Lens,
}

impl Evidence {
    /// Its name in documents, `snake_case`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Neighbours => "neighbours",
            Self::Jackknife => "jackknife",
            Self::CrossValidation => "cross_validation",
            Self::Lens => "lens",
        }
    }

    /// What was found, to complete "the stated uncertainty is widened because …".
    pub fn reason(self) -> Text {
        match self {
            Self::Neighbours => text!("the robot is off in the same direction in neighbouring poses"),
            Self::Jackknife => text!("the answer moves too far without single views"),
            Self::CrossValidation => text!("views left out are predicted worse than stated"),
            Self::Lens => text!("the views disagree about the lens"),
        }
    }
}

/// One comparison of what the data show with what the covariance predicts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// The evidence that was compared.
    pub by: Evidence,
    /// Variance shown over variance predicted.
    pub ratio: f64,
    /// Probability of a ratio so large if the covariance were true.
    pub p_value: f64,
}

impl Check {
    /// Whether the covariance is refuted rather than chance at work.
    pub fn is_significant(&self) -> bool {
        self.p_value < SIGNIFICANT && self.ratio > 1.0
    }
}

/// By how much a covariance has to be widened, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Overdispersion {
    /// Factor by which the covariance is to be multiplied, 1 or more.
    pub factor: f64,
    /// Which evidence requires it; `None` where none refutes the covariance as it is.
    pub by: Option<Evidence>,
    /// Factor by which the covariance of an estimated lens is to be multiplied, 1 or more; see [`with_less_known`].
    pub lens: f64,
    /// Every check that could be made, none with fewer than [`NEED`](super::NEED) views.
    pub checks: Vec<Check>,
}

impl Overdispersion {
    /// Whether the views disagree about an estimated lens by more than chance.
    pub fn lens_is_refuted(&self) -> bool {
        self.checks.iter().any(|check| check.by == Evidence::Lens && check.is_significant())
    }
}

/// Probability below which the covariance counts as refuted. There are three checks, so at most three healthy sessions in a
/// hundred are widened without need, which costs the others nothing.
const SIGNIFICANT: f64 = 0.01;

/// A covariance with that of some unknowns, such as those of the lens, multiplied by a factor: the part of the others that is due
/// to them grows with it, and the part that would remain with these known does not.
///
/// With `C` the covariance and `K = C_·l C_ll⁻¹` the dependence of all unknowns on those, it is
/// `C + (factor − 1) K C_ll Kᵀ`.
#[must_use]
pub fn with_less_known(covariance: &DMatrix<f64>, these: Range<usize>, factor: f64) -> DMatrix<f64> {
    let of_all = covariance.columns(these.start, these.len()).into_owned();
    let own = covariance.view((these.start, these.start), (these.len(), these.len()));
    // Focal lengths and coefficients differ by many orders.
    let scale: Vec<f64> = own.diagonal().iter().map(|v| v.max(f64::MIN_POSITIVE).sqrt().recip()).collect();
    let scaled = DMatrix::from_fn(these.len(), these.len(), |i, j| own[(i, j)] * scale[i] * scale[j]);
    let Some(root) = scaled.cholesky().map(|factor| factor.l()) else { return covariance * factor };
    let to_these = DMatrix::from_fn(these.len(), of_all.nrows(), |i, j| of_all[(j, i)] * scale[i]);
    let Some(owed) = root.solve_lower_triangular(&to_these) else { return covariance * factor };
    covariance + owed.tr_mul(&owed) * (factor - 1.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;

    #[test]
    fn a_less_known_lens_costs_what_rests_on_it_and_nothing_else() {
        // The first unknown is a quarter of the lens and some noise of its own, the second is independent of it.
        let (own, lens) = (0.3f64, DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 9.0]));
        let to = [0.25, 0.0];
        let with = |times: f64| {
            let lens = &lens * times;
            let mut c = DMatrix::zeros(4, 4);
            c.view_mut((2, 2), (2, 2)).copy_from(&lens);
            let by = DVector::from_column_slice(&to);
            let cross = &lens * &by;
            for k in 0..2 {
                c[(0, 2 + k)] = cross[k];
                c[(2 + k, 0)] = cross[k];
            }
            c[(0, 0)] = by.dot(&cross) + own;
            c[(1, 1)] = 2.0;
            c
        };
        let widened = with_less_known(&with(1.0), 2..4, 5.0);
        assert!((&widened - with(5.0)).amax() < 1e-12, "{widened}");
        assert!((with_less_known(&widened, 2..4, 0.2) - with(1.0)).amax() < 1e-12);
    }
}
