//! Tracking the board and following it.

use std::sync::Arc;

use handeye_track::{MotionModel, Setup};

use super::command::{Command, Event};
use crate::app::context::Numbers;
use crate::connect::worker::ControlTask;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::correction::{corrected, helpful};
use crate::motion::state::{Motion, MotionId};
use crate::shell::state::Pane;
use crate::solve::state::Corrected;
use crate::text::Text;
use crate::track::state::{BoardMotion, FollowRequest, FollowStatus, MAX_TRACK_POINTS, TrackPoint, Tracked};
use crate::track::worker::TrackedBy;
use crate::worker::link::Request;
use crate::worker::threads::Workers;
use crate::worker::vision::VisionTask;
use handeye_link::MotionOutcome;
use handeye_wording::text;

/// χ² of three degrees of freedom at 95 %, as a radius.
const RADIUS_95: f64 = 2.795_483_482_915_108;

/// Does what is wanted of tracking and following.
pub(crate) fn apply(model: &mut Model, workers: &Workers, numbers: &mut Numbers, command: Command) {
    match command {
        Command::SetTracking(on) => set_tracking(model, workers, numbers, on),
        Command::SetFollow(request) => set_follow(model, workers, numbers, request),
        Command::SetCorrected(wanted) => {
            model.track.wants_corrected = Some(wanted);
            reconsider_correction(model, workers);
        }
        Command::MoveBoard(motion) => move_board(model, workers, motion),
        Command::HideBoard(hidden) => hide_board(model, workers, hidden),
    }
}

/// Takes in where the board is, and how following goes.
pub(crate) fn absorb(model: &mut Model, workers: &Workers, numbers: &mut Numbers, event: Event) {
    match event {
        Event::Tracked(newest) => tracked(model, newest),
        Event::Failed { why } => track_failed(model, workers, numbers, why),
        Event::Follow(status) => follow_goes(model, numbers, status),
    }
}

pub(crate) fn set_tracking(model: &mut Model, workers: &Workers, numbers: &mut Numbers, on: bool) {
    if on && model.calibrated().is_none() {
        model.notify(Severity::Warning, text!("Tracking needs a calibration: capture poses and solve first"));
        return;
    }
    let before = std::mem::replace(&mut model.track.on, on);
    if before != on {
        model.track.newest = None;
        model.track.history.clear();
        send_tracking(model, workers);
    }
    if !on {
        set_follow(model, workers, numbers, None);
    }
}

/// The calibration that corrects tip poses and commands, if wanted.
fn correcting(model: &Model) -> Option<&Corrected> {
    match model.track.wants_corrected {
        Some(wanted) => corrected(model).filter(|_| wanted).map(|(_, corrected)| corrected),
        None => helpful(model),
    }
}

/// Switches tracking by corrected tip poses on or off if whether it applies has changed: the robot reports again, or it is another
/// arm. An arm that follows continues as it began.
pub(crate) fn reconsider_correction(model: &mut Model, workers: &Workers) {
    let corrects = model.track.by.as_ref().is_some_and(|by| by.arm.is_some());
    if model.track.on
        && model.track.request.is_none()
        && model.robot.is_some()
        && correcting(model).is_some() != corrects
    {
        send_tracking(model, workers);
    }
}

/// Makes the vision thread track with the newest calibration, or stop tracking.
pub(crate) fn send_tracking(model: &mut Model, workers: &Workers) {
    let corrected = correcting(model);
    let calibrated = corrected.map_or_else(|| model.calibrated(), |corrected| Some(&corrected.calibrated));
    let by = calibrated.filter(|_| model.track.on).map(|calibrated| TrackedBy {
        setup: Setup {
            target: model.document().meta.target,
            calibrated: calibrated.clone(),
            motion: MotionModel::default(),
        },
        arm: corrected.map(|corrected| Arc::clone(&corrected.arm)),
    });
    model.track.by = by.clone().map(Arc::new);
    let asked = workers.ask_vision(VisionTask::Track(by.map(Box::new)));
    model.notify_if_refused(text!("Tracking was not changed"), asked);
}

fn tracked(model: &mut Model, tracked: Arc<Tracked>) {
    let track = &mut model.track;
    // It was on its way when tracking ended.
    if !track.on {
        return;
    }
    let estimate = tracked.update.estimate.as_ref();
    let radius_m = |covariance: &nalgebra::Matrix6<f64>| {
        let largest = covariance.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigenvalues().max();
        largest.max(0.0).sqrt() * RADIUS_95
    };
    track.history.push_back(TrackPoint {
        time_s: tracked.update.time_s,
        position_m: estimate.map(|estimate| estimate.base_from_target.translation().into()),
        position_95_m: estimate.map(|estimate| radius_m(&estimate.covariance)),
        error: tracked.error,
        latency_s: tracked.latency_s,
    });
    while track.history.len() > MAX_TRACK_POINTS {
        track.history.pop_front();
    }
    track.newest = Some(tracked);
}

fn track_failed(model: &mut Model, workers: &Workers, numbers: &mut Numbers, why: Text) {
    model.notify(Severity::Error, text!("The board is not tracked: {why}", why = why));
    set_tracking(model, workers, numbers, false);
}

fn set_follow(model: &mut Model, workers: &Workers, numbers: &mut Numbers, request: Option<FollowRequest>) {
    model.track.request = request;
    let Some(request) = request else {
        if numbers.follow.is_some() {
            workers.cancel_motion();
        }
        return;
    };
    if !model.track.on {
        follow_ended(model, numbers, MotionOutcome::Refused(text!("The board is not tracked: start tracking first")));
        return;
    }
    numbers.motion = MotionId(numbers.motion.0 + 1);
    let id = numbers.motion;
    match workers.follow(id, request, model.speed()) {
        Ok(()) => {
            numbers.follow = Some(id);
            model.track.follow = FollowStatus::Off;
            let what = text!("the board");
            model.motion = Motion::Moving { id, what, since_s: model.now_s };
            model.notify(Severity::Info, text!("The arm follows the board"));
        }
        Err(busy) => follow_ended(model, numbers, MotionOutcome::Refused(busy.into())),
    }
}

/// Following continues. What was on its way when it ended is ignored.
fn follow_goes(model: &mut Model, numbers: &Numbers, status: FollowStatus) {
    if numbers.follow.is_some() {
        model.track.follow = status;
    }
}

pub(crate) fn follow_ended(model: &mut Model, numbers: &mut Numbers, outcome: MotionOutcome) {
    numbers.follow = None;
    model.track.request = None;
    let (severity, why) = match outcome {
        MotionOutcome::Arrived | MotionOutcome::Stopped => (Severity::Info, text!("it was stopped")),
        MotionOutcome::Refused(why)
        | MotionOutcome::Unreached(why)
        | MotionOutcome::Failed(why)
        | MotionOutcome::Held(why) => (Severity::Warning, why),
    };
    let reported = text!("The arm does not follow the board: {why}", why = why.clone());
    match severity {
        Severity::Info => model.notify(severity, reported),
        _ => model.notify_in(Pane::Track, severity, reported),
    }
    model.track.follow = FollowStatus::Ended(why);
}

fn move_board(model: &mut Model, workers: &Workers, motion: BoardMotion) {
    let asked = workers.ask_control(Request::Do(ControlTask::MoveBoard(motion)));
    if asked.is_ok() {
        model.track.board = motion;
    }
    model.notify_if_refused(text!("The board was not moved"), asked);
}

fn hide_board(model: &mut Model, workers: &Workers, hidden: bool) {
    let asked = workers.ask_control(Request::Do(ControlTask::HideBoard(hidden)));
    if asked.is_ok() {
        model.track.board_hidden = hidden;
    }
    model.notify_if_refused(text!("The board was not hidden"), asked);
}
