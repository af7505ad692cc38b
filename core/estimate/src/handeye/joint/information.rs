//! The expected information of the data on the noise levels: Fisher's information of the restricted likelihood.
//!
//! With `V = Σ θ_k V_k` the covariance of all residuals, `X` their derivatives by the unknowns without a level and
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
use super::variance::{EFFECTS_AT, LEVELS, LevelMatrix, Levels, Likelihood, levels_of_effects};
use super::view_block::{Layout, PixelWeights, prior_weight};

/// The level of the poses' part.
const POSES: usize = 3;

/// Levels other than that of the poses' part.
fn others() -> impl Iterator<Item = usize> {
    (0..LEVELS).filter(|k| *k != POSES)
}

/// Fisher's information of the log-variances at these levels; zero for a level that is not estimated.
pub fn information(system: &System, noise: &Noise, at: &Likelihood, levels: Levels) -> LevelMatrix {
    let shared = &at.covariance;
    let mut traces = of_robot(system, noise, at);
    let prior = prior_weight(noise);
    let carried = [0, 1].map(|k| shared * &at.moments[k] * prior[3 * k]);
    for (k, l) in [(0, 0), (0, 1), (1, 1)] {
        traces[(1 + k, 1 + l)] += trace_of_product(&carried[k], &carried[l]);
    }
    // The rests have information on the form alone.
    let by_form = shared.columns(Layout::FORM_AT, system.layout.form);
    let through = by_form * (system.rest_information() / noise.corner_px.powi(2));
    let of_form = through.rows(Layout::FORM_AT, system.layout.form).into_owned();
    let rest_count = (system.residual_count() - 6 * system.blocks.len()) as f64;
    traces[(0, 0)] = rest_count - 2.0 * of_form.trace() + trace_of_product(&of_form, &of_form);
    for k in 0..2 {
        traces[(0, 1 + k)] = by_form.dot(&(&at.moments[k] * &through)) * prior[3 * k];
    }
    let effects = system.layout.effects();
    let sigma = levels_of_effects(noise);
    let by_form = by_form.into_owned();
    for (k, places) in effects.iter().enumerate().filter(|(_, places)| !places.is_empty()) {
        let through_kind = |left: &DMatrix<f64>, right: &DMatrix<f64>| {
            places.clone().map(|i| left.row(i).dot(&right.row(i))).sum::<f64>() / sigma[k].powi(2)
        };
        traces[(0, EFFECTS_AT + k)] = through_kind(&through, &by_form);
        for of_robot in 0..2 {
            traces[(1 + of_robot, EFFECTS_AT + k)] = through_kind(&carried[of_robot], shared);
        }
        for (l, others) in effects.iter().enumerate().skip(k) {
            let pairs = places.clone().flat_map(|i| others.clone().map(move |j| (i, j)));
            let left = pairs.map(|(i, j)| f64::from(i == j) - shared[(i, j)] / (sigma[k] * sigma[l]));
            traces[(EFFECTS_AT + k, EFFECTS_AT + l)] = left.map(|entry| entry * entry).sum();
        }
    }
    traces.fill_lower_triangle_with_upper_triangle();
    for k in others() {
        traces[(k, POSES)] = at.counts[k] - others().map(|l| traces[(k, l)]).sum::<f64>();
        traces[(POSES, k)] = traces[(k, POSES)];
    }
    traces[(POSES, POSES)] = at.counts[POSES] - others().map(|k| traces[(k, POSES)]).sum::<f64>();
    levels.folded_matrix(&traces) * 0.5
}

fn trace_of_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    a.component_mul(&b.transpose()).sum()
}

/// Traces of position and orientation of the corrections without what two corrections have in common through the shared
/// unknowns, at the levels' places.
fn of_robot(system: &System, noise: &Noise, at: &Likelihood) -> LevelMatrix {
    let sigma = prior_weight(noise).map(|weight| weight.sqrt().recip());
    let (to, from) = (Matrix6::from_diagonal(&sigma.map(f64::recip)), Matrix6::from_diagonal(&sigma));
    let weight = PixelWeights::new(noise).pose;
    let mut out = LevelMatrix::zeros();
    for (block, own) in system.blocks.iter().zip(&at.reduced.own) {
        // 1 − O⁻¹ in terms of the levels, without the difference of nearly equal numbers.
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
