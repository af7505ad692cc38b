//! How much the data support a hypothesis that is in a fit: with free numbers, and for the centre of a lens with values stated
//! beforehand.
//!
//! Programs that count pixels from the corner of the first one and from its middle differ by half a pixel in both coordinates. That
//! is one definite lens in either direction: the question is how much likelier it is than the given one, which needs less evidence
//! than whether some other centre is better. For an estimate `θ` of `q` numbers with `ν` degrees of freedom and the squared
//! distances `W(h) = (θ − h)ᵀ Cov(θ)⁻¹ (θ − h)`, by the multivariate t distribution, the logarithm of the ratio is
//!
//! `(ν + q) / 2 · [ln(1 + W(0) / ν) − ln(1 + W(h) / ν)]`.
//!
//! A lens that is right is called half a pixel off in at most seven of a thousand sessions, however well it is known (Markov's
//! inequality for a ratio of two fixed laws).

use nalgebra::{DVector, Vector2};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::effect::Effect;
use super::model::{Fit, Model, inverse};
use super::words::CERTAIN;
use crate::size::FALSE_ALARM as ALPHA;

/// By how much cx and cy differ between programs that count pixels from the middle of the first one and from its corner.
const HALF_PX: f64 = 0.5;
/// Part of the centres that are half a pixel off and called another one.
const CALLED_ANOTHER: f64 = 0.01;

/// How much the data support a hypothesis.
pub(super) struct Weight {
    /// Logarithm of how many times better it explains the data.
    pub gain: f64,
    /// The same less a penalty for the choice of its numbers, as in the Bayesian information criterion, and of it among its
    /// kind.
    pub score: f64,
    /// Whether chance is ruled out.
    pub significant: bool,
    /// The centre's error that is stated beforehand and explains the data, pixels.
    pub stated_px: Option<Vector2<f64>>,
}

impl Weight {
    /// Weight of `count` numbers that are free, by `views` views.
    pub fn of_free(wald: f64, count: usize, freedom: f64, ln_alternatives: f64, views: usize) -> Self {
        let gain = 0.5 * freedom * (wald / freedom).ln_1p();
        let score = gain - 0.5 * count as f64 * (6.0 * views as f64).ln() - ln_alternatives;
        Self { gain, score, significant: is_significant(wald, count, freedom, ln_alternatives), stated_px: None }
    }

    /// Weight of an effect in a fit whose numbers begin at the unknown `at`.
    pub fn of_effect(model: &Model<'_>, fit: &Fit, effect: Effect, at: usize) -> Option<Self> {
        let count = effect.numbers(model.sight.lens_count());
        let form = if effect.is_of_lens() { model.sight.form_freedom } else { f64::INFINITY };
        let freedom = fit.freedom(at, count).min(form);
        if effect == Effect::Centre
            && let Some(stated) = Self::of_half_a_pixel(fit, at, freedom)
        {
            return Some(stated);
        }
        Some(Self::of_free(fit.wald(at, count)?, count, freedom, alternatives(model, effect), fit.views))
    }

    /// Weight of a centre that is half a pixel off; `None` where it is not, or where the data do not distinguish it from no error.
    /// Where they separate half a pixel from a whole one poorly, as data do that barely distinguish it from no error, the nearer of
    /// the two counts.
    fn of_half_a_pixel(fit: &Fit, at: usize, freedom: f64) -> Option<Self> {
        let information = inverse(&fit.covariance.view((at, at), (2, 2)).into_owned())?;
        let found = fit.theta.rows(at, 2).into_owned();
        let squared = |from: &DVector<f64>| (&found - from).dot(&(&information * (&found - from)));
        let stated = DVector::from_element(2, HALF_PX.copysign(found.sum()));
        let left = squared(&stated);
        let is_another = FisherSnedecor::new(2.0, freedom).is_ok_and(|law| law.sf(0.5 * left) < CALLED_ANOTHER);
        let is_a_whole_one = squared(&(2.0 * &stated)) < left;
        let gain = 0.5 * (freedom + 2.0) * ((squared(&DVector::zeros(2)) / freedom).ln_1p() - (left / freedom).ln_1p());
        // It may be off in either direction.
        let score = gain - std::f64::consts::LN_2;
        let stated_px = Some(Vector2::new(stated[0], stated[1]));
        (!is_another && !is_a_whole_one && score > CERTAIN).then_some(Self {
            gain,
            score,
            significant: true,
            stated_px,
        })
    }
}

/// Logarithm of the number of alternatives among which the best was picked.
pub(super) fn alternatives(model: &Model<'_>, effect: Effect) -> f64 {
    let views = model.sight.views.len() as f64;
    match effect {
        Effect::BoardMoved(_) | Effect::CameraMoved(_) => views.ln(),
        Effect::Joint(_) => (model.sight.joints().max(1) as f64).ln(),
        _ => 0.0,
    }
}

pub(super) fn is_significant(wald: f64, numbers: usize, freedom: f64, ln_alternatives: f64) -> bool {
    let Ok(distribution) = FisherSnedecor::new(numbers as f64, freedom) else { return false };
    let statistic = wald / numbers as f64;
    statistic.is_finite() && distribution.sf(statistic) * ln_alternatives.exp() < ALPHA
}
