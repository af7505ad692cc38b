//! Which hypotheses the data support: each is fitted with noise levels of its own, the best is taken in, and the rest are
//! judged again with it in the model.

use super::effect::Effect;
use super::judge::{Judged, confirm, judge};
use super::model::{Fit, KnownArm, Levels, Model, State};
use super::screen::{Candidate, screened};
use super::views::SessionViews;
use super::weight::Weight;
use crate::TargetSize;
use crate::arm_fit::ArmFit;
use crate::diagnose::hypotheses::agreement::Agreement;
use crate::handeye::joint::pose_dependent_error::Places;
use crate::size::LEAST_SCALE;
use handeye_geometry::progress::Work;

/// Least views: twelve unknowns, six of a hypothesis, and noise levels to judge them by.
pub(super) const NEED: usize = 5;
/// Largest part of the views that may be outliers: beyond it the others are not a reliable majority.
const MOST_ASIDE: f64 = 0.34;
/// A view whose misfit is this many times the median belongs to the set of views that may be left out as an outlier together.
/// It proposes them; whether they are outliers is a matter of the test of all hypotheses.
const FAR: f64 = 5.0;
/// Rounds of moving the solution to where the majority puts it; the second already changes it only by rounding.
const ROUNDS: usize = 3;
/// Most hypotheses taken in, which bounds the work: one for every single outlier view, and some more.
const MOST_TAKEN: usize = 12;
/// Work, as counted by [`Model::work`], after which no more is taken in; one round of hypotheses may go a little beyond it,
/// and it is reported that more is wrong. One step of a fit of a hundred views with sixty unknowns is a 280th of it.
const MOST_WORK: u64 = 100_000_000;
/// The same of a model that has the errors of an arm: of a hundred views with much wrong it takes 2.4 times the work.
const MOST_WORK_WITH_ARM: u64 = 3 * MOST_WORK;
/// Most views that are tested together.
const MOST_TOGETHER: usize = 40;

/// Everything judged.
pub(super) struct Selection<'a> {
    /// What was taken in, in that order.
    pub taken: Vec<Judged>,
    /// The best of every other kind, the best first.
    pub others: Vec<Judged>,
    pub model: Model<'a>,
    /// The last fit.
    pub fit: Fit,
    /// Whether the work was ended although more would have been taken in.
    pub is_ended: bool,
}

/// Judges all hypotheses. `None` when the views leave something open, or when it was cancelled.
///
/// `arm` are the errors of the arm by the joint estimate, where its joints are known: they are in every fit, and nothing that they
/// explain is taken for anything else.
pub(super) fn select<'a>(
    sight: &'a SessionViews,
    start: &Agreement,
    arm: Option<&ArmFit>,
    work: &Work<'_>,
) -> Option<Selection<'a>> {
    // The errors of an arm that is known leave nothing to a field, except where the joint estimate has one in addition.
    let is_shown_by_arm = arm.is_some_and(|arm| arm.errors.field().is_none());
    let poses = sight.views.iter().map(|view| &view.base_from_tip);
    let places = if is_shown_by_arm { None } else { Places::for_field(poses) };
    let most_work = if arm.is_some() { MOST_WORK_WITH_ARM } else { MOST_WORK };
    let mut model = Model::new(sight, start.solution, places, arm.map(KnownArm::from));
    let far: Vec<usize> = (0..sight.views.len()).filter(|i| start.misfit_m[*i] > FAR * start.median_m).collect();
    let most_outliers = (MOST_ASIDE * sight.views.len() as f64) as usize;
    let noise_m = start.median_m / 3.0;
    let mut levels = Levels::even([noise_m, noise_m / sight.target.distance_m.max(0.01)].map(|sigma| sigma.powi(2)));
    // The majority determines where the equations are made linear; with many far views there is none, and all are
    // taken.
    let majority =
        State { effects: Vec::new(), rejected: if far.len() <= most_outliers { far.clone() } else { Vec::new() } };
    for _ in 0..ROUNDS {
        let fit = model.fit(&majority, levels)?;
        levels = fit.levels;
        model = model.moved(&fit);
        if !model.has_field(&fit) {
            model.field = None;
        }
    }
    let mut state = State::default();
    let mut fit = model.fit(&state, levels)?;
    let (mut taken, mut others): (Vec<Judged>, Vec<Judged>) = (Vec::new(), Vec::new());
    let mut is_ended;
    loop {
        if work.is_cancelled() {
            return None;
        }
        let room = most_outliers.saturating_sub(state.rejected.len());
        let together: Vec<usize> = far.iter().copied().filter(|i| !state.rejected.contains(i)).collect();
        let mut candidates = screened(&model, &state, &fit, room);
        if (2..=room.min(MOST_TOGETHER)).contains(&together.len()) {
            candidates.push(Candidate::Views(together));
        }
        let mut judged: Vec<Judged> = candidates.into_iter().filter_map(|c| judge(&model, &state, &fit, c)).collect();
        judged.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut best = None;
        for (i, judged) in judged.iter_mut().enumerate() {
            // In the first round all are confirmed, to be listed; later only the best is needed.
            if taken.is_empty() || best.is_none() {
                confirm(&model, &fit, judged);
                best = best.or_else(|| judged.holds().then_some(i));
            }
        }
        let best = best.filter(|_| taken.len() < MOST_TAKEN);
        is_ended = best.is_some() && !taken.is_empty() && model.work() > most_work;
        let mut taken_now = None;
        for (i, j) in judged.into_iter().enumerate() {
            if Some(i) == best && !is_ended {
                taken_now = Some(j);
            } else if taken.is_empty() {
                others.push(j);
            }
        }
        let Some(next) = taken_now else { break };
        state = next.state.clone();
        fit = model.fit(&state, next.fit.levels)?;
        taken.push(next);
    }
    drop_overtaken(&model, &mut state, &mut fit, &mut taken)?;
    others.retain(|o| !taken.iter().any(|t| same_kind(&t.candidate, &o.candidate)));
    if let Some(first) = taken.first().filter(|first| first.matters) {
        for other in &mut others {
            other.as_good = other.explains_as_much_as(first);
        }
    }
    Some(Selection { taken, others, model, fit, is_ended })
}

impl Selection<'_> {
    /// Takes the size of the target from the estimate that includes the errors of the arm.
    pub fn with_size_beside_arm(mut self, arm: &ArmFit) -> Self {
        let Some((scale, sigma)) = arm.shape().and_then(|shape| Some((shape.shape.scale, shape.scale_sigma?))) else {
            return self;
        };
        let is_scale = |j: &&mut Judged| j.candidate == Candidate::Effect(Effect::Scale);
        for judged in self.taken.iter_mut().chain(&mut self.others).filter(is_scale) {
            (judged.numbers, judged.sigma) = (vec![scale - 1.0], vec![sigma]);
        }
        self
    }

    /// Takes the size of the target from the joint estimate, which also has bend, field and lens and uses every corner: poses
    /// measured by a flat board, and a size that is linear in them, are wrong about it where the board is bent. What that does
    /// not show stays in the model and is not reported.
    pub fn with_size(mut self, size: &TargetSize) -> Self {
        let is_scale = |j: &&mut Judged| j.candidate == Candidate::Effect(Effect::Scale);
        for judged in self.taken.iter_mut().chain(&mut self.others).filter(is_scale) {
            (judged.numbers, judged.sigma) = (vec![size.scale - 1.0], vec![size.sigma]);
            judged.significant &= size.is_another();
            judged.matters = judged.significant && (size.scale - 1.0).abs() >= LEAST_SCALE;
            judged.as_good &= judged.matters;
        }
        self
    }
}

fn same_kind(a: &Candidate, b: &Candidate) -> bool {
    match (a, b) {
        (Candidate::Effect(a), Candidate::Effect(b)) if a.is_of_lens() => b.is_of_lens(),
        (Candidate::Effect(a), Candidate::Effect(b)) => std::mem::discriminant(a) == std::mem::discriminant(b),
        (Candidate::Views(_), Candidate::Views(_)) => true,
        _ => false,
    }
}

/// An effect that was taken in first may be explained by those that came later.
fn drop_overtaken(model: &Model<'_>, state: &mut State, fit: &mut Fit, taken: &mut Vec<Judged>) -> Option<()> {
    loop {
        let lens = model.sight.lens_count();
        let mut at = model.effects_at();
        let mut weak = None;
        for effect in &state.effects {
            if !Weight::of_effect(model, fit, *effect, at)?.significant {
                weak = Some(*effect);
            }
            at += effect.numbers(lens);
        }
        let Some(weak) = weak else { return Some(()) };
        state.effects.retain(|e| *e != weak);
        taken.retain(|j| j.candidate != Candidate::Effect(weak));
        *fit = model.fit(state, fit.levels)?;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use crate::diagnose::doctor::{diagnose, gross};
    use crate::diagnose::findings::FindingOptions;
    use crate::handeye::Mode;
    use handeye_geometry::progress::CancelToken;
    use handeye_simulate::session::{Setup, observed};

    /// A real session in which every fourth view is wrong, each in its own way, none of them grossly.
    #[test]
    fn a_session_with_much_wrong_is_examined_within_bounds_and_the_end_is_said() {
        for (views, joints) in [(40, false), (100, false), (100, true)] {
            let mut observations = observed(&Setup { joints, ..Setup::new(Mode::EyeInHand, views, 5) });
            for (i, view) in observations.views.iter_mut().enumerate().filter(|(i, _)| i % 4 == 1) {
                let off =
                    Vector6::from_fn(|k, _| (((i * 7 + k * 5) % 11) as f64 - 5.0) * if k < 3 { 1.5e-3 } else { 3e-3 });
                view.base_from_tip = view.base_from_tip.map(|pose| pose.perturbed(&off));
            }
            let cancel = CancelToken::default();
            let sight = SessionViews::new(&observations, None).expect("views");
            let start = gross::gross(&sight, &(&cancel).into()).expect("not cancelled").as_given.expect("a solution");
            let selection = select(&sight, &start, None, &(&cancel).into()).expect("selected");
            assert!(selection.model.work() < 2 * MOST_WORK, "{views}: {}", selection.model.work());
            if joints {
                let fit = crate::fit(&observations, crate::Method::Joint, &cancel).expect("solves");
                let arm = fit.joint.as_ref().and_then(|joint| joint.arm.as_ref()).expect("the joints are known");
                let with_arm = select(&sight, &start, Some(arm), &(&cancel).into()).expect("selected");
                let work = with_arm.model.work();
                println!("{views} views: {} without the arm, {work} with it", selection.model.work());
                assert!(work < 2 * MOST_WORK_WITH_ARM, "{views}: {work}");
            }
            let diagnosis = diagnose(&observations, &FindingOptions::default(), &cancel);
            assert!(!diagnosis.is_healthy());
            assert_eq!(selection.is_ended, diagnosis.untested.is_some_and(|why| why.contains("was ended after")));
        }
    }
}
