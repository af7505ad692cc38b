//! Whether the robot's lengths fit a target of another size than was stated.
//!
//! Images show a target up to its size, and a calibration with a wrong one leaves a misfit that looks like a poor recording: the
//! robot's lengths determine the size. That is searched along the logarithm of the factor by golden section.

use super::SeenTarget;
use super::agreement::agreement;
use crate::handeye::PosePair;
use crate::handeye::numbering::alike;
use crate::handeye::subset;
use handeye_geometry::frames::Pose;

/// Largest factor that is tried.
const WIDEST: f64 = 5.0;
/// Number of factors with which the search begins, and steps that follow.
const COARSE: usize = 15;
const STEPS: usize = 18;
/// Most views that are used.
const MOST_VIEWS: usize = 30;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Another size of the target.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// How many times the stated one.
    pub factor: f64,
    /// Median misfit that it leaves, in terms of the stated size, metres.
    pub misfit_m: f64,
    /// Median misfit that the stated size leaves, metres.
    pub stated_m: f64,
}

/// The size of the target with the least misfit; `None` where the stated size has no solution.
pub fn best(target: &SeenTarget, pairs: &[PosePair]) -> Option<Scale> {
    let chosen: Vec<PosePair> = subset::spread(pairs.len(), MOST_VIEWS).into_iter().map(|i| pairs[i]).collect();
    let chosen = alike(&chosen, &target.turns);
    let misfit = |log_factor: f64| {
        let factor = log_factor.exp();
        let scaled = |pair: &PosePair| {
            let mut seen = *pair.camera_from_target.isometry();
            seen.translation.vector *= factor;
            PosePair { camera_from_target: Pose::from_isometry(seen), ..*pair }
        };
        let pairs: Vec<PosePair> = chosen.iter().map(scaled).collect();
        let found = agreement(&target.outer.map(|point| point * factor), &pairs, false);
        found.map_or(f64::INFINITY, |found| found.median_m / factor)
    };
    let stated_m = misfit(0.0);
    let step = 2.0 * WIDEST.ln() / (COARSE - 1) as f64;
    let coarse = (0..COARSE).map(|i| -WIDEST.ln() + step * i as f64);
    let best = coarse.map(|at| (at, misfit(at))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (mut low, mut high) = (best.0 - step, best.0 + step);
    for _ in 0..STEPS {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if misfit(a) < misfit(b) {
            high = b;
        } else {
            low = a;
        }
    }
    let at = f64::midpoint(low, high);
    stated_m.is_finite().then(|| Scale { factor: at.exp(), misfit_m: misfit(at), stated_m })
}
