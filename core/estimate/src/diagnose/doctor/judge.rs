//! One hypothesis judged: fitted with noise levels of its own, tested, and asked to predict views left out.

use nalgebra::{DVector, Matrix6, Vector2, Vector6};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::effect::Effect;
use super::model::{Fit, Model, State, inverse};
use super::screen::{Candidate, view_score};
use super::weight::{Weight, alternatives, is_significant};
use crate::size::{FALSE_ALARM as ALPHA, LEAST_SCALE};
use crate::uncertainty::quality::BY_CHANCE;
use handeye_geometry::statistics::{better_by_chance, outliers};

/// Parts into which views are split, left out one at a time as for the held-out error of a calibration.
const FOLDS: usize = 5;
/// Two explanations count as equally good when the noise that they leave the robot, position times orientation, differs by
/// less than this factor: it is known to a quarter or so in a session of ten views.
const AS_GOOD: f64 = 1.5;
/// Deflection over the length of the board: a sheet on a flat plate keeps below it.
const LEAST_WARP: f64 = 2e-3;
/// Relative error of a focal length.
const LEAST_FOCAL: f64 = 3e-3;
/// Error of a lens's centre, pixels: a fifth of the commonest mistake, and as much as what corners of a printed board have in
/// common (blur, light from one side) makes of it.
const LEAST_CENTRE_PX: f64 = 0.1;
/// Displacement of the board or the camera, metres at the board: as far as a taped sheet creeps.
const LEAST_MOVED_M: f64 = 2e-4;
/// Zero of a joint, radians: two hundredths of a degree, about what controllers are calibrated to.
const LEAST_JOINT_RAD: f64 = 3.5e-4;

/// A hypothesis and the result of its test.
pub(super) struct Judged {
    pub candidate: Candidate,
    /// Its numbers, and one standard deviation of each; empty for views.
    pub numbers: Vec<f64>,
    pub sigma: Vec<f64>,
    /// Logarithm of how many times better it explains the data.
    pub gain: f64,
    pub score: f64,
    pub significant: bool,
    /// The error of a centre that was given, where it is one that is stated beforehand, pixels.
    pub stated_px: Option<Vector2<f64>>,
    pub matters: bool,
    /// Logarithm of the number of alternatives among which it is the best.
    ln_alternatives: f64,
    /// Whether it is as good as the one that was taken in first: the robot's poses cannot tell the two apart.
    pub as_good: bool,
    /// Prediction of held-out views without and with it.
    pub held_out: Option<(HeldOut, HeldOut)>,
    /// Noise of the robot without and with it.
    pub robot: [(f64, f64); 2],
    pub fit: Fit,
    pub state: State,
}

/// How views left out of a fit are predicted.
pub(super) struct HeldOut {
    /// Displacement of the board, RMS, metres.
    pub rms_m: f64,
    /// For every view the logarithm of its predictive likelihood, up to a constant.
    scores: Vec<f64>,
}

impl HeldOut {
    /// Whether views are predicted better than by another model, by more than chance: a test of the signed ranks of the gains,
    /// with an allowance for the alternatives. It is required in addition to [`ALPHA`], whose distribution of the noise may be
    /// wrong. Without an effect a gain is as likely a loss of that size, whatever the distribution of the noise. With one, a
    /// few views gain most; a test of the mean against their scatter never gets beyond `√views` over the relative scatter,
    /// however large the effect.
    fn is_better_than(&self, other: &Self, ln_alternatives: f64) -> bool {
        let gains: Vec<f64> = self.scores.iter().zip(&other.scores).map(|(with, without)| with - without).collect();
        better_by_chance(&gains) * ln_alternatives.exp() < BY_CHANCE
    }
}

impl Judged {
    /// Whether it is accepted.
    pub fn holds(&self) -> bool {
        let held_out = match (&self.candidate, &self.held_out) {
            // Hundreds of corners show it directly; views are left out, not modelled.
            (Candidate::Effect(Effect::Warp | Effect::Lens | Effect::Centre) | Candidate::Views(_), _) => true,
            // Errors of the arm predict what a size or a zero does as well as these do; which is likelier is another
            // question.
            (Candidate::Effect(Effect::Scale | Effect::Joint(_)), _) if self.fit.has_arm() => true,
            (Candidate::Effect(_), None) => false,
            (Candidate::Effect(_), Some((without, with))) => with.is_better_than(without, self.ln_alternatives),
        };
        // A bend too small to be reported is still there, and what it leaves must not be taken for something else.
        let matters = self.matters || self.candidate == Candidate::Effect(Effect::Warp);
        self.significant && matters && held_out
    }

    /// Whether it leaves the robot about as little noise as another hypothesis of another kind does.
    pub fn explains_as_much_as(&self, other: &Self) -> bool {
        let effects = |j: &Self| matches!(j.candidate, Candidate::Effect(_));
        let left = |j: &Self| j.robot[0].1 * j.robot[1].1;
        // The robot may hide what the corners decide: an explanation that the data contradict is not valid.
        let contradicted = other.gain - self.gain > -ALPHA.ln();
        effects(self)
            && effects(other)
            && self.significant
            && self.matters
            && !contradicted
            && left(self) < AS_GOOD * left(other)
    }
}

/// A hypothesis fitted and tested. The remaining conditions, which take most of the work, are for [`confirm`].
pub(super) fn judge(model: &Model<'_>, state: &State, before: &Fit, candidate: Candidate) -> Option<Judged> {
    let mut next = state.clone();
    let lens = model.sight.lens_count();
    match &candidate {
        Candidate::Effect(effect) => next.effects.push(*effect),
        Candidate::Views(views) => next.rejected.extend(views),
    }
    let fit = model.fit(&next, before.levels)?;
    let (weight, numbers, sigma, ln_alternatives);
    match &candidate {
        Candidate::Effect(effect) => {
            let count = effect.numbers(lens);
            let at = fit.width() - count;
            weight = Weight::of_effect(model, &fit, *effect, at)?;
            numbers = fit.theta.rows(at, count).iter().copied().collect();
            sigma = (at..at + count).map(|i| fit.covariance[(i, i)].max(0.0).sqrt()).collect();
            ln_alternatives = alternatives(model, *effect);
        }
        Candidate::Views(views) => {
            let freedom = least_freedom(&fit, views)?;
            ln_alternatives = ln_choose(model.sight.views.len(), views.len());
            weight = Weight::of_free(fit.wald_of_views(views)?, 6 * views.len(), freedom, ln_alternatives, fit.views);
            (numbers, sigma) = (Vec::new(), Vec::new());
        }
    }
    let level = |k: usize| (before.levels.noise[k].sqrt(), fit.levels.noise[k].sqrt());
    let mut judged = Judged {
        numbers,
        sigma,
        gain: weight.gain,
        score: weight.score,
        significant: weight.significant,
        stated_px: weight.stated_px,
        matters: false,
        ln_alternatives,
        as_good: false,
        held_out: None,
        robot: [level(0), level(1)],
        fit,
        state: next,
        candidate,
    };
    judged.matters = matters(model, &judged);
    if let Candidate::Views(views) = &judged.candidate {
        judged.significant &= stand_apart(&judged, views);
    }
    Some(judged)
}

/// Whether it is more than errors of the arm, and how it predicts views that are left out.
pub(super) fn confirm(model: &Model<'_>, before: &Fit, judged: &mut Judged) {
    if matches!(judged.candidate, Candidate::Effect(_)) {
        let with = &judged.state;
        judged.held_out = predicted(model, with, before).zip(predicted(model, with, &judged.fit));
    }
    let Candidate::Effect(effect) = judged.candidate else { return };
    judged.significant &= match (effect, model.arm()) {
        (Effect::Scale, Some(arm)) => arm.with_another_size,
        (Effect::Scale, None) | (Effect::Joint(_), Some(_)) | (Effect::BoardMoved(_) | Effect::CameraMoved(_), _) => {
            judged.significant && is_more_than_a_field(model, judged, effect)
        }
        _ => true,
    };
}

/// Whether an effect is still significant with errors of the arm in the axes of its base in the model, too.
fn is_more_than_a_field(model: &Model<'_>, judged: &Judged, effect: Effect) -> bool {
    let Some(model) = model.with_field_in_base() else { return true };
    let Some(fit) = model.fit(&judged.state, judged.fit.levels) else { return false };
    let count = effect.numbers(model.sight.lens_count());
    let at = fit.width() - count;
    fit.wald(at, count).is_some_and(|wald| is_significant(wald, count, fit.freedom(at, count), judged.ln_alternatives))
}

/// Degrees of freedom of the view whose expectation rests on the fewest.
fn least_freedom(fit: &Fit, views: &[usize]) -> Option<f64> {
    views.iter().map(|view| fit.freedom_of_view(*view)).try_fold(f64::INFINITY, |least, of| Some(least.min(of?)))
}

/// Whether each of these views is an outlier among all of them, by a fit without them.
fn stand_apart(judged: &Judged, views: &[usize]) -> bool {
    let fit = &judged.fit;
    let squared = |view: usize| {
        let outside = judged.state.rejected.contains(&view);
        if outside { fit.wald_of_views(&[view]) } else { view_score(fit, view) }.unwrap_or(0.0)
    };
    let squared: Vec<f64> = (0..fit.residuals.len()).map(squared).collect();
    let level = 1.0 - ALPHA / squared.len() as f64;
    let Some(freedom) = least_freedom(fit, views) else { return false };
    let limit = FisherSnedecor::new(6.0, freedom).map_or(f64::INFINITY, |f| 6.0 * f.inverse_cdf(level));
    let outliers = outliers(&squared, limit);
    views.iter().all(|view| outliers.contains(view))
}

fn ln_choose(n: usize, k: usize) -> f64 {
    (0..k).map(|i| ((n - i) as f64 / (k - i) as f64).ln()).sum()
}

fn matters(model: &Model<'_>, judged: &Judged) -> bool {
    let Candidate::Effect(effect) = &judged.candidate else { return true };
    let size = judged.numbers.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    match effect {
        Effect::Scale => size >= LEAST_SCALE,
        Effect::Joint(_) => size >= LEAST_JOINT_RAD,
        Effect::Warp => {
            let [a, b, c, _] = model.sight.target.outer;
            size >= LEAST_WARP * (b - a).norm().max((c - a).norm())
        }
        Effect::Lens => model.sight.intrinsics.is_some_and(|camera| {
            let off = |k: usize, f: f64| judged.numbers.get(k).is_some_and(|v| v.abs() >= LEAST_FOCAL * f);
            off(0, camera.fx) || off(1, camera.fy) || off(2, camera.fx) || off(3, camera.fy)
        }),
        Effect::Centre => size >= LEAST_CENTRE_PX,
        Effect::BoardMoved(_) | Effect::CameraMoved(_) => moved_m(model, *effect, &judged.numbers) >= LEAST_MOVED_M,
    }
}

/// How far a move displaces the board in the image, RMS over its points and the views after it, metres.
pub(super) fn moved_m(model: &Model<'_>, effect: Effect, numbers: &[f64]) -> f64 {
    let numbers = DVector::from_column_slice(numbers);
    let count = model.rows.len();
    let from = match effect {
        Effect::BoardMoved(from) | Effect::CameraMoved(from) => from,
        _ => 0,
    };
    let squares: f64 = (from..count)
        .map(|i| {
            let shift = effect.columns(model, i) * &numbers;
            let shift = Vector6::from_iterator(shift.iter().copied());
            model.displacement_m(&shift).powi(2)
        })
        .sum();
    (squares / (count - from).max(1) as f64).sqrt()
}

/// Views left out of the fit, a fifth at a time. The noise levels stay.
fn predicted(model: &Model<'_>, with: &State, fit: &Fit) -> Option<HeldOut> {
    let inside: Vec<usize> = (0..model.rows.len()).filter(|i| !with.rejected.contains(i)).collect();
    let normal = inverse(&fit.covariance)?;
    let right = &normal * &fit.theta;
    let (mut squares, mut scores) = (0.0, Vec::with_capacity(inside.len()));
    for fold in 0..FOLDS.min(inside.len()) {
        model.count_work(fit.width());
        let held: Vec<usize> = inside.iter().copied().skip(fold).step_by(FOLDS).collect();
        let (mut n, mut b) = (normal.clone(), right.clone());
        for &i in &held {
            let weighted = fit.weights[i] * &fit.designs[i];
            n.gemm_tr(-1.0, &fit.designs[i], &weighted, 1.0);
            b.gemv_tr(1.0, &weighted, &model.rows[i].error, 1.0);
        }
        let covariance = inverse(&n)?;
        let theta = &covariance * b;
        for &i in &held {
            let design = &fit.designs[i];
            let by_unknowns = design * &theta;
            let residual = model.rows[i].error + Vector6::from_iterator(by_unknowns.iter().copied());
            squares += model.displacement_m(&residual).powi(2);
            let shared = design * &covariance * design.transpose();
            let own = fit.weights[i].try_inverse()? + Matrix6::from_iterator(shared.iter().copied());
            // Half the logarithm of the determinant is that of the product of the pivots.
            let cholesky = own.cholesky()?;
            let volume = cholesky.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
            scores.push(-volume - 0.5 * residual.dot(&cholesky.solve(&residual)));
        }
    }
    Some(HeldOut { rms_m: (squares / inside.len() as f64).sqrt(), scores })
}
