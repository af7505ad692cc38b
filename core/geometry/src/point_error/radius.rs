//! The length that 95 % of error vectors stay below.

use nalgebra::{Matrix3, Vector3};
use statrs::function::beta::{beta_reg, ln_beta};

/// Share of the errors that stay below the radius.
const PROBABILITY: f64 = 0.95;
/// Nodes and weights of Gauss–Legendre quadrature on [0, 1] in the cosine to the longest axis. Eight of them with six
/// azimuths keep the probability accurate to 3e-6 for every ratio of axes.
const COSINES: [(f64, f64); 8] = [
    (0.019_855_071_751_231_884, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_64),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];
/// Midpoints of the azimuth in a quarter of a turn; the integrand is periodic, so few are enough.
const AZIMUTHS: usize = 6;
/// Most Newton steps; four are usual, more than ten are needed below two degrees of freedom.
const MAX_STEPS: usize = 100;
/// Relative step that ends them. The next one would be of the order of its square, far below the error of the quadrature.
const TOLERANCE: f64 = 1e-5;

/// The length that a Gaussian error vector of this covariance stays below with a probability of 95 %.
///
/// Zero for a zero matrix; NaN when the covariance is not finite. Exact up to quadrature (relative 1e-5).
pub fn radius_95(covariance: &Matrix3<f64>) -> f64 {
    radius_95_t(covariance, f64::INFINITY)
}

/// The length that an error vector stays below with a probability of 95 % when its covariance was estimated with
/// `degrees` degrees of freedom (multivariate t); infinitely many are a Gaussian with known covariance.
///
/// Along a direction `u` of the unit sphere the squared length is `(uᵀ C u) 3 F(3, degrees)`; the probability is the mean
/// over all directions, found by quadrature in the principal axes and solved for the length by Newton's method. Beyond
/// the first guess, the quantile of the longest axis alone, the probability is concave, so the steps approach the answer
/// and never pass it.
///
/// Zero for a zero matrix; NaN when the covariance is not finite; infinite when there is not a single degree of freedom
/// to determine the size of the error.
pub fn radius_95_t(covariance: &Matrix3<f64>, degrees: f64) -> f64 {
    // The eigenvalues of a matrix with NaN would be taken for zeros.
    if !covariance.iter().all(|c| c.is_finite()) {
        return f64::NAN;
    }
    let variances = sorted(covariance);
    let largest = variances[2];
    if largest == 0.0 {
        return 0.0;
    }
    if degrees.is_nan() || degrees <= 0.0 {
        return f64::INFINITY;
    }
    radius_of(&scales(&(variances / largest)), &Length::new(degrees)) * largest.sqrt()
}

/// The length that an error vector stays below with a probability of 95 % when it is Gaussian with one of several
/// covariances, each with a weight; the weights sum to 1.
///
/// NaN when a covariance is not finite, zero where all are zero.
pub fn radius_95_mixture(covariances: &[(f64, Matrix3<f64>)]) -> f64 {
    if !covariances.iter().all(|(weight, c)| weight.is_finite() && c.iter().all(|c| c.is_finite())) {
        return f64::NAN;
    }
    let variances: Vec<(f64, Vector3<f64>)> = covariances.iter().map(|(weight, c)| (*weight, sorted(c))).collect();
    // The smallest of the longest axes: the first guess must not be beyond the answer.
    let unit = variances.iter().map(|(_, v)| v[2]).filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    if !unit.is_finite() {
        return 0.0;
    }
    let scales: Vec<(f64, f64)> = variances
        .iter()
        .flat_map(|(of_all, v)| scales(&(v / unit)).map(|(scale, weight)| (scale, weight * of_all)))
        .collect();
    radius_of(&scales, &Length::new(f64::INFINITY)) * unit.sqrt()
}

/// Variances along the principal axes, the largest last.
fn sorted(covariance: &Matrix3<f64>) -> Vector3<f64> {
    let mut variances = covariance.symmetric_eigenvalues().map(|v| v.max(0.0));
    let longest = variances.imax();
    variances.swap_rows(longest, 2);
    variances
}

/// The radius for scales and weights on the unit sphere.
fn radius_of(scales: &[(f64, f64)], law: &Length) -> f64 {
    // Square root of the 95 % quantile of chi-square with one degree of freedom.
    let mut radius = 1.959_963;
    for _ in 0..MAX_STEPS {
        let (mut probability, mut density) = (0.0, 0.0);
        for (scale, weight) in scales {
            let squared = radius * radius / scale.max(f64::MIN_POSITIVE);
            let (below, density_there) = law.at(squared);
            probability += weight * below;
            density += weight * density_there * 2.0 * radius / scale.max(f64::MIN_POSITIVE);
        }
        let step = (PROBABILITY - probability) / density;
        if !step.is_finite() {
            break;
        }
        radius += step;
        if step.abs() < TOLERANCE * radius {
            break;
        }
    }
    radius
}

/// `uᵀ C u` at the nodes on the unit sphere, with weights that sum to 1; the last variance is the largest.
fn scales(variances: &Vector3<f64>) -> [(f64, f64); COSINES.len() * AZIMUTHS] {
    let mut out = [(0.0, 0.0); COSINES.len() * AZIMUTHS];
    for (i, (z, weight)) in COSINES.iter().enumerate() {
        for j in 0..AZIMUTHS {
            let azimuth = (j as f64 + 0.5) / AZIMUTHS as f64 * std::f64::consts::FRAC_PI_2;
            let across = variances[0] * azimuth.cos().powi(2) + variances[1] * azimuth.sin().powi(2);
            out[i * AZIMUTHS + j] = (across * (1.0 - z * z) + variances[2] * z * z, weight / AZIMUTHS as f64);
        }
    }
    out
}

/// Distribution of three times an F variable with three and `degrees` degrees of freedom.
struct Length {
    degrees: f64,
    ln_beta: f64,
}

/// Degrees of freedom from which on the normal distribution is closer than the quadrature: its relative error is about
/// one over their number.
const MANY: f64 = 1e6;

impl Length {
    fn new(degrees: f64) -> Self {
        let ln_beta = if degrees < MANY { ln_beta(1.5, 0.5 * degrees) } else { 0.0 };
        Self { degrees, ln_beta }
    }

    /// Probability of a value below `x`, and the density there.
    fn at(&self, x: f64) -> (f64, f64) {
        if self.degrees >= MANY {
            let density = (x / std::f64::consts::TAU).sqrt() * (-0.5 * x).exp();
            return (libm::erf((0.5 * x).sqrt()) - 2.0 * density, density);
        }
        if !x.is_finite() {
            return (1.0, 0.0);
        }
        let (part, rest) = (x / (x + self.degrees), self.degrees / (x + self.degrees));
        let below = beta_reg(1.5, 0.5 * self.degrees, part);
        if rest <= 0.0 || part <= 0.0 {
            return (below, 0.0);
        }
        // dI/dx of the regularised incomplete beta function at x / (x + n), whose own derivative is rest² / n.
        let log = 0.5 * part.ln() + (0.5 * self.degrees + 1.0) * rest.ln() - self.ln_beta;
        (below, log.exp() / self.degrees)
    }
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{ChiSquared, ContinuousCDF as _};

    use super::*;

    #[test]
    fn radius_of_one_two_and_three_equal_axes_is_the_chi_square_quantile() {
        // Square roots of the 95 % quantiles of chi-square with 1, 2 and 3 degrees of freedom.
        for (axes, expected) in [([1.0, 0.0, 0.0], 1.95996), ([1.0, 1.0, 0.0], 2.44775), ([1.0, 1.0, 1.0], 2.79548)] {
            let radius = radius_95(&Matrix3::from_diagonal(&Vector3::from(axes)));
            assert!((radius - expected).abs() < 1e-4, "{axes:?}: {radius}");
        }
    }

    #[test]
    fn few_degrees_of_freedom_give_the_quantiles_of_student_and_fisher() {
        // t(10) at 97.5 %; √(2 F(2, 10)) and √(3 F(3, 10)) at 95 %; √(3 F(3, 2)) at 95 %.
        for (axes, degrees, expected) in [
            ([1.0, 0.0, 0.0], 10.0, 2.22814),
            ([0.0, 1.0, 1.0], 10.0, 2.86453),
            ([1.0, 1.0, 1.0], 10.0, 3.33541),
            ([1.0, 1.0, 1.0], 2.0, 7.58247),
        ] {
            let radius = radius_95_t(&Matrix3::from_diagonal(&Vector3::from(axes)), degrees);
            assert!((radius - expected).abs() < 3e-4 * expected, "{axes:?}, {degrees}: {radius}");
        }
        let c = Matrix3::from_diagonal(&Vector3::new(1.0, 0.2, 0.01));
        assert!((radius_95_t(&c, 9.9e5) / radius_95(&c) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_mixture_of_one_is_a_gaussian_and_one_over_variances_is_a_t() {
        let c = Matrix3::from_diagonal(&Vector3::new(1.0, 0.2, 0.01));
        assert!((radius_95_mixture(&[(0.3, c), (0.7, c)]) / radius_95(&c) - 1.0).abs() < 1e-9);
        // The variance of a t of eight degrees of freedom is eight over a chi-square of eight, taken at 2,000 quantiles.
        let chi = ChiSquared::new(8.0).expect("positive");
        let parts: Vec<(f64, Matrix3<f64>)> =
            (0..2000).map(|k| (1.0 / 2000.0, c * (8.0 / chi.inverse_cdf((f64::from(k) + 0.5) / 2000.0)))).collect();
        let ratio = radius_95_mixture(&parts) / radius_95_t(&c, 8.0);
        assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
    }

    #[test]
    fn radius_scales_with_the_error() {
        let c = Matrix3::new(4.0, 1.0, 0.0, 1.0, 2.0, 0.3, 0.0, 0.3, 1.0);
        assert!((radius_95(&(c * 1e-6)) - radius_95(&c) * 1e-3).abs() < 1e-9);
        assert_eq!(radius_95(&Matrix3::zeros()), 0.0);
        assert_eq!(radius_95_t(&c, 0.0), f64::INFINITY);
        assert!(radius_95(&Matrix3::from_element(f64::NAN)).is_nan());
        assert!(radius_95(&Matrix3::from_element(f64::INFINITY)).is_nan());
    }
}
