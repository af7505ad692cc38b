//! The effect of the accepted hypotheses on the answer.

use nalgebra::{Matrix6, Vector6};

use super::Hypothesis;
use super::effect::Effect;
use super::judge::Judged;
use super::model::{Fit, State};
use super::screen::Candidate;
use super::select::Selection;
use crate::diagnose::findings::FindingCode;
use crate::handeye::HandEye;
use crate::stated_uncertainty::{Alternative, StatedUncertainty};
use crate::{self as estimate, JointFit, ViewStatus};
use handeye_geometry::frames::{Camera, Mount, Pose};
use handeye_geometry::se3;

/// What may be stated for a calibration given what was judged.
///
/// The linear model is fitted with what the calibration already accounts for (a bent board, a size, outlier views) and also with
/// the accepted hypotheses; from the answer to that fit the hand-eye transform moves by what the calibration misses. A fit of the
/// linear model without the hypotheses is not the answer: where the model is wrong, pose by pose and all corners together are wrong
/// in different ways. Explanations that are as good as the first are alternatives of their own.
pub(super) fn stated_uncertainty(selection: &Selection<'_>, calibration: &estimate::Fit) -> StatedUncertainty {
    let model = &selection.model;
    let counted = |effect: Effect| counts_on(calibration, effect);
    let out: Vec<usize> =
        (0..model.sight.views.len()).filter(|i| is_out(calibration, &model.sight.views[*i].name)).collect();
    let mut with = State { effects: Vec::new(), rejected: out };
    let (mut missed, mut missed_more_than_size) = (false, false);
    for judged in &selection.taken {
        match &judged.candidate {
            Candidate::Effect(effect) => {
                with.effects.push(*effect);
                // An effect too small to be reported changes no claim: nobody could correct it.
                let is_missed = !counted(*effect) && judged.matters;
                missed |= is_missed;
                missed_more_than_size |= is_missed && *effect != Effect::Scale;
            }
            Candidate::Views(views) => {
                let more: Vec<usize> = views.iter().copied().filter(|i| !with.rejected.contains(i)).collect();
                missed |= !more.is_empty();
                missed_more_than_size |= !more.is_empty();
                with.rejected.extend(more);
            }
        }
    }
    let as_good = || selection.others.iter().filter(|judged| judged.as_good);
    let others: Vec<&Judged> =
        as_good().filter(|j| !matches!(j.candidate, Candidate::Effect(e) if counted(e))).collect();
    if !missed && others.is_empty() {
        return StatedUncertainty::AsModelled;
    }
    // The linear model has the errors of an arm that is known: it moves the answer that belongs to them.
    let answer = calibration.arm().map(|arm| arm.hand_eye).or(calibration.hand_eye);
    let Some(answer) = answer else { return StatedUncertainty::Nothing };
    let to = |fit: &Fit| alternative(&answer.mount_from_camera(), &model.solution.mount_from_camera, fit);
    let mut alternatives = Vec::new();
    let size = calibration.joint.as_ref().and_then(|joint| joint.size.as_ref());
    if let Some(size) = size.filter(|_| missed && !missed_more_than_size) {
        alternatives.push(size.with.clone());
    } else if missed {
        // With so much left out nothing determines the answer.
        let Some(fit) = model.fit(&with, selection.fit.levels) else { return StatedUncertainty::Nothing };
        alternatives.push(to(&fit));
    }
    alternatives.extend(others.into_iter().map(|judged| to(&judged.fit)));
    StatedUncertainty::Moved(alternatives)
}

/// What may be stated where sessions share a lens but differ in it: the answer may be off by as much as its own lens
/// would move it.
pub(super) fn with_own_lens(stated: StatedUncertainty, calibration: &estimate::Fit) -> StatedUncertainty {
    let shared = calibration.shared_lens.as_ref().filter(|shared| shared.has_others());
    match shared {
        // It is relative to the answer by reported poses.
        Some(shared) => match calibration.arm().zip(calibration.hand_eye.as_ref()) {
            Some((arm, answer)) => {
                let [own, other] = [answer, &arm.hand_eye].map(HandEye::mount_from_camera);
                also(stated, shared.with_own_lens.of_another(&own, &other))
            }
            None => also(stated, shared.with_own_lens.clone()),
        },
        None => stated,
    }
}

/// What may be stated where the robot's field leaves the size of the target open: a size that is off as prints and rulers are would
/// go unnoticed, so the answer may be off by as much as the most likely size, drawn to the stated one, would move it. Where the
/// errors of the arm are known they separate a size from an arm, except for one that is off by less than prints are.
pub(super) fn with_open_size(stated: StatedUncertainty, calibration: &estimate::Fit) -> StatedUncertainty {
    let size = calibration.joint.as_ref().filter(|_| calibration.arm().is_none()).and_then(JointFit::open_size);
    match size {
        Some(size) => also(stated, size.with.clone()),
        None => stated,
    }
}

fn also(stated: StatedUncertainty, alternative: Alternative) -> StatedUncertainty {
    match stated {
        StatedUncertainty::Nothing => StatedUncertainty::Nothing,
        StatedUncertainty::AsModelled => StatedUncertainty::Moved(vec![alternative]),
        StatedUncertainty::Moved(alternatives) => {
            StatedUncertainty::Moved(alternatives.into_iter().chain([alternative]).collect())
        }
    }
}

/// Whether the answer is estimated with an effect.
fn counts_on(calibration: &estimate::Fit, effect: Effect) -> bool {
    let Some(joint) = &calibration.joint else {
        return effect == Effect::Scale && calibration.pose_fit.is_some_and(|fit| fit.shape.is_some());
    };
    match effect {
        Effect::Warp => joint.free.warp,
        Effect::Scale => joint.free.scale || calibration.arm().is_some_and(|arm| arm.others.free.scale),
        // Its stated error includes the zeros of the arm.
        Effect::Joint(_) => calibration.arm().is_some(),
        Effect::Lens | Effect::Centre | Effect::BoardMoved(_) | Effect::CameraMoved(_) => false,
    }
}

/// Whether the answer already accounts for a hypothesis.
pub(super) fn is_applied(calibration: &estimate::Fit, hypothesis: &Hypothesis) -> bool {
    match hypothesis.code {
        FindingCode::BoardBent => counts_on(calibration, Effect::Warp),
        FindingCode::WrongScale => counts_on(calibration, Effect::Scale),
        FindingCode::OutlierView => hypothesis.views.iter().all(|name| is_out(calibration, name)),
        _ => false,
    }
}

/// Whether a view is left out of the answer.
fn is_out(calibration: &estimate::Fit, name: &str) -> bool {
    calibration.views.iter().any(|view| view.name == name && view.status != ViewStatus::Used)
}

/// Where a fit of the linear model at `linear_at` has the hand-eye transform that the calibration has at `answer`.
fn alternative(answer: &Pose<Mount, Camera>, linear_at: &Pose<Mount, Camera>, fit: &Fit) -> Alternative {
    let step = Vector6::from_iterator(fit.theta.rows(0, 6).iter().copied());
    let explained = linear_at.perturbed(&step);
    Alternative {
        shift: se3::log(&(answer.isometry().inverse() * explained.isometry())),
        covariance: Matrix6::from_iterator(fit.covariance.view((0, 0), (6, 6)).iter().copied()),
    }
}
