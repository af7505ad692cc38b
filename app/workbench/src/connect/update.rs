//! The connections to the cell.

use std::sync::Arc;
use std::thread::Builder;

use handeye_coppeliasim::cell::CellPaths;
use handeye_geometry::frames::{Base, Pose, Tip};

use super::command::{Command, Event};
use crate::app::context::{Connector, Context};
use crate::connect::server_name;
use crate::connect::state::{Link, LinkState};
use crate::connect::worker::ControlTask;
use crate::keep_out::update::send_keep_out;
use crate::live::worker::CameraTask;
use crate::messages::state::{Home, Severity};
use crate::model::Model;
use crate::motion::rest::stop_seen;
use crate::motion::state::Motion;
use crate::motion::update::motion_lost;
use crate::session::desk::SessionThreads;
use crate::session::requests::{send_intrinsics, send_target};
use crate::session::update::prepare_session;
use crate::settings::ADDRESSES;
use crate::taught::sequence::stop_sequence;
use crate::text::Text;
use crate::track::state::BoardMotion;
use crate::track::trail::Trail;
use crate::track::update::{reconsider_correction, send_tracking};
use crate::worker::link::Request;
use crate::worker::threads::Workers;
use handeye_link::{ArmDoubt, CellFacts, CellSource, RobotState};
use handeye_wording::text;

/// Does what is wanted of the connection.
pub(crate) fn apply(cx: &mut Context, connector: &Connector, command: Command) {
    match command {
        Command::StartSimulation => start_simulation(&mut cx.model, &cx.workers),
        Command::Reconnect => reconnect(cx, connector),
        Command::StopTrying => stop_trying(&mut cx.model, &cx.workers),
        Command::Connect(source) => connect(cx, connector, source),
        Command::Arm(on) => arm(&mut cx.model, &cx.workers, on),
        Command::TypePose(pose) => type_pose(&mut cx.model, &cx.workers, Some(pose)),
        Command::SetObjects(objects) => set_objects(cx, connector, objects),
        Command::ResetCell => reset_cell(cx, connector),
    }
}

/// Takes in what the cell reports.
pub(crate) fn absorb(cx: &mut Context, event: Event) {
    match event {
        Event::Link { link, state } => link_changed(cx, link, state),
        Event::Robot(robot) => {
            robot_read(&mut cx.model, robot);
            reconsider_correction(&mut cx.model, &cx.workers);
        }
        Event::NoRobot => cx.model.robot = None,
        Event::Cell(facts) => cell_found(&mut cx.model, &cx.workers, &cx.desk, *facts),
        Event::Heard { severity, words } => heard(&mut cx.model, severity, words),
    }
}

fn robot_read(model: &mut Model, robot: RobotState) {
    model.trail.add(robot.base_from_tip.translation().into());
    stop_seen(model, &robot);
    if !robot.joints_rad.is_empty() {
        model.home.get_or_insert(robot.joints_rad);
    }
    model.robot = Some(robot);
    model.robot_read_s = Some(model.now_s);
}

fn start_simulation(model: &mut Model, workers: &Workers) {
    let asked = workers.ask_control(Request::Do(ControlTask::StartSimulation));
    model.notify_if_refused(text!("The simulation was not started"), asked);
}

/// Retries now what is being retried. A connection that works is made again, because the scene may have changed.
fn reconnect(cx: &mut Context, connector: &Connector) {
    if cx.model.control.is_connected() && !cx.model.source.is_built_in() {
        return connect(cx, connector, cx.model.source.clone());
    }
    let asked = cx.workers.reconnect();
    cx.model.notify_if_refused(text!("The connection was not tried again"), asked);
}

/// Stops restarting drivers that are gone.
fn stop_trying(model: &mut Model, workers: &Workers) {
    let asked = workers.stop_trying();
    model.notify_if_refused(text!("Trying to connect was not stopped"), asked);
}

/// Works with another cell. What is open stays open: a session belongs to its captures, not to a connection.
fn connect(cx: &mut Context, connector: &Connector, source: CellSource) {
    match &source {
        CellSource::BuiltIn(_) => {}
        CellSource::Address(address) => put_first(&mut cx.model.addresses, address),
        CellSource::Drivers(drivers) => put_first(&mut cx.model.drivers, drivers),
    }
    (cx.model.robot, cx.model.robot_read_s) = (None, None);
    cx.model.frame = None;
    cx.model.cell = None;
    cx.model.detection = None;
    // Planned poses belong to the other arm.
    cx.model.sequence = None;
    cx.model.sequence_runs = false;
    cx.model.asked = None;
    cx.model.home = None;
    cx.model.stopping = None;
    cx.model.cells += 1;
    cx.model.planning = false;
    cx.model.by_hand = None;
    cx.model.motion = Motion::Idle;
    let first = LinkState::first(&source);
    cx.model.control = first.clone();
    cx.model.camera = first.clone();
    cx.model.mover = first;
    let cell = (connector.connect)(&source, &cx.model.objects);
    let captures = cx.desk.captures();
    let stop = Arc::clone(cx.workers.stop_line());
    match Workers::start(&source, &cx.model.view, &cell, captures, &stop, &connector.clock, &connector.waker) {
        Ok(workers) => {
            let before = std::mem::replace(&mut cx.workers, workers);
            // It waits for calls under way, which the window must not.
            let farewell = Builder::new().name("farewell".to_owned()).spawn(move || drop(before));
            if let Err(error) = farewell {
                tracing::warn!(%error, "the connection before was left alone");
            }
            // A session does not record which cell its captures are of.
            if source != cx.model.source && !cx.model.document().captures.is_empty() {
                cx.model.notify(
                    Severity::Warning,
                    text!("If this is another cell than that of the captures, begin a new session (Ctrl+N): captures of two cells do not calibrate together"),
                );
            }
        }
        Err(error) => {
            cx.model.notify(Severity::Error, text!("The connection could not be started: {error}", error = error));
        }
    }
    cx.model.source = source;
    cx.model.capture = None;
    cx.model.track.board = BoardMotion::default();
    cx.model.track.board_hidden = false;
    cx.model.trail = Trail::default();
    cx.model.scene_is_fitted = false;
    cx.model.keep_out.scene_obstacles = None;
    cx.model.keep_out.unkept = None;
    send_target(&mut cx.model, &cx.workers);
    send_keep_out(&cx.model, &cx.workers);
    send_tracking(&mut cx.model, &cx.workers);
}

/// The objects of the scene have changed, so everything that was read from them has, too.
fn set_objects(cx: &mut Context, connector: &Connector, objects: CellPaths) {
    cx.model.objects = objects;
    if matches!(cx.model.source, CellSource::Address(_)) {
        connect(cx, connector, cx.model.source.clone());
    }
}

fn cell_found(model: &mut Model, workers: &Workers, desk: &SessionThreads, facts: CellFacts) {
    let doubted = model.cell.as_ref().and_then(|before| before.arm_doubt);
    match facts.arm_doubt {
        Some(ArmDoubt::Foreign { distance_m, angle_rad }) => model.notify(
            Severity::Warning,
            text!(
                "By its joints the tip of the robot is {distance} mm and {angle}° from where its driver reports it, so its chain of joints is not used. Check arm and base_from_arm of the driver and the tool that is set on the controller, and connect again",
                distance = format!("{:.1}", distance_m * 1e3),
                angle = format!("{:.2}", angle_rad.to_degrees())
            ),
        ),
        None if doubted.is_some() && facts.arm.is_some() => model.notify(
            Severity::Info,
            text!("Joints and poses of the robot agree: Calibrate for me can move it, once it is allowed to"),
        ),
        _ => {}
    }
    let is_foreign = matches!(facts.arm_doubt, Some(ArmDoubt::Foreign { .. }));
    let had_arm = model.cell.as_ref().is_some_and(|before| before.arm.is_some());
    model.scene_is_fitted &= had_arm == facts.arm.is_some();
    model.cell = Some(facts);
    // Poses that were chosen with that chain are no longer visited, neither the one under way nor one that waits.
    if is_foreign && model.sequence.as_ref().is_some_and(|sequence| sequence.planned.is_some()) {
        stop_sequence(model, workers);
    }
    // Where the arm is known it keeps out of boxes.
    send_keep_out(model, workers);
    prepare_session(model, desk);
    send_intrinsics(model, workers);
}

fn link_changed(cx: &mut Context, link: Link, state: LinkState) {
    let before = match link {
        Link::Control => std::mem::replace(&mut cx.model.control, state),
        Link::Camera => std::mem::replace(&mut cx.model.camera, state),
        Link::Motion => std::mem::replace(&mut cx.model.mover, state),
    };
    if link == Link::Motion && before.is_connected() {
        motion_lost(cx);
    }
    match (cx.model.link(link).clone(), before.is_connected()) {
        (LinkState::Connected { server, address }, false) => {
            let server = server_name(&cx.model.source, &server);
            let text = match link {
                Link::Control => {
                    text!("Robot connected to {server} at {address}", server = server, address = address)
                }
                Link::Camera => {
                    text!("Camera connected to {server} at {address}", server = server, address = address)
                }
                Link::Motion => return,
            };
            cx.model.notify(Severity::Info, text);
        }
        (LinkState::Lost { why, .. }, true) => {
            let text = match link {
                Link::Control => text!("Robot connection lost: {why}", why = why),
                Link::Camera => text!("Camera connection lost: {why}", why = why),
                // Images and joints still work, so no card below the steps reports it.
                Link::Motion => {
                    let reported = text!("Connection for motions lost: {why}", why = why);
                    return cx.model.notify(Severity::Warning, reported);
                }
            };
            cx.model.notify_connection(Severity::Warning, text);
        }
        (LinkState::Failed { why }, _) if link != Link::Motion => {
            cx.model.notify_connection(Severity::Error, why);
        }
        _ => {}
    }
}

/// Lets a robot behind a driver be moved, or no longer.
fn arm(model: &mut Model, workers: &Workers, on: bool) {
    let asked = workers.ask_control(Request::Do(ControlTask::Arm(on)));
    model.notify_if_refused(text!("The permission to move the robot was not changed"), asked);
}

/// Takes the pose that the pendant shows; `None` once the robot has moved on.
fn type_pose(model: &mut Model, workers: &Workers, pose: Option<Pose<Base, Tip>>) {
    let asked = workers.ask_control(Request::Do(ControlTask::TypePose(pose)));
    model.notify_if_refused(text!("The pose was not taken"), asked);
}

/// A pose that was typed is that of one capture: the next one is from another place, and the old pose would be wrong.
pub(crate) fn forget_typed_pose(model: &mut Model, workers: &Workers) {
    if model.cell.as_ref().is_some_and(|cell| cell.poses_are_typed) {
        type_pose(model, workers, None);
    }
}

/// A driver sent a message for the user.
fn heard(model: &mut Model, severity: Severity, words: String) {
    let home = if severity == Severity::Error { Home::Toast } else { Home::Log };
    model.messages.notify_at(home, severity, Text::verbatim(words), model.now_s);
}

/// Has a worker of the camera do something.
pub(crate) fn ask_camera(
    model: &mut Model,
    workers: &Workers,
    task: CameraTask,
    failure: handeye_wording::Text,
) -> bool {
    let asked = workers.ask_camera(Request::Do(task));
    let taken = asked.is_ok();
    model.notify_if_refused(failure, asked);
    taken
}

/// Starts the built-in cell again: arm and board are back at their initial poses.
fn reset_cell(cx: &mut Context, connector: &Connector) {
    if let CellSource::BuiltIn(_) = cx.model.source {
        connect(cx, connector, cx.model.source.clone());
    }
}

/// Puts it before the others, without duplicates.
fn put_first<T: PartialEq + Clone>(earlier: &mut Vec<T>, newest: &T) {
    earlier.retain(|other| other != newest);
    earlier.insert(0, newest.clone());
    earlier.truncate(ADDRESSES);
}
