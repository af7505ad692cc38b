//! Whether the robot's lengths fit a target of another size than was said.
//!
//! Images show a target up to its size, and a calibration with a wrong one leaves a misfit that looks like a poor recording: the
//! robot's lengths say which size it is. That is searched along the logarithm of the factor by golden section.

use super::TIMES;
use super::trial::Judge;
use crate::hypothesis::{Hypothesis, Source};
use handeye_wording::text;

/// Factors that are looked at.
const WIDEST: f64 = 5.0;
/// Factors among which the search begins, and steps that follow.
const COARSE: usize = 15;
const STEPS: usize = 18;
/// No printer is off by this much; what is nearer is for the calibration to say, which estimates it.
const PRINTED: f64 = 1.1;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Says of hypotheses that explain the images that another size of the target explains them far better.
pub(super) fn contradict(judge: &Judge<'_>, hypotheses: &mut [Hypothesis]) {
    for h in hypotheses.iter_mut().filter(|h| h.explains() && matches!(h.source, Source::Stream(_))) {
        let Some((scale, misfit_m, own_m)) = found(judge, h) else { continue };
        if scale.ln().abs() > PRINTED.ln() && TIMES * misfit_m < own_m {
            h.contradictions.push(text!(
                "a target {scale} times as large fits the robot's lengths, with {mm} mm in the place of {own_mm} mm{size}",
                scale = format!("{scale:.3}"),
                mm = format!("{:.2}", misfit_m * 1e3),
                own_mm = format!("{:.2}", own_m * 1e3),
                size = judge.size_of_target(scale).map(|size| text!(": {size}", size = size)).unwrap_or_default()
            ));
        }
    }
}

/// The factor with the least misfit, that misfit by the size that was said, and the misfit of that size, metres.
fn found(judge: &Judge<'_>, h: &Hypothesis) -> Option<(f64, f64, f64)> {
    let misfit = |log_scale: f64| judge.misfit_of_scaled(h, log_scale.exp()).unwrap_or(f64::INFINITY);
    let own_m = misfit(0.0);
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
    own_m.is_finite().then(|| (at.exp(), misfit(at), own_m))
}
