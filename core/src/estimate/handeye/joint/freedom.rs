//! What estimated noise levels do to the covariance: how much larger it is, and on how many degrees of freedom it rests.
//!
//! The covariance `C(θ)` of the shared unknowns at estimated variances `θ` is too small on average, because `C` is concave
//! in them, and its own error gives the answer longer tails than a Gaussian has. With `W` the covariance of the relative
//! errors of the variances (inverse information of the restricted likelihood) and relative derivatives throughout, Kenward
//! and Roger add `−Σ W_kl ∂²C / ∂θ_k ∂θ_l` (exact for variances that enter linearly, as here) and compare
//! `λ eᵀ C⁻¹ e / 6` of the six numbers `e` of the hand-eye with an F distribution of 6 and `m` degrees of freedom.
//!
//! A level that makes the covariance larger by less than a hundredth, such as that of a robot found to be exact, is taken
//! as known: its log is undetermined, and counting it would widen the region for nothing.
//!
//! # Reference
//! Kenward & Roger 1997, "Small sample inference for fixed effects from restricted maximum likelihood", Biometrics 53,
//! 983–997, whose symbols are used below.

use nalgebra::{Cholesky, DMatrix, Matrix6};

use super::Noise;
use super::normal::System;
use super::variance::{self, LEVELS, Levels};
use crate::estimate::handeye::HandEyeError;

/// Relative change of a variance for differences: small against the curvature of `C`, large against rounding.
const STEP: f64 = 0.05;
/// Relative share of the covariance below which a level does not count.
const NO_MATTER: f64 = 0.01;
/// Standard deviation of a log-variance that nothing determines: a level is known to a factor of e² before any data.
const UNKNOWN_LOG: f64 = 2.0;
/// Views above which the covariance is left as it is: the addition falls with the square of their number.
const MANY_VIEWS: usize = 300;
/// Degrees of freedom above which nothing changes.
const MANY: f64 = 1e6;
/// And below which no variance is stated at all.
const FEW: f64 = 4.0;
/// The covariance is at most doubled; an expansion that asks for more does not hold.
const MOST_ADDED: f64 = 1.0;

/// A covariance with what the estimated noise levels do to it.
pub struct Adjusted {
    pub covariance: DMatrix<f64>,
    pub small_sample: SmallSample,
}

/// The distribution of the error of the hand-eye transform in units of its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmallSample {
    /// Degrees of freedom of the noise levels; infinite when they were given.
    pub degrees_of_freedom: f64,
    /// `λ`: the squared distance `eᵀ C⁻¹ e` times this follows `6 F(6, degrees_of_freedom)`.
    pub scale: f64,
    /// Relative standard deviations of the estimated levels of corners, robot position and robot orientation.
    pub level_sigma: [f64; 3],
}

impl SmallSample {
    /// Of a Gaussian: the noise levels are known.
    pub const KNOWN: Self = Self { degrees_of_freedom: f64::INFINITY, scale: 1.0, level_sigma: [0.0; 3] };
}

/// Adjusts the covariance of the shared unknowns at estimated noise levels.
pub fn adjust(
    system: &System,
    noise: &Noise,
    levels: Levels,
    covariance: DMatrix<f64>,
) -> Result<Adjusted, HandEyeError> {
    let at = |shifts: &[(usize, f64)]| -> Result<DMatrix<f64>, HandEyeError> {
        let mut factors = [1.0; LEVELS];
        for (k, sign) in shifts {
            factors[*k] += sign * STEP;
        }
        let changed = Noise {
            corner_px: noise.corner_px * factors[0].sqrt(),
            robot_m: noise.robot_m * factors[1].sqrt(),
            robot_rad: noise.robot_rad * factors[2].sqrt(),
            view_px: noise.view_px * factors[3].sqrt(),
            field_m: noise.field_m * factors[4].sqrt(),
            field_rad: noise.field_rad * factors[5].sqrt(),
        };
        Ok(system.reduce(&changed)?.inverse())
    };
    // A level that is not estimated changes nothing.
    let mut up = vec![covariance.clone(); LEVELS];
    let mut down = up.clone();
    for k in levels.estimated() {
        up[k] = at(&[(k, 1.0)])?;
        down[k] = at(&[(k, -1.0)])?;
    }
    let hand_eye = |m: &DMatrix<f64>| -> Matrix6<f64> { m.fixed_view::<6, 6>(0, 0).into_owned() };
    let Some(factor) = Cholesky::new(hand_eye(&covariance)) else {
        return Ok(Adjusted { covariance, small_sample: SmallSample::KNOWN });
    };
    let first: Vec<Matrix6<f64>> =
        up.iter().zip(&down).map(|(u, d)| factor.solve(&(hand_eye(&(u - d)) / (2.0 * STEP)))).collect();
    let counts: Vec<usize> = levels.estimated().filter(|&k| first[k].trace() / 6.0 > NO_MATTER).collect();
    let of_levels = levels_covariance(system, noise, levels, &counts)?;
    // Half the relative error of a variance is that of its root.
    let all: Vec<usize> = levels.estimated().collect();
    let spread = levels_covariance(system, noise, levels, &all)?;
    let level_sigma = [0, 1, 2].map(|k| 0.5 * spread[(k, k)].max(0.0).sqrt());
    let small_sample = SmallSample { level_sigma, ..region(&first, &of_levels, &counts) };
    if system.blocks.len() > MANY_VIEWS {
        return Ok(Adjusted { covariance, small_sample });
    }
    let mut addition = DMatrix::zeros(covariance.nrows(), covariance.ncols());
    for &k in &counts {
        addition -= (&up[k] + &down[k] - &covariance * 2.0) * (of_levels[(k, k)] / STEP.powi(2));
        for &l in counts.iter().filter(|&&l| l < k) {
            let both = at(&[(k, 1.0), (l, 1.0)])? + at(&[(k, -1.0), (l, -1.0)])?
                - at(&[(k, 1.0), (l, -1.0)])?
                - at(&[(k, -1.0), (l, 1.0)])?;
            addition -= both * (2.0 * of_levels[(k, l)] / (4.0 * STEP.powi(2)));
        }
    }
    Ok(Adjusted { covariance: enlarged(covariance, &addition), small_sample })
}

/// Covariance of the relative errors of the variances that count; zero for the others.
fn levels_covariance(
    system: &System,
    noise: &Noise,
    levels: Levels,
    counts: &[usize],
) -> Result<Matrix6<f64>, HandEyeError> {
    let n = counts.len();
    let mut out = Matrix6::zeros();
    if n == 0 {
        return Ok(out);
    }
    let mut curvature = variance::curvature(system, noise, levels)? * 0.5;
    if levels.view {
        // From the log of corner² + view² to that of view², at the same corner².
        let view = noise.view_px.powi(2);
        let share = view / (view + noise.corner_px.powi(2));
        let mut by_levels = Matrix6::identity();
        by_levels[(3, 3)] = share;
        by_levels[(3, 0)] = 1.0 - share;
        curvature = by_levels.transpose() * curvature * by_levels;
    }
    let information = DMatrix::from_fn(n, n, |i, j| curvature[(counts[i], counts[j])]);
    // Where the likelihood is flat or bends the wrong way a level is undetermined, and counts as known to that factor.
    let eigen = information.symmetric_eigen();
    let known = eigen.eigenvalues.map(|v| (v.max(0.0) + UNKNOWN_LOG.powi(-2)).recip());
    let inverse = &eigen.eigenvectors * DMatrix::from_diagonal(&known) * eigen.eigenvectors.transpose();
    for (i, &k) in counts.iter().enumerate() {
        for (j, &l) in counts.iter().enumerate() {
            out[(k, l)] = inverse[(i, j)];
        }
    }
    Ok(out)
}

/// Degrees of freedom and scale of the region of six numbers; `first` are `C⁻¹ ∂C`.
fn region(first: &[Matrix6<f64>], of_levels: &Matrix6<f64>, counts: &[usize]) -> SmallSample {
    const L: f64 = 6.0;
    let (mut a1, mut a2) = (0.0, 0.0);
    for &k in counts {
        for &l in counts {
            a1 += of_levels[(k, l)] * first[k].trace() * first[l].trace();
            a2 += of_levels[(k, l)] * (first[k] * first[l]).trace();
        }
    }
    if a2 <= L / MANY {
        return SmallSample::KNOWN;
    }
    let b = (a1 + 6.0 * a2) / (2.0 * L);
    let g = ((L + 1.0) * a1 - (L + 4.0) * a2) / ((L + 2.0) * a2);
    let denominator = 3.0 * L + 2.0 * (1.0 - g);
    let (c1, c2, c3) = (g / denominator, (L - g) / denominator, (L + 2.0 - g) / denominator);
    let mean = (1.0 - a2 / L).recip();
    let variance = 2.0 / L * (1.0 + c1 * b) / ((1.0 - c2 * b).powi(2) * (1.0 - c3 * b));
    let rho = variance / (2.0 * mean.powi(2));
    let m = 4.0 + (L + 2.0) / (L * rho - 1.0);
    // Beyond its range the expansion gives nonsense; the tails are then as long as any that is stated here.
    let holds = a2 < L && c2 * b < 1.0 && c3 * b < 1.0 && m.is_finite() && m > FEW;
    let degrees_of_freedom = if holds { m.min(MANY) } else { FEW };
    let scale = if holds { degrees_of_freedom / (mean * (degrees_of_freedom - 2.0)) } else { 1.0 };
    SmallSample { degrees_of_freedom, scale, ..SmallSample::KNOWN }
}

/// The covariance plus the part of an addition that makes it larger.
fn enlarged(covariance: DMatrix<f64>, addition: &DMatrix<f64>) -> DMatrix<f64> {
    let Some(root) = Cholesky::new(covariance.clone()).map(|f| f.l()) else { return covariance };
    // In units of the covariance itself, where eigenvalues can be compared.
    let Some(left) = root.solve_lower_triangular(addition) else { return covariance };
    let Some(relative) = root.solve_lower_triangular(&left.transpose()) else { return covariance };
    let eigen = (0.5 * (&relative + relative.transpose())).symmetric_eigen();
    let added = eigen.eigenvalues.map(|v| v.clamp(0.0, MOST_ADDED));
    let grown = &root * &eigen.eigenvectors;
    &covariance + &grown * DMatrix::from_diagonal(&added) * grown.transpose()
}
