//! The connections to the cell.

use std::sync::Arc;
use std::thread::Builder;

use handeye_coppeliasim::cell::CellPaths;
use handeye_geometry::frames::{Base, Pose, Tip};

use crate::app::App;
use crate::connect::server_name;
use crate::model::{ArmDoubt, BoardMotion, CellFacts, CellSource, Home, Link, LinkState, Motion, Severity, Trail};
use crate::text::Text;
use crate::worker::{CameraTask, ControlTask, Request, StopLine, Workers};
use handeye_wording::text;

/// Earlier addresses that are offered again.
pub const ADDRESSES: usize = 8;

impl App {
    pub(crate) fn stop(&mut self) {
        self.workers.press_stop();
        self.stop_asked();
    }

    /// Takes note of stops that other threads have pressed. Nothing that moves begins before: a sequence would go on with
    /// its next pose.
    pub(crate) fn take_outside_stops(&mut self) {
        let pressed = self.workers.stop_line().outside();
        if std::mem::replace(&mut self.outside_stops, pressed) < pressed {
            self.stop_asked();
        }
    }

    /// What is asked for from now on was asked for after so many stops of other threads.
    pub fn note_stops(&mut self, pressed: u64) {
        self.take_outside_stops();
        self.workers.stop_line().note(pressed);
    }

    /// What stops the arm, for other threads.
    pub fn stop_line(&self) -> &Arc<StopLine> {
        self.workers.stop_line()
    }

    fn stop_asked(&mut self) {
        self.model.sequence_runs = false;
        self.model.asked = None;
        self.model.planning = false;
        self.cancel_capture();
        // It may be done already: only its report is not here yet.
        self.model.stop_pending = self.workers.stop_line().is_pressed();
        if self.model.control.is_connected() {
            self.say(Severity::Info, text!("Stopping the arm…"));
        } else {
            self.say(
                Severity::Error,
                text!(
                    "The arm cannot be reached: use its own emergency stop. It is stopped as soon as the connection is \
                     back"
                ),
            );
        }
    }

    pub(crate) fn stopped(&mut self) {
        self.model.motion = Motion::Idle;
        self.watch_stop();
    }

    pub(crate) fn start_simulation(&mut self) {
        let asked = self.workers.ask_control(Request::Do(ControlTask::StartSimulation));
        self.expect(text!("The simulation was not started"), asked);
    }

    /// Tries now what is being tried. A connection that works is made anew, because the scene may be another one.
    pub(crate) fn reconnect(&mut self) {
        if self.model.control.is_connected() && !self.model.source.is_built_in() {
            return self.connect(self.model.source.clone());
        }
        let asked = self.workers.reconnect();
        self.expect(text!("The connection was not tried again"), asked);
    }

    /// Starts drivers that are gone no more.
    pub(crate) fn stop_trying(&mut self) {
        let asked = self.workers.stop_trying();
        self.expect(text!("Trying to connect was not stopped"), asked);
    }

    /// Works with another cell. What is open stays open: a session belongs to its captures, not to a connection.
    pub(crate) fn connect(&mut self, source: CellSource) {
        match &source {
            CellSource::BuiltIn(_) => {}
            CellSource::Address(address) => put_first(&mut self.model.addresses, address),
            CellSource::Drivers(drivers) => put_first(&mut self.model.drivers, drivers),
        }
        (self.model.robot, self.model.robot_read_s) = (None, None);
        self.model.frame = None;
        self.model.cell = None;
        self.model.detection = None;
        // Planned poses are those of the other arm.
        self.model.sequence = None;
        self.model.sequence_runs = false;
        self.model.asked = None;
        self.model.home = None;
        self.model.stopping = None;
        self.model.cells += 1;
        self.model.planning = false;
        self.model.by_hand = None;
        self.model.motion = Motion::Idle;
        let first = LinkState::first(&source);
        self.model.control = first.clone();
        self.model.camera = first.clone();
        self.model.mover = first;
        let connector = (self.connect)(&source, &self.model.objects);
        let captures = self.desk.captures();
        let stop = Arc::clone(self.workers.stop_line());
        match Workers::start(&source, &self.model.view, &connector, captures, &stop, &self.clock, &self.waker) {
            Ok(workers) => {
                let before = std::mem::replace(&mut self.workers, workers);
                // It waits for calls under way, which the window must not.
                let farewell = Builder::new().name("farewell".to_owned()).spawn(move || drop(before));
                if let Err(error) = farewell {
                    tracing::warn!(%error, "the connection before was left alone");
                }
            }
            Err(error) => {
                self.say(Severity::Error, text!("The connection could not be started: {error}", error = error));
            }
        }
        self.model.source = source;
        self.model.capture = None;
        self.model.track.board = BoardMotion::default();
        self.model.track.board_hidden = false;
        self.model.trail = Trail::default();
        self.model.scene_is_fitted = false;
        self.model.keep_out.standing = None;
        self.model.keep_out.unkept = None;
        self.send_target();
        self.send_keep_out();
        self.send_tracking();
    }

    /// The objects of the scene are others: everything that was read of them is, too.
    pub(crate) fn set_objects(&mut self, objects: CellPaths) {
        self.model.objects = objects;
        if matches!(self.model.source, CellSource::Address(_)) {
            self.connect(self.model.source.clone());
        }
    }

    pub(crate) fn cell_found(&mut self, facts: CellFacts) {
        let doubted = self.model.cell.as_ref().and_then(|before| before.arm_doubt);
        match facts.arm_doubt {
            Some(ArmDoubt::Foreign { distance_m, angle_rad }) => self.say(
                Severity::Warning,
                text!(
                    "By its joints the tip of the robot is {distance} mm and {angle}° from where its driver reports it, so its chain of joints is not used. Check arm and base_from_arm of the driver and the tool that is set on the controller, and connect again",
                    distance = format!("{:.1}", distance_m * 1e3),
                    angle = format!("{:.2}", angle_rad.to_degrees())
                ),
            ),
            None if doubted.is_some() && facts.arm.is_some() => self.say(
                Severity::Info,
                text!("Joints and poses of the robot agree: Calibrate for me can move it, once it is allowed to"),
            ),
            _ => {}
        }
        let is_foreign = matches!(facts.arm_doubt, Some(ArmDoubt::Foreign { .. }));
        let had_arm = self.model.cell.as_ref().is_some_and(|before| before.arm.is_some());
        self.model.scene_is_fitted &= had_arm == facts.arm.is_some();
        self.model.cell = Some(facts);
        // Poses that were chosen by that chain are not driven to, neither the one under way nor one that waits.
        if is_foreign && self.model.sequence.as_ref().is_some_and(|sequence| sequence.planned.is_some()) {
            self.stop_sequence();
        }
        // Where the arm is known it keeps out of boxes.
        self.send_keep_out();
        self.prepare_session();
        self.send_intrinsics();
    }

    /// Looks at all that there is, once it is known what that is.
    pub(crate) fn fit_scene(&mut self) {
        let is_there = self.model.robot.is_some() && self.model.cell.is_some();
        let is_recorded = !self.model.control.is_connected() && !self.model.document().captures.is_empty();
        if !self.model.scene_is_fitted
            && (is_there || is_recorded)
            && let Some(view) = crate::scene::fitted_view(&self.model)
        {
            self.model.scene = view;
            self.model.scene_is_fitted = true;
        }
    }

    pub(crate) fn link_changed(&mut self, link: Link, state: LinkState) {
        let before = match link {
            Link::Control => std::mem::replace(&mut self.model.control, state),
            Link::Camera => std::mem::replace(&mut self.model.camera, state),
            Link::Motion => std::mem::replace(&mut self.model.mover, state),
        };
        if link == Link::Motion && before.is_connected() {
            self.motion_lost();
        }
        match (self.model.link(link).clone(), before.is_connected()) {
            (LinkState::Connected { server, address }, false) => {
                let server = server_name(&self.model.source, &server);
                let text = match link {
                    Link::Control => {
                        text!("Robot connected to {server} at {address}", server = server, address = address)
                    }
                    Link::Camera => {
                        text!("Camera connected to {server} at {address}", server = server, address = address)
                    }
                    Link::Motion => return,
                };
                self.say(Severity::Info, text);
            }
            (LinkState::Lost { why, .. }, true) => {
                let text = match link {
                    Link::Control => text!("Robot connection lost: {why}", why = why),
                    Link::Camera => text!("Camera connection lost: {why}", why = why),
                    // Images and joints go on, so no card below the steps reports it.
                    Link::Motion => {
                        let said = text!("Connection for motions lost: {why}", why = why);
                        return self.say(Severity::Warning, said);
                    }
                };
                self.say_of_connection(Severity::Warning, text);
            }
            (LinkState::Failed { why }, _) if link != Link::Motion => {
                self.say_of_connection(Severity::Error, why);
            }
            _ => {}
        }
    }

    /// Lets a robot behind a driver be moved, or no longer.
    pub(crate) fn arm(&mut self, on: bool) {
        let asked = self.workers.ask_control(Request::Do(ControlTask::Arm(on)));
        self.expect(text!("The permission to move the robot was not changed"), asked);
    }

    /// Takes the pose that the pendant shows; `None` once the robot is moved on.
    pub(crate) fn type_pose(&mut self, pose: Option<Pose<Base, Tip>>) {
        let asked = self.workers.ask_control(Request::Do(ControlTask::TypePose(pose)));
        self.expect(text!("The pose was not taken"), asked);
    }

    /// A pose that was typed is that of one capture: the next one is from another place, and the old pose would be wrong.
    pub(crate) fn forget_typed_pose(&mut self) {
        if self.model.cell.as_ref().is_some_and(|cell| cell.poses_are_typed) {
            self.type_pose(None);
        }
    }

    /// A driver said something for people.
    pub(crate) fn heard(&mut self, severity: Severity, words: String) {
        let home = if severity == Severity::Error { Home::Toast } else { Home::Log };
        self.model.messages.say_at(home, severity, Text::verbatim(words), self.model.now_s);
    }

    /// Has a worker of the camera do something.
    pub(crate) fn ask_camera(&mut self, task: CameraTask, failure: handeye_wording::Text) -> bool {
        let asked = self.workers.ask_camera(Request::Do(task));
        let taken = asked.is_ok();
        self.expect(failure, asked);
        taken
    }
}

/// Puts it before the others, once.
fn put_first<T: PartialEq + Clone>(earlier: &mut Vec<T>, newest: &T) {
    earlier.retain(|other| other != newest);
    earlier.insert(0, newest.clone());
    earlier.truncate(ADDRESSES);
}
