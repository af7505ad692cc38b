//! Moving and jogging the arm.

use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_geometry::frames::{Camera, Pose, Tip};
use handeye_session::CaptureId;

use super::command::{Command, Event};
use crate::app::context::{Context, Numbers};
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::ask::{go_home, may_set_out, set_out};
use crate::motion::correction::corrected;
use crate::motion::rest::{stop, stopped};
use crate::motion::state::{Correction, JogStep, Motion, MotionId, MotionRequest};
use crate::shell::state::Pane;
use crate::text::Text;
use crate::track::update::follow_ended;
use crate::worker::threads::Workers;
use handeye_link::{Jog, MotionGoal, MotionOutcome};
use handeye_wording::text;

/// Does what is wanted of the arm.
pub(crate) fn apply(cx: &mut Context, command: Command) {
    match command {
        Command::Stop => stop(&mut cx.model, &cx.workers),
        Command::Move { goal, what } => start_motion(cx, goal, what),
        Command::MoveCorrected { base_from_tip, what } => start_corrected(cx, MotionGoal::Tip(base_from_tip), what),
        Command::Jog(jog) => press_jog(&mut cx.model, &cx.workers, &mut cx.numbers, jog),
        Command::JogHeld(jog) => hold_jog(&mut cx.model, &cx.workers, jog),
        Command::JogReleased => cx.workers.release_jog(),
        Command::SetJog(settings) => cx.model.view.jog = settings,
        Command::GoHome => go_home(cx),
        Command::GoToCapture(id) => go_to_capture(cx, id),
    }
}

/// A motion that has ended, by its purpose, with its outcome.
pub(crate) enum Ended {
    /// The plan of verification poses.
    Plan(MotionOutcome),
    /// The sequence that is under way.
    Sequence(MotionOutcome),
}

/// Takes in what the arm did; returns what has ended for another feature.
pub(crate) fn absorb(cx: &mut Context, event: Event) -> Option<Ended> {
    match event {
        Event::Stopped => stopped(&mut cx.model),
        Event::Moved { id, outcome } => return moved(cx, id, outcome),
        Event::JogEnded { why } => jog_ended(&mut cx.model, why),
    }
    None
}

/// Moves the arm to a place that the words name.
pub(crate) fn start_motion(cx: &mut Context, goal: MotionGoal, what: Text) {
    start(cx, goal, what, None);
}

/// The same with the errors of the arm. If these are no longer known nothing moves: the user asked for another place.
fn start_corrected(cx: &mut Context, goal: MotionGoal, what: Text) {
    let arm = corrected(&cx.model).map(|(_, corrected)| Arc::clone(&corrected.arm));
    let Some((arm, robot)) = arm.zip(cx.model.robot.as_ref()) else {
        let why = text!("The errors of this arm are not known: nothing was moved");
        return cx.model.notify_in(Pane::Jog, Severity::Warning, why);
    };
    let near_rad = robot.joints_rad.to_vec();
    start(cx, goal, what, Some(Correction { arm, near_rad }));
}

fn start(cx: &mut Context, goal: MotionGoal, what: Text, correction: Option<Correction>) {
    cx.model.asked = None;
    cx.numbers.motion = MotionId(cx.numbers.motion.0 + 1);
    let id = cx.numbers.motion;
    let request = MotionRequest { id, goal, speed: cx.model.speed(), correction };
    cx.model.messages.is_over_in(Pane::Jog);
    match cx.workers.move_to(request) {
        Ok(()) => {
            cx.model.motion = Motion::Moving { id, what, since_s: cx.model.now_s };
        }
        // It is still the newest motion when that is taken in: no guided choice is open while a move begins.
        Err(busy) => cx.report(Event::Moved { id, outcome: MotionOutcome::Failed(busy.into()) }),
    }
}

fn go_to_capture(cx: &mut Context, id: CaptureId) {
    if !may_set_out(&mut cx.model) {
        return;
    }
    let Some(capture) = cx.model.document().capture(id) else { return };
    let joints = capture.joints_rad.as_deref().and_then(|joints| JointValues::try_from(joints).ok());
    let of_arm = cx.model.cell.as_ref().map(|cell| cell.joints.len());
    // Joints bring the arm back exactly; a recorded session may have the pose alone, or be of another arm.
    let joints = joints.filter(|joints| of_arm.is_none_or(|count| count == joints.len()));
    let goal = joints.map(MotionGoal::Joints).or(capture.base_from_tip.map(MotionGoal::Tip));
    let Some(goal) = goal else {
        let why = text!("Capture {id} has no pose of the robot", id = id);
        return cx.model.notify_in(Pane::Jog, Severity::Warning, why);
    };
    set_out(cx, goal, text!("pose of capture {id}", id = id));
}

fn moved(cx: &mut Context, id: MotionId, outcome: MotionOutcome) -> Option<Ended> {
    let what = match &cx.model.motion {
        Motion::Moving { id: moving, what, .. } if *moving == id => Some(what.clone()),
        _ => None,
    };
    if what.is_some() {
        cx.model.motion = Motion::Idle;
    }
    let what = what.unwrap_or_else(|| text!("the goal"));
    if cx.model.planning && cx.numbers.plan == Some(id) {
        return Some(Ended::Plan(outcome));
    }
    if cx.numbers.follow == Some(id) {
        follow_ended(&mut cx.model, &mut cx.numbers, outcome);
        return None;
    }
    match &outcome {
        MotionOutcome::Arrived => {}
        MotionOutcome::Stopped => {
            cx.model.notify_in(Pane::Jog, Severity::Warning, text!("Stopped on the way to {what}", what = what));
        }
        MotionOutcome::Refused(why) => {
            let why = why.clone();
            let reported = text!("The arm does not move to {what}: {why}", what = what, why = why);
            cx.model.notify_in(Pane::Jog, Severity::Warning, reported);
        }
        MotionOutcome::Unreached(why) | MotionOutcome::Failed(why) | MotionOutcome::Held(why) => {
            let reported = text!("The arm did not get to {what}: {why}", what = what, why = why.clone());
            cx.model.notify_in(Pane::Jog, Severity::Error, reported);
        }
    }
    // The late report of an earlier motion does not advance a sequence.
    (cx.model.sequence_runs && id == cx.numbers.motion).then_some(Ended::Sequence(outcome))
}

/// A press of a jog button: one step, or the beginning of holding it.
fn press_jog(model: &mut Model, workers: &Workers, numbers: &mut Numbers, jog: Jog) {
    model.messages.is_over_in(Pane::Jog);
    match model.jog_step() {
        JogStep::Hold => {
            hold_jog(model, workers, jog);
            model.motion = Motion::Jogging(jog);
        }
        JogStep::Step { metres, radians } => {
            numbers.motion = MotionId(numbers.motion.0 + 1);
            let id = numbers.motion;
            let speed = model.speed();
            let length = if jog.is_length(|joint| model.joint_kind(joint)) { metres } else { radians };
            match workers.jog_step(id, jog, length, speed, camera_on_tip(model)) {
                Ok(()) => {
                    let (what, since_s) = (text!("the next step"), model.now_s);
                    model.motion = Motion::Moving { id, what, since_s };
                }
                Err(busy) => model.notify_in(Pane::Jog, Severity::Warning, busy.into()),
            }
        }
    }
}

/// The button is still held. A jog that has ended by itself does not begin again before the next press.
fn hold_jog(model: &mut Model, workers: &Workers, jog: Jog) {
    if model.jog_step() != JogStep::Hold {
        return;
    }
    workers.hold_jog(jog, model.speed(), camera_on_tip(model));
}

fn jog_ended(model: &mut Model, why: Option<Text>) {
    if matches!(model.motion, Motion::Jogging(_)) {
        model.motion = Motion::Idle;
    }
    if let Some(why) = why {
        model.notify_in(Pane::Jog, Severity::Warning, text!("Jogging has ended: {why}", why = why));
    }
}

/// A motion whose connection broke ended with it.
pub(crate) fn motion_lost(cx: &mut Context) {
    if let Motion::Moving { id, .. } = cx.model.motion {
        let outcome = MotionOutcome::Failed(text!("the connection broke on the way"));
        cx.report(Event::Moved { id, outcome });
    } else {
        cx.model.motion = Motion::Idle;
    }
}

/// The camera on the tip as calibrated, or else as given by the scene: only to choose the axes of jogging.
fn camera_on_tip(model: &Model) -> Option<Pose<Tip, Camera>> {
    let reported = || Some(model.cell.as_ref()?.truth.as_ref()?.tip_from_camera);
    model.tip_from_camera().or_else(reported)
}
