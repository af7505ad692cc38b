//! Whether the corners show that the target is bent: one rule, for the joint estimate and for the camera alone.

use nalgebra::{Matrix2, Vector2};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use handeye_pairs::pose_graph::PLACE_M;

/// Significance from which a bent target is taken into the model: by chance one flat target in a thousand.
const LEVEL: f64 = 1e-3;
/// Part of the smallest limit that the ratio has to reach before the degrees of freedom are known: a step from a flat fit and
/// the fit of a bend differ only in second order. Four flat targets in a thousand have as much by chance.
const NEARLY: f64 = 0.8;
/// The deflection also has to matter: at least a tenth of the corner noise at the target, so that a fit of thousands of
/// corners does not chase a micrometre.
const MATTERS: f64 = 0.1;
/// Degrees of freedom that count as infinite.
const MANY: f64 = 1e6;

/// Estimated deflections, and how well they are known.
pub(super) struct Deflection {
    /// Along x and y, metres.
    pub warp_m: Vector2<f64>,
    /// Their covariance, m².
    pub covariance: Matrix2<f64>,
    /// Degrees of freedom of the noise in it.
    pub degrees_of_freedom: f64,
    /// Noise of a corner at the target, metres.
    pub noise_m: f64,
}

/// Whether a bend may be shown by a ratio like that of [`Deflection::is_shown`], on however many degrees of freedom: the limit
/// is least on infinitely many, where half of chi-square with two is exponential.
pub(super) fn may_be_shown(ratio: f64) -> bool {
    ratio > NEARLY * -LEVEL.ln()
}

impl Deflection {
    /// Whether a flat target is ruled out: `wᵀ C⁻¹ w / 2` against `F(2, degrees of freedom)`. False where the covariance
    /// is not valid, as for a target that is seen square on.
    pub fn is_shown(&self) -> bool {
        let Some(inverse) = self.covariance.try_inverse() else { return false };
        let ratio = self.warp_m.dot(&(inverse * self.warp_m)) / 2.0;
        let freedom = self.degrees_of_freedom.min(MANY);
        let limit = FisherSnedecor::new(2.0, freedom).map_or(f64::INFINITY, |f| f.inverse_cdf(1.0 - LEVEL));
        ratio > limit && self.warp_m.norm() > (MATTERS * self.noise_m).max(PLACE_M)
    }
}
