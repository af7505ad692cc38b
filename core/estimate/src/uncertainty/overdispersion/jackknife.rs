//! The jackknife over single views.
//!
//! Without a view the answer moves by about minus its pull, so the squares of the pulls are variance shown.

use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::linear::LinearView;
use super::{Check, Evidence};

/// Sum of the squared pulls of single views against their expectation by the covariance.
pub fn check(views: &[LinearView]) -> Check {
    let shown: f64 = views.iter().map(|v| v.pull.norm_squared()).sum();
    let promised: f64 = views.iter().map(|v| v.expected.trace()).sum();
    let spread: f64 = views.iter().map(|v| (v.expected * v.expected).trace()).sum();
    let ratio = shown / promised;
    // A sum of squares with that mean and variance has about this many degrees of freedom; the noise levels it is
    // compared with come from six numbers per view less the twelve of the two poses.
    let (freedom, of_noise) = (promised * promised / spread, 6.0 * views.len() as f64 - 12.0);
    let p_value = FisherSnedecor::new(freedom, of_noise).map_or(f64::NAN, |law| law.sf(ratio));
    Check { by: Evidence::Jackknife, ratio, p_value }
}
