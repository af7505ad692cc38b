//! Hypotheses that explain the images, but far better with a target of another size than was stated.

use super::trial::Judge;
use crate::hypothesis::{Hypothesis, Source};
use handeye_estimate::diagnose::hypotheses::{rules_out, scale};
use handeye_wording::text;

/// No printer has this much error; smaller factors are left to the calibration, which estimates them.
const PRINTED: f64 = 1.1;

/// Says of hypotheses that explain the images that another size of the target explains them far better.
pub(super) fn contradict(judge: &Judge<'_>, hypotheses: &mut [Hypothesis]) {
    for h in hypotheses.iter_mut().filter(|h| h.explains() && matches!(h.source, Source::Stream(_))) {
        let Some(found) = judge.agreeing(h).and_then(|(target, pairs)| scale::best(&target, &pairs)) else { continue };
        if found.factor.ln().abs() > PRINTED.ln() && rules_out(found.misfit_m, found.stated_m) {
            let size = judge.size_of_target(found.factor).map(|size| text!(": {size}", size = size));
            h.contradictions.push(text!(
                "a target {scale} times as large fits the robot's lengths, with {mm} mm in the place of {own_mm} mm{size}",
                scale = format!("{:.3}", found.factor),
                mm = format!("{:.2}", found.misfit_m * 1e3),
                own_mm = format!("{:.2}", found.stated_m * 1e3),
                size = size.unwrap_or_default()
            ));
        }
    }
}
