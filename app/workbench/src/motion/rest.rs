//! What the states report about an arm that was stopped.

use handeye_driver::{Place, RestWatch};
use handeye_link::moved_text;

use super::state::Stopping;
use crate::capture::update::cancel_capture;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::state::Motion;
use crate::text::Text;
use crate::worker::threads::Workers;
use handeye_link::{Moves, RobotState, Simulation};
use handeye_wording::text;

/// Time \[s\] that an arm has to come to rest: the same as a driver has for its own answer.
const PATIENCE_S: f64 = 2.0;

/// The arm was commanded to stop. Its states show whether it did.
fn watch_stop(model: &mut Model) {
    model.stop_pending = true;
    model.stopping = Some(Stopping { since_s: model.now_s, watch: RestWatch::default() });
    if let Some(robot) = model.robot.clone() {
        stop_seen(model, &robot);
    }
}

/// A state has arrived.
pub(crate) fn stop_seen(model: &mut Model, robot: &RobotState) {
    let Some(stopping) = &mut model.stopping else { return };
    let is_news = stopping.watch.newest().is_none_or(|newest| newest.stamp_s != robot.sim_time_s);
    // In a simulation whose time is paused nothing moves.
    if robot.simulation != Simulation::Running || is_news && stopping.watch.take(place(robot)) {
        stop_is_over(model, Severity::Info, text!("Arm stopped: every joint stays where it is"));
    }
}

/// Time has passed.
pub(crate) fn stop_waits(model: &mut Model) {
    let Some(stopping) = model.stopping else { return };
    if model.now_s - stopping.since_s < PATIENCE_S {
        return;
    }
    let (severity, reported) = match (stopping.watch.is_still(), stopping.watch.moved()) {
        (Some(true), _) => (Severity::Info, text!("Arm stopped: every joint stays where it is")),
        (Some(false), Some(moved)) => (
            Severity::Error,
            text!(
                "The arm was told to stop and still moves: {moved} since. Use its own emergency stop",
                moved = moved_text(&moved, |joint| Some(model.joint_kind(joint)))
            ),
        ),
        // A simulation that the user has paused.
        _ if model.moves() == Moves::Freely && model.robot.is_some() => {
            (Severity::Info, text!("Arm stopped: every joint stays where it is"))
        }
        _ => (
            Severity::Error,
            text!(
                "The arm was told to stop, and it is not known whether it has: no state has come since. Look at the arm"
            ),
        ),
    };
    stop_is_over(model, severity, reported);
}

fn stop_is_over(model: &mut Model, severity: Severity, reported: Text) {
    model.stopping = None;
    model.stop_pending = false;
    model.notify(severity, reported);
}

pub(crate) fn stop(model: &mut Model, workers: &Workers) {
    workers.press_stop();
    stop_requested(model, workers);
}

pub(crate) fn stop_requested(model: &mut Model, workers: &Workers) {
    model.sequence_runs = false;
    model.asked = None;
    model.planning = false;
    cancel_capture(model, workers);
    // It may be done already: only its report is not here yet.
    model.stop_pending = workers.stop_line().is_pressed();
    if model.control.is_connected() {
        model.notify(Severity::Info, text!("Stopping the arm…"));
    } else {
        model.notify(
            Severity::Error,
            text!(
                "The arm cannot be reached: use its own emergency stop. It is stopped as soon as the connection is \
                 back"
            ),
        );
    }
}

pub(crate) fn stopped(model: &mut Model) {
    model.motion = Motion::Idle;
    watch_stop(model);
}

fn place(robot: &RobotState) -> Place {
    let joints = Some(robot.joints_rad).filter(|joints| !joints.is_empty());
    Place { stamp_s: robot.sim_time_s, joints, base_from_tip: robot.base_from_tip }
}
