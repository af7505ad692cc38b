//! Visiting all taught poses, or poses that are planned for verification, with a capture at each.

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::BoardInView;
use handeye_dataset::taught_poses::Goal;
use handeye_estimate::handeye::HandEye;

use crate::app::context::{Context, Numbers};
use crate::capture::state::{CapturePurpose, CaptureRefused};
use crate::capture::update::{capture, refuses_without_robot};
use crate::guided::progress::{guided_arrived, guided_is_over, guided_visited, guided_waits, guided_was_refused};
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion;
use crate::motion::ask::set_out;
use crate::motion::rest::stop;
use crate::motion::state::MotionId;
use crate::session::state::{PoseSequence, StopOutcome};
use crate::shell::state::Pane;
use crate::taught::break_off::{break_off, pane_of};
use crate::text::Text;
use crate::worker::threads::Workers;
use handeye_link::{MotionGoal, MotionOutcome, ViewsRequest};
use handeye_wording::text;

/// Poses that are planned for verification: enough for an average and a scatter, and over within a minute or two.
const VERIFYING: usize = 5;
/// Seed for choosing them: the same question gets the same poses.
const VIEWS_SEED: u64 = 1;

pub(crate) fn run_sequence(cx: &mut Context, purpose: Option<CapturePurpose>) {
    let names: Vec<String> = cx.model.taught().iter().map(|pose| pose.name.clone()).collect();
    if names.is_empty() {
        cx.model.notify(Severity::Warning, text!("There are no taught poses: teach some, or take the reference poses"));
        return;
    }
    if purpose.is_some() && refuses_without_robot(&mut cx.model) {
        return;
    }
    begin_sequence(
        cx,
        PoseSequence { names, planned: None, purpose, outcomes: Vec::new(), began_s: cx.model.now_s, guided: None },
    );
}

pub(crate) fn begin_sequence(cx: &mut Context, sequence: PoseSequence) {
    // From here on the arm is no longer moved by hand.
    cx.model.by_hand = None;
    cx.model.sequence = Some(sequence);
    cx.model.sequence_runs = true;
    cx.model.let_go = false;
    next_stop(cx);
}

/// Plans poses that differ from all captures, for verification.
pub(crate) fn plan_verification(model: &mut Model, workers: &Workers, numbers: &mut Numbers) {
    if model.sequence_runs || model.planning {
        return;
    }
    let board = model.calibrated().and_then(|calibrated| match calibrated.hand_eye {
        HandEye::EyeInHand { tip_from_camera, base_from_target } => Some(BoardInView {
            base_from_target,
            target: model.document().meta.target,
            intrinsics: calibrated.intrinsics,
            tip_from_camera,
        }),
        HandEye::EyeToHand { .. } => None,
    });
    let Some(board) = board else {
        let why = text!("Poses to verify at are planned with a calibration of a camera on the tip only");
        return model.notify_in(Pane::Verify, Severity::Warning, why);
    };
    let taken = model.document().captures.iter().filter(|it| !it.excluded).filter_map(|it| it.base_from_tip).collect();
    numbers.motion = MotionId(numbers.motion.0 + 1);
    model.messages.is_over_in(Pane::Verify);
    let request = ViewsRequest { board, taken, count: VERIFYING, seed: VIEWS_SEED };
    let asked = workers.plan_views(numbers.motion, request);
    model.planning = asked.is_ok();
    numbers.plan = asked.is_ok().then_some(numbers.motion);
    model.notify_if_refused(text!("No poses are planned"), asked);
}

/// The poses are planned, or cannot be.
pub(crate) fn planned(cx: &mut Context, id: MotionId, views: Result<Vec<JointValues>, Text>) {
    // After a stop nothing starts by itself.
    if cx.numbers.plan != Some(id) || !cx.model.planning {
        return;
    }
    cx.model.planning = false;
    match views {
        Ok(joints) => begin_sequence(
            cx,
            PoseSequence {
                names: (1..=joints.len()).map(|number| format!("V{number}")).collect(),
                planned: Some(joints),
                purpose: Some(CapturePurpose::Verify),
                outcomes: Vec::new(),
                began_s: cx.model.now_s,
                guided: None,
            },
        ),
        Err(why) => {
            let reported = text!("There are no poses to verify at: {why}", why = why);
            cx.model.notify_in(Pane::Verify, Severity::Warning, reported);
        }
    }
}

/// Nothing is planned after all: the arm does something else, or was stopped.
pub(crate) fn plan_refused(model: &mut Model, outcome: &MotionOutcome) {
    model.planning = false;
    if let Some(why) = outcome.why() {
        let reported = text!("There are no poses to verify at: {why}", why = why.clone());
        model.notify_in(Pane::Verify, Severity::Warning, reported);
    }
}

pub(crate) fn stop_sequence(model: &mut Model, workers: &Workers) {
    if model.sequence_runs {
        stop(model, workers);
    }
}

/// Starts towards the next pose, or ends the sequence.
pub(crate) fn next_stop(cx: &mut Context) {
    let Some(sequence) = cx.model.sequence.as_ref().filter(|_| cx.model.sequence_runs) else { return };
    if let Some(name) = sequence.current() {
        let name = name.to_owned();
        let planned = sequence.planned.as_ref().and_then(|joints| joints.get(sequence.outcomes.len()));
        match planned.copied() {
            Some(joints) => set_out(cx, MotionGoal::Joints(joints), text!("pose {name}", name = name)),
            None => go_to_taught(cx, &name),
        }
        return;
    }
    if guided_is_over(&mut cx.model, &cx.desk) || guided_waits(&mut cx.model, &cx.desk) {
        return;
    }
    let Some(sequence) = cx.model.sequence.as_ref() else { return };
    let pane = pane_of(sequence);
    let of = sequence.names.len();
    let done = sequence.outcomes.iter().filter(|outcome| **outcome == StopOutcome::Done).count();
    let took_s = cx.model.now_s - sequence.began_s;
    cx.model.sequence_runs = false;
    let severity = if done == of { Severity::Info } else { Severity::Warning };
    let took = format!("{took_s:.0}");
    let reported =
        text!("Sequence ended: {done} of {of} {of|pose|poses} in {took} s", done = done, of = of, took = took);
    match severity {
        Severity::Info => cx.model.notify(severity, reported),
        _ => cx.model.notify_in(pane, severity, reported),
    }
}

pub(crate) fn end_stop(cx: &mut Context, outcome: StopOutcome) {
    guided_visited(&mut cx.model, &outcome);
    if let Some(sequence) = &mut cx.model.sequence {
        sequence.outcomes.push(outcome);
    }
    next_stop(cx);
}

/// The motion of the sequence has ended.
pub(crate) fn sequence_moved(cx: &mut Context, outcome: &MotionOutcome) {
    let Some(sequence) = &cx.model.sequence else { return };
    if sequence.current().is_none() {
        // No pose is under way, only the choice of one, and that ended without a result.
        return break_off(&mut cx.model, outcome.why().cloned());
    }
    let (purpose, name) = (sequence.purpose, sequence.current().map(str::to_owned));
    match outcome {
        MotionOutcome::Arrived => {
            guided_arrived(&mut cx.model);
            match purpose {
                Some(purpose) => capture(&mut cx.model, &cx.workers, &mut cx.numbers, purpose, name),
                None => end_stop(cx, StopOutcome::Done),
            }
        }
        // A pose that cannot be reached is skipped; the others can still be visited.
        MotionOutcome::Refused(why) if guided_was_refused(&mut cx.model) => break_off(&mut cx.model, Some(why.clone())),
        MotionOutcome::Refused(why) | MotionOutcome::Unreached(why) => {
            end_stop(cx, StopOutcome::Skipped(why.clone()));
        }
        MotionOutcome::Stopped | MotionOutcome::Failed(_) | MotionOutcome::Held(_) => {
            break_off(&mut cx.model, outcome.why().cloned());
        }
    }
}

/// The capture of the sequence is on the disk.
pub(crate) fn sequence_captured(cx: &mut Context) {
    // One that the user took between two poses does not belong to the sequence.
    let is_at_pose = cx.model.sequence.as_ref().is_some_and(|sequence| sequence.current().is_some());
    if cx.model.sequence_runs && is_at_pose {
        end_stop(cx, StopOutcome::Done);
    }
}

/// There is no capture at this pose.
pub(crate) fn sequence_refused(cx: &mut Context, refused: &CaptureRefused) {
    if !cx.model.sequence_runs {
        return;
    }
    if refused.kind.concerns_the_pose() {
        end_stop(cx, StopOutcome::Skipped(refused.why.clone()));
    } else {
        break_off(&mut cx.model, Some(refused.why.clone()));
    }
}

pub(crate) fn go_to_taught(cx: &mut Context, name: &str) {
    let what = text!("pose {name}", name = name);
    let goal = cx.model.taught().into_iter().find(|pose| pose.name == name).map(|pose| match &pose.goal {
        Goal::Tip(base_from_tip) => Some(MotionGoal::Tip(*base_from_tip)),
        Goal::Joints(joints) => JointValues::try_from(&joints[..]).ok().map(MotionGoal::Joints),
    });
    match goal {
        Some(Some(goal)) => set_out(cx, goal, what),
        Some(None) => {
            let why = text!("no arm has as many joints as the pose");
            refuse(cx, why);
        }
        None => {
            let why = text!("it is no longer taught");
            refuse(cx, why);
        }
    }
}

fn refuse(cx: &mut Context, why: Text) {
    cx.numbers.motion = MotionId(cx.numbers.motion.0 + 1);
    let id = cx.numbers.motion;
    cx.report(motion::Event::Moved { id, outcome: MotionOutcome::Refused(why) });
}
