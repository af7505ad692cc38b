//! What the data are expected to say of the noise levels: Fisher's information of the restricted likelihood.
//!
//! With `V = Σ θ_k V_k` the covariance of all residuals, `X` their derivatives by the unknowns that no level belongs to and
//! `P = V⁻¹ − V⁻¹ X (Xᵀ V⁻¹ X)⁻¹ Xᵀ V⁻¹`, it is `½ θ_k θ_l tr(P V_k P V_l)` by the logs of the variances. None of these
//! matrices is formed: for effects with the columns `Z`, the variance `θ` and the posterior covariance `C` it is
//! `Zᵀ P Z = (1 − C / θ) / θ`, and the normal equations give `C` view by view. The corrections of two views have
//! `C_ij = δ_ij O_i⁻¹ + F_i S F_jᵀ`, where `O_i` is the normal matrix of a view's own correction, `F_i` how the correction
//! follows the shared unknowns, and `S` the covariance of these. The poses' part of the corners follows from the other
//! levels, because together they make up `V`: `Σ_l tr(P V_k P θ_l V_l) = tr(P V_k)`.
//!
//! # Reference
//! Searle, Casella & McCulloch 1992, "Variance components", §6.6 and §7.

use nalgebra::{DMatrix, Matrix3, Matrix6};

use super::Noise;
use super::normal::System;
use super::pose_dependent_error::HALF;
use super::variance::{Levels, Likelihood};
use super::view_block::{Layout, PixelWeights, prior_weight};

/// Levels that are told by something else than the poses' part.
const OTHERS: [usize; 5] = [0, 1, 2, 4, 5];

/// Fisher's information of the log-variances at these levels; zero for a level that is not estimated.
pub fn information(system: &System, noise: &Noise, at: &Likelihood, levels: Levels) -> Matrix6<f64> {
    let shared = &at.covariance;
    let mut traces = of_robot(system, noise, at);
    let prior = prior_weight(noise);
    let carried = [0, 1].map(|k| shared * &at.moments[k] * prior[3 * k]);
    for (k, l) in [(0, 0), (0, 1), (1, 1)] {
        traces[(1 + k, 1 + l)] += trace_of_product(&carried[k], &carried[l]);
    }
    // The rests say something of the form alone.
    let by_form = shared.columns(Layout::FORM_AT, system.layout.form);
    let through = by_form * (system.rest_information() / noise.corner_px.powi(2));
    let of_form = through.rows(Layout::FORM_AT, system.layout.form).into_owned();
    let rest_count = (system.residual_count() - 6 * system.blocks.len()) as f64;
    traces[(0, 0)] = rest_count - 2.0 * of_form.trace() + trace_of_product(&of_form, &of_form);
    for k in 0..2 {
        traces[(0, 1 + k)] = by_form.dot(&(&at.moments[k] * &through)) * prior[3 * k];
    }
    if levels.field {
        let half = |k: usize| {
            let first = system.layout.field_at() + k * HALF;
            first..first + HALF
        };
        let sigma = [noise.field_m, noise.field_rad];
        for k in 0..2 {
            let through_half = |left: &DMatrix<f64>, right: &DMatrix<f64>| {
                half(k).map(|i| left.row(i).dot(&right.row(i))).sum::<f64>() / sigma[k].powi(2)
            };
            traces[(0, 4 + k)] = through_half(&through, &by_form.into_owned());
            for of_robot in 0..2 {
                traces[(1 + of_robot, 4 + k)] = through_half(&carried[of_robot], shared);
            }
            for l in k..2 {
                let pairs = half(k).flat_map(|i| half(l).map(move |j| (i, j)));
                let left = pairs.map(|(i, j)| f64::from(i == j) - shared[(i, j)] / (sigma[k] * sigma[l]));
                traces[(4 + k, 4 + l)] = left.map(|entry| entry * entry).sum();
            }
        }
    }
    traces.fill_lower_triangle_with_upper_triangle();
    for k in OTHERS {
        traces[(k, 3)] = at.counts[k] - OTHERS.iter().map(|&l| traces[(k, l)]).sum::<f64>();
        traces[(3, k)] = traces[(k, 3)];
    }
    traces[(3, 3)] = at.counts[3] - OTHERS.iter().map(|&k| traces[(k, 3)]).sum::<f64>();
    levels.folded_matrix(&traces) * 0.5
}

fn trace_of_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    a.component_mul(&b.transpose()).sum()
}

/// Traces of position and orientation of the corrections without what two corrections have in common through the shared
/// unknowns, at the levels' places.
fn of_robot(system: &System, noise: &Noise, at: &Likelihood) -> Matrix6<f64> {
    let sigma = prior_weight(noise).map(|weight| weight.sqrt().recip());
    let (to, from) = (Matrix6::from_diagonal(&sigma.map(f64::recip)), Matrix6::from_diagonal(&sigma));
    let weight = PixelWeights::new(noise).pose;
    let mut out = Matrix6::zeros();
    for (block, own) in system.blocks.iter().zip(&at.reduced.own) {
        // 1 − O⁻¹ in terms of the levels, without the difference of what is nearly equal.
        let seen = to * own.factor.solve(&(block.own * weight)) * from;
        let follows = own.follows();
        let through = to * follows.tr_mul(&(&at.covariance * &follows)) * to;
        for (k, l) in [(0, 0), (0, 1), (1, 1)] {
            let seen: Matrix3<f64> = seen.fixed_view::<3, 3>(3 * k, 3 * l).into_owned();
            let through: Matrix3<f64> = through.fixed_view::<3, 3>(3 * k, 3 * l).into_owned();
            out[(1 + k, 1 + l)] += seen.norm_squared() - 2.0 * seen.dot(&through);
        }
    }
    out
}

#[cfg(test)]
#[path = "information_tests.rs"]
mod tests;
