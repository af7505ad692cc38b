//! How a guided sequence continues.

use std::sync::Arc;

use handeye_estimate::Method;
use handeye_plan::guided::choose::Proposal;
use handeye_plan::guided::{Ending, Next};

use super::command::{Command, Event};
use super::progress::{guided_ends, guided_finished, guided_is_over, guided_mut, keep_guided};
use super::state::{Choice, ChoiceOutcome, ChosenStep, GuideRequest, GuidedProgress, Waits, options};
use crate::app::context::{Context, Numbers};
use crate::capture::state::CapturePurpose;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::state::MotionId;
use crate::motion::way::has_moved;
use crate::session::state::PoseSequence;
use crate::shell::state::Pane;
use crate::solve::state::SolveStatus;
use crate::solve::update::{chosen_box, corners, is_asked, seen, set_method};
use crate::taught::break_off::break_off;
use crate::taught::sequence::{begin_sequence, next_stop, stop_sequence};
use crate::worker::threads::Workers;
use handeye_wording::text;

/// Does what is wanted of guided capture.
pub(crate) fn apply(cx: &mut Context, command: Command) {
    match command {
        Command::CalibrateForMe => calibrate_for_me(cx),
    }
}

/// Takes in the pose that was chosen.
pub(crate) fn absorb(cx: &mut Context, event: Event) {
    let Event::Chosen { id, outcome } = event;
    guided_chosen(cx, id, outcome);
}

/// From the board in view to the goal. Existing captures count; if there are none, the first is taken here.
fn calibrate_for_me(cx: &mut Context) {
    if cx.model.sequence_runs || cx.model.planning {
        return;
    }
    let Some(joints) = cx.model.robot.as_ref().map(|robot| robot.joints_rad) else { return };
    let views = cx.model.document().in_use().filter(|it| corners(&cx.model, it.id).is_some()).count();
    let options = options(cx.model.view.goal.0, views);
    // What a view adds is only known for the joint estimate.
    set_method(&mut cx.model, &mut cx.desk, &mut cx.numbers, Method::Joint.name());
    cx.model.messages.is_over_in(Pane::Poses);
    let here = if views > 0 { Vec::new() } else { vec![joints] };
    begin_sequence(
        cx,
        PoseSequence {
            names: here.iter().map(|_| pose_name(1)).collect(),
            planned: Some(here),
            purpose: Some(CapturePurpose::Calibrate),
            outcomes: Vec::new(),
            began_s: cx.model.now_s,
            guided: Some(Box::new(GuidedProgress::new(options, cx.model.now_s))),
        },
    );
}

/// Whether the last sequence is a guided one that was interrupted: it continues with a choice from where the arm is
/// now, because the path to the skipped pose differs from the one that was checked.
pub(crate) fn continue_guided(cx: &mut Context) -> bool {
    let is_idle = !cx.model.sequence_runs && !cx.model.planning;
    let has_captures = !cx.model.document().captures.is_empty();
    let Some(sequence) = cx.model.sequence.as_mut().filter(|_| is_idle) else { return false };
    let (visited, Some(guided)) = (sequence.outcomes.len(), sequence.guided.as_deref_mut()) else { return false };
    if !has_captures {
        calibrate_for_me(cx);
        return true;
    }
    guided.waits = Waits::Answer;
    guided.refused_moves = 0;
    guided.ahead.clear();
    guided.since = (cx.model.now_s, visited);
    sequence.names.truncate(visited);
    if let Some(planned) = &mut sequence.planned {
        planned.truncate(visited);
    }
    cx.model.sequence_runs = true;
    cx.model.let_go = false;
    guided_step(&mut cx.model, &cx.workers, &mut cx.numbers);
    true
}

/// Requests the next pose as soon as the answer from all captures is there. Looked at after every event, because the
/// answer may come in several ways, or not at all.
pub(crate) fn guided_step(model: &mut Model, workers: &Workers, numbers: &mut Numbers) {
    let waits = guided_mut(model).map(|guided| guided.waits);
    if waits != Some(Waits::Answer) || model.capture.is_some() {
        return;
    }
    if matches!(model.solve.status, SolveStatus::Running { .. }) || !is_asked(model, numbers) {
        return;
    }
    let solved = model.solve.solved.clone().filter(|_| model.solve.fresh);
    let document = Arc::clone(&model.session.document);
    let observations = seen(model, &document).observations;
    let (speed, tool_box) = (model.speed(), chosen_box(model));
    let Some(sequence) = model.sequence.as_mut() else { return };
    let elapsed_s = model.now_s - sequence.began_s;
    let Some(guided) = sequence.guided.as_deref_mut() else { return };
    guided.waits = Waits::Choice;
    guided.guide.work_in(tool_box);
    let check = guided.ending.as_ref().map(|_| guided.tried);
    let request = GuideRequest { guide: guided.guide.clone(), observations, solved, elapsed_s, speed, check };
    numbers.motion = MotionId(numbers.motion.0 + 1);
    if workers.guide(numbers.motion, request).is_err() {
        break_off(model, None);
    }
}

/// The next pose is chosen, or there is none.
fn guided_chosen(cx: &mut Context, id: MotionId, outcome: ChoiceOutcome) {
    // After a stop nothing starts by itself.
    if id != cx.numbers.motion || guided_mut(&mut cx.model).is_none_or(|guided| guided.waits != Waits::Choice) {
        return;
    }
    let Choice { guide, step, views_left, chosen_at } = match outcome {
        Ok(choice) => *choice,
        // As where the connection broke: that does not mean that there are no more poses.
        Err(why) => return break_off(&mut cx.model, Some(why)),
    };
    let Some(guided) = guided_mut(&mut cx.model) else { return };
    guided.guide = guide;
    guided.waits = Waits::Nothing;
    guided.views_left = views_left;
    guided.chosen_at = Some(chosen_at);
    match step {
        ChosenStep::Next(next) => match *next {
            Next::Go { plan, why } => {
                guided.why = Some(why);
                guided.ahead = plan.proposals;
                if guided.ahead.is_empty() {
                    choice_ended(cx, Ending::NothingInReach { candidates: plan.candidates });
                } else {
                    guided_sets_out(cx);
                }
            }
            Next::End(ending) => choice_ended(cx, ending),
        },
        ChosenStep::Check(Some(proposal)) => {
            guided.ahead = vec![*proposal];
            guided_sets_out(cx);
        }
        ChosenStep::Check(None) => guided_finished(&mut cx.model, &cx.desk),
    }
    keep_guided(&mut cx.model, &cx.desk);
}

/// Starts towards the next pose.
fn guided_sets_out(cx: &mut Context) {
    if guided_is_elsewhere(&mut cx.model) {
        return;
    }
    if let Some(next) = guided_mut(&mut cx.model).and_then(|guided| guided.ahead.first().cloned()) {
        guided_goes_to(cx, &next);
    }
}

/// Whether the arm is not where the path to the next pose was checked from; then another pose is chosen.
fn guided_is_elsewhere(model: &mut Model) -> bool {
    let now = model.robot.as_ref().map(|robot| robot.joints_rad);
    // There is no path to the place where it begins.
    let Some(guided) = guided_mut(model).filter(|guided| !guided.ahead.is_empty()) else { return false };
    if !has_moved(guided.chosen_at.as_ref(), now.as_ref()) {
        return false;
    }
    guided.waits = Waits::Answer;
    let reported =
        text!("The arm is elsewhere than when this pose was chosen: another one is chosen from where it is now");
    model.notify(Severity::Info, reported);
    true
}

/// The same for a pose that the user has just allowed the arm to move to.
pub(crate) fn guided_chooses_again(model: &mut Model) -> bool {
    let is_elsewhere = guided_is_elsewhere(model);
    if is_elsewhere {
        guided_leaves_out(model);
    }
    is_elsewhere
}

/// Removes the last pose of the sequence, which is not visited after all.
fn guided_leaves_out(model: &mut Model) {
    let Some(sequence) = model.sequence.as_mut() else { return };
    sequence.names.pop();
    if let Some(planned) = &mut sequence.planned {
        planned.pop();
    }
}

/// The user skips the next pose; whether it belonged to a guided sequence.
pub(crate) fn guided_skips(cx: &mut Context) -> bool {
    if guided_mut(&mut cx.model).is_none() {
        return false;
    }
    guided_leaves_out(&mut cx.model);
    let Some(guided) = guided_mut(&mut cx.model) else { return true };
    guided.ahead.clear();
    guided.waits = Waits::Answer;
    if guided.ending.is_some() {
        guided.tried += 1;
        if guided_is_over(&mut cx.model, &cx.desk) {
            return true;
        }
    } else {
        guided.guide.skipped();
    }
    guided_step(&mut cx.model, &cx.workers, &mut cx.numbers);
    true
}

fn guided_goes_to(cx: &mut Context, proposal: &Proposal) {
    let Some(joints) = proposal.joints else {
        return guided_ends(
            &mut cx.model,
            &cx.desk,
            Severity::Warning,
            text!("The kinematics of the arm is not known"),
        );
    };
    let Some(sequence) = cx.model.sequence.as_mut() else { return };
    let name = match sequence.purpose {
        Some(CapturePurpose::Verify) => format!("C{}", sequence.names.len() + 1),
        _ => pose_name(sequence.names.len() + 1),
    };
    sequence.names.push(name);
    sequence.planned.get_or_insert_default().push(joints);
    next_stop(cx);
}

/// No more poses for the fit. Where there is an answer it is checked.
fn choice_ended(cx: &mut Context, ending: Ending) {
    if matches!(cx.model.solve.status, SolveStatus::Running { .. }) {
        // The captures or the goal have changed since the choice.
        if let Some(guided) = guided_mut(&mut cx.model) {
            guided.waits = Waits::Answer;
        }
        return;
    }
    let (has_answer, reported) = (cx.model.solve.fresh, ending.text());
    let Some(sequence) = cx.model.sequence.as_mut() else { return };
    if let Some(guided) = sequence.guided.as_deref_mut() {
        guided.ending = Some(ending);
        guided.why = None;
        guided.ahead.clear();
        guided.waits = Waits::Answer;
    }
    if !has_answer {
        return guided_ends(&mut cx.model, &cx.desk, Severity::Warning, reported);
    }
    sequence.purpose = Some(CapturePurpose::Verify);
    guided_step(&mut cx.model, &cx.workers, &mut cx.numbers);
}

/// A guided sequence belongs to one target and one set-up.
pub(crate) fn forget_guided(model: &mut Model, workers: &Workers) {
    model.by_hand = None;
    if model.sequence.as_ref().is_some_and(|sequence| sequence.guided.is_some()) {
        stop_sequence(model, workers);
        model.sequence = None;
    }
}

fn pose_name(number: usize) -> String {
    format!("G{number}")
}
