//! The least squares fit of a model of grey levels to the pixels of a window.

use nalgebra::{SMatrix, SVector};

/// First damping relative to the diagonal, and what a step that was no good raises it to at least.
const DAMPING: f64 = 1e-3;
/// Past this damping the model does not fit better anywhere near.
const LARGEST_DAMPING: f64 = 1e3;

/// The normal equations of a model with `N` parameters: `Σ r²`, `JᵀJ` and `Jᵀr` in grey levels.
pub(super) struct Sums<const N: usize> {
    pub cost: f64,
    pub normal: SMatrix<f64, N, N>,
    pub gradient: SVector<f64, N>,
}

impl<const N: usize> Sums<N> {
    pub fn zero() -> Self {
        Self { cost: 0.0, normal: SMatrix::zeros(), gradient: SVector::zeros() }
    }

    /// Counts one pixel with the derivatives of its level by the parameters.
    pub fn add(&mut self, by_parameters: &SVector<f64, N>, residual: f64) {
        self.cost += residual * residual;
        self.gradient += by_parameters * residual;
        self.normal.ger(1.0, by_parameters, by_parameters, 1.0);
    }
}

/// Levenberg–Marquardt from `x`, in at most `steps` steps, each limited to what the model allows by `hold`; ends after a
/// step for which `is_small` is true. `None` where the pixels do not determine the parameters.
pub(super) fn fit<const N: usize>(
    mut x: SVector<f64, N>,
    steps: usize,
    sums: impl Fn(&SVector<f64, N>) -> Sums<N>,
    hold: impl Fn(&mut SVector<f64, N>),
    is_small: impl Fn(&SVector<f64, N>) -> bool,
) -> Option<(SVector<f64, N>, Sums<N>)> {
    let mut now = sums(&x);
    let mut damping = DAMPING;
    for _ in 0..steps {
        let mut damped = now.normal;
        for i in 0..N {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&now.gradient);
        let mut candidate = x - step;
        hold(&mut candidate);
        let next = sums(&candidate);
        if next.cost <= now.cost {
            (x, now) = (candidate, next);
            damping *= 0.1;
            if is_small(&step) {
                break;
            }
        } else {
            damping = f64::max(damping * 10.0, DAMPING);
            if damping > LARGEST_DAMPING {
                break;
            }
        }
    }
    Some((x, now))
}
