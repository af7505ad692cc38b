//! Whether the robot has similar errors in neighbouring poses, and the effect of that on the answer.
//!
//! The errors of two poses are taken to have the correlation `share · exp(−d²/2)`, where `d` is their distance over
//! [`REACH_M`] and [`REACH_RAD`]. The share is the slope of the products of estimated errors against the exponential. With
//! it the displacement of the answer has the covariance `I + share Σ_{i≠j} k_ij F_i F_jᵀ` in units of the stated one, with
//! `F_i` of [`super::linear`].

use nalgebra::{Matrix6, Vector3, Vector6};

use super::linear::LinearView;
use super::permutation;
use super::{Check, Evidence};
use crate::handeye::subset;

/// Distance over which the error of an arm stays similar: errors of joints keep their sign over the better part of a
/// turn, and a joint moves the tip of a medium-sized arm by half a metre per radian.
const REACH_M: f64 = 0.5;
/// The same for its orientation.
const REACH_RAD: f64 = 1.0;
/// Levels of the robot's noise, as standard deviations, below which its errors are those of rounding.
const LEAST_ERROR: f64 = 1e-6;

/// Compares the products of the errors of all pairs of poses with their nearness.
pub fn check(views: &[LinearView]) -> Check {
    let none = Check { by: Evidence::Neighbours, ratio: 1.0, p_value: 1.0 };
    // Pairs grow with the square; a subset of the views determines the correlation well enough.
    let chosen: Vec<&LinearView> =
        subset::spread(views.len(), subset::MOST_VIEWS).into_iter().map(|i| &views[i]).collect();
    let count = chosen.len();
    let Some(errors) = standardised(&chosen) else { return none };
    let near = SymmetricTable::new(count, |i, j| nearness(chosen[i], chosen[j]));
    let alike = SymmetricTable::new(count, |i, j| errors[i].dot(&errors[j]));
    let mean = near.mean();
    let spread: f64 = near.pairs().map(|(_, _, k)| (k - mean).powi(2)).sum();
    if spread < f64::EPSILON * count as f64 {
        return none;
    }
    let statistic =
        |order: &[usize]| near.pairs().map(|(i, j, k)| (k - mean) * alike.get(order[i], order[j])).sum::<f64>();
    let in_order: Vec<usize> = (0..count).collect();
    let observed = statistic(&in_order);
    let share = (observed / spread / SIX).clamp(0.0, 1.0);
    let p_value = permutation::p_value(count, observed, statistic);
    let mut more = Matrix6::zeros();
    for (i, j, k) in near.pairs() {
        let both = chosen[i].by_robot * chosen[j].by_robot.transpose() * k;
        more += both + both.transpose();
    }
    // With more views than were chosen each has that many more neighbours, while the stated variance is as much
    // smaller.
    let widened = Matrix6::identity() + more * (share * views.len() as f64 / count as f64);
    // One factor has to hold in every direction, and so at every point that is measured.
    Check { by: Evidence::Neighbours, ratio: widened.symmetric_eigenvalues().max(), p_value }
}

/// Numbers of a pose.
const SIX: f64 = 6.0;

/// The estimated errors with a mean square of one in translation and in rotation: estimates are smaller than the errors
/// themselves by a factor that depends on how well the images show them. `None` where there are none.
fn standardised(views: &[&LinearView]) -> Option<Vec<Vector6<f64>>> {
    let rms = |at: usize| {
        let squared: f64 = views.iter().map(|v| v.robot.fixed_rows::<3>(at).norm_squared()).sum();
        (squared / (3.0 * views.len() as f64)).sqrt()
    };
    let (t, r) = (rms(0), rms(3));
    if !(t.is_finite() && r.is_finite()) || t.max(r) < LEAST_ERROR {
        return None;
    }
    let part = |level: f64| if level < LEAST_ERROR { 0.0 } else { level.recip() };
    let scale = Matrix6::from_diagonal(&Vector6::new(part(t), part(t), part(t), part(r), part(r), part(r)));
    Some(views.iter().map(|v| scale * v.robot).collect())
}

fn nearness(a: &LinearView, b: &LinearView) -> f64 {
    let apart: Vector3<f64> = a.base_from_tip.translation() - b.base_from_tip.translation();
    let turned = a.base_from_tip.rotation().angle_to(&b.base_from_tip.rotation());
    (-0.5 * ((apart.norm() / REACH_M).powi(2) + (turned / REACH_RAD).powi(2))).exp()
}

/// A number per pair of views.
struct SymmetricTable {
    count: usize,
    values: Vec<f64>,
}

impl SymmetricTable {
    fn new(count: usize, value: impl Fn(usize, usize) -> f64) -> Self {
        let mut values = vec![0.0; count * count];
        for i in 0..count {
            for j in 0..i {
                let v = value(i, j);
                values[i * count + j] = v;
                values[j * count + i] = v;
            }
        }
        Self { count, values }
    }

    fn get(&self, i: usize, j: usize) -> f64 {
        self.values[i * self.count + j]
    }

    /// Every pair once.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        (0..self.count).flat_map(move |i| (0..i).map(move |j| (i, j, self.get(i, j))))
    }

    fn mean(&self) -> f64 {
        self.pairs().map(|(_, _, v)| v).sum::<f64>() / (self.count * (self.count - 1) / 2).max(1) as f64
    }
}
