//! How much each corner counts.

use nalgebra::{Cholesky, Matrix2};

use handeye_geometry::targets::corner_covariance::COMMON;
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::view_equations::Whitener;

/// Corners weighted by the covariances that their detector states: a residual `r` counts as `W r`, so that all have the
/// same noise level.
///
/// The ratios of the stated covariances are used, their level is not, because a detector does not know what vibration,
/// compression or a dirty board add. `WᵀW` is the inverse covariance times the mean variance per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerWeights {
    mean_px2: f64,
}

impl CornerWeights {
    /// The weights that the covariances of the corners of all views give; `None` unless every corner has one.
    pub fn stated<'a>(corners: impl IntoIterator<Item = &'a Corner>) -> Option<Self> {
        let (mut sum, mut count) = (0.0, 0usize);
        for corner in corners {
            sum += 0.5 * corner.covariance_px2?.trace();
            count += 1;
        }
        let mean_px2 = sum / count.max(1) as f64;
        (mean_px2.is_finite() && mean_px2 > 0.0).then_some(Self { mean_px2 })
    }

    /// The whitener of the corners of an image. A corner without a covariance, or with an invalid one, counts like the
    /// typical corner.
    pub fn whitener(self, corners: &Corners) -> Whitener {
        if let Some(covariance) = corners.covariance() {
            return Whitener::Together { covariance: covariance.clone(), unit_px2: self.mean_px2 };
        }
        let own = |corner: &Corner| self.sqrt_weight(corner).unwrap_or_else(Matrix2::identity);
        Whitener::Each(corners.iter().map(own).collect())
    }

    fn sqrt_weight(self, corner: &Corner) -> Option<Matrix2<f64>> {
        let stated = corner.covariance_px2? / self.mean_px2;
        let covariance = stated * (1.0 - COMMON) + Matrix2::identity() * COMMON;
        Some(Cholesky::new(covariance.try_inverse()?)?.l().transpose())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;

    #[test]
    fn a_corner_of_four_times_the_variance_counts_a_quarter_or_so() {
        let corner = |variance: f64| Corner {
            covariance_px2: Some(Matrix2::identity() * variance),
            ..Corner::new(0, Vector2::zeros())
        };
        let corners = [corner(0.01), corner(0.04)];
        let weights = CornerWeights::stated(&corners).expect("all are stated");
        let Whitener::Each(each) = weights.whitener(&corners.to_vec().into()) else { panic!("they are independent") };
        let ratio = (each[0][(0, 0)] / each[1][(0, 0)]).powi(2);
        // 0.9 of 0.4 and 1.6 times the mean, and 0.1 for both.
        assert!((ratio - (0.9 * 1.6 + 0.1) / (0.9 * 0.4 + 0.1)).abs() < 1e-12, "{ratio}");
        let plain = Corner::new(0, Vector2::zeros());
        assert_eq!(CornerWeights::stated(corners.iter().chain([&plain])), None);
    }
}
