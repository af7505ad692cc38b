//! All threads that are connected to a cell, and what the application asks of them.

use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, bounded, unbounded};
use handeye_coppeliasim::CancelToken;
use handeye_geometry::frames::{Camera as CameraFrame, Pose, Tip};
use handeye_plan::Surroundings;

use super::channels::{LatestSlot, Requests, Tap};
use super::link::{Duty, LinkLoop, Outlet, Request};
use super::reconnect::Reconnect;
use super::shared::{Busy, Clock, JOIN_DEADLINE, MAX_EVENTS, MAX_REQUESTS, POLL, Waker};
use super::started::Started;
use super::vision::{Vision, VisionSlots, VisionTask};
use crate::capture::Measured;
use crate::capture::state::LiveDetection;
use crate::command::Event;
use crate::connect::worker::{Control, ControlTask};
use crate::guided::state::GuideRequest;
use crate::live::state::LiveFrame;
use crate::live::worker::{Camera, CameraTask};
use crate::motion::desk::{MotionQueue, MotionTask};
use crate::motion::state::{MotionId, MotionRequest};
use crate::motion::stop_line::{Ends, StopLine};
use crate::motion::worker::{MotionLook, Motions};
use crate::shell::view::ViewSettings;
use crate::track::follow_line::FollowLine;
use crate::track::state::{FollowRequest, Tracked};
use crate::{connect, live, track};
use handeye_link::{Cell, CellSource, Jog, JogRequest, RobotState, ViewsRequest};

/// The application's side of the workers.
pub(crate) struct Workers {
    control: Requests<Request<ControlTask>>,
    camera: Requests<Request<CameraTask>>,
    motion: Requests<Request<MotionLook>>,
    vision: Requests<VisionTask>,
    /// Those of the control worker come last: that the arm was stopped is reported after what the stop ended.
    events: Option<[Receiver<Event>; 2]>,
    stop: Arc<StopLine>,
    desk: Arc<MotionQueue>,
    clock: Clock,
    robot: Arc<LatestSlot<Option<RobotState>>>,
    frames: Arc<LatestSlot<LiveFrame>>,
    detections: Arc<LatestSlot<LiveDetection>>,
    tracked: Arc<LatestSlot<Tracked>>,
    follow: Arc<FollowLine>,
    /// Kept until they end: a cell that it started ends with it.
    connector: Option<Arc<dyn Cell>>,
    shutdown: CancelToken,
    threads: Vec<Started>,
}

impl Workers {
    /// Starts the threads. What is captured goes to `captures`.
    ///
    /// # Errors
    /// When the system cannot start more threads.
    pub fn start(
        source: &CellSource,
        view: &ViewSettings,
        connector: &Arc<dyn Cell>,
        captures: Sender<Measured>,
        stop: &Arc<StopLine>,
        clock: &Clock,
        waker: &Waker,
    ) -> io::Result<Self> {
        let (event_sender, events) = bounded(MAX_EVENTS);
        // The thread that stops the arm never waits for the window.
        let (control_sender, control_events) = unbounded();
        let mut workers = Self::idle([events, control_events], stop, connector, clock, waker);
        let outlet_to = |events: &Sender<Event>| {
            let events = events.clone();
            Outlet { events, waker: Arc::clone(waker), clock: Arc::clone(clock) }
        };
        let outlet = || outlet_to(&event_sender);
        let duty = Control::new(source, Arc::clone(&workers.stop), Arc::clone(&workers.robot));
        workers.control = workers.spawn("control", duty, source, connector, outlet_to(&control_sender))?;
        let (tap, bell) = Tap::new();
        let tap = Arc::new(tap);
        let duty = Camera::new(view, Arc::clone(&workers.frames), Arc::clone(&tap));
        workers.camera = workers.spawn("camera", duty, source, connector, outlet())?;
        let duty = Motions::new(Arc::clone(&workers.desk), Arc::clone(&workers.follow));
        workers.motion = workers.spawn("motion", duty, source, connector, outlet())?;
        let (requests, tasks) = Requests::with_limit(MAX_REQUESTS);
        let sights = VisionSlots {
            detections: Arc::clone(&workers.detections),
            tracked: Arc::clone(&workers.tracked),
            follow: Arc::clone(&workers.follow),
        };
        let vision = Vision::new(tap, bell, tasks, sights, captures, outlet(), workers.shutdown.clone());
        workers.run("vision", move || vision.run())?;
        workers.vision = requests;
        workers.lead_stop();
        Ok(workers)
    }

    /// No threads yet.
    fn idle(
        events: [Receiver<Event>; 2],
        stop: &Arc<StopLine>,
        connector: &Arc<dyn Cell>,
        clock: &Clock,
        waker: &Waker,
    ) -> Self {
        Self {
            control: Requests::default(),
            camera: Requests::default(),
            motion: Requests::default(),
            vision: Requests::default(),
            events: Some(events),
            stop: Arc::clone(stop),
            desk: Arc::new(MotionQueue::new(Arc::clone(stop.grip()), Arc::clone(waker))),
            clock: Arc::clone(clock),
            robot: Arc::default(),
            frames: Arc::default(),
            detections: Arc::default(),
            tracked: Arc::default(),
            follow: Arc::default(),
            connector: Some(Arc::clone(connector)),
            shutdown: CancelToken::default(),
            threads: Vec::new(),
        }
    }

    /// From now on a stop reaches these threads.
    fn lead_stop(&self) {
        let (desk, control, clock) = (Arc::clone(&self.desk), self.control.clone(), Arc::clone(&self.clock));
        // Only to wake a resting worker: one that is too busy to take it looks at the line by itself.
        let wake_control = Box::new(move || {
            let _full = control.ask(Request::Do(ControlTask::CheckStop)).is_err();
        });
        self.stop.lead_to(Ends { desk, wake_control, clock });
    }

    fn spawn<D: Duty + 'static>(
        &mut self,
        name: &str,
        duty: D,
        source: &CellSource,
        connector: &Arc<dyn Cell>,
        outlet: Outlet,
    ) -> io::Result<Requests<Request<D::Task>>> {
        let (sender, requests) = Requests::with_limit(MAX_REQUESTS);
        let reconnect = Reconnect::new(source.clone());
        let connector = Arc::clone(connector);
        let shutdown = self.shutdown.clone();
        self.run(name, move || {
            LinkLoop { duty, connector: connector.as_ref(), requests, outlet, shutdown }.run(reconnect);
        })?;
        Ok(sender)
    }

    fn run(&mut self, name: &str, work: impl FnOnce() + Send + 'static) -> io::Result<()> {
        self.threads.push(Started::spawn(name, work)?);
        Ok(())
    }

    /// Hands over everything that was reported since the last time. Never waits for a worker.
    pub fn drain(&self, mut absorb: impl FnMut(Event)) {
        for events in self.events.iter().flatten() {
            events.try_iter().take(MAX_EVENTS).for_each(&mut absorb);
        }
        self.desk.take_messages().into_iter().map(Event::from).for_each(&mut absorb);
        if let Some((robot, _)) = self.robot.take() {
            absorb(robot.map_or(connect::Event::NoRobot, connect::Event::Robot).into());
        }
        if let Some((LiveFrame { info, images }, dropped)) = self.frames.take() {
            absorb(live::Event::Frame { info, dropped, images: Some(images) }.into());
        }
        if let Some((detection, _)) = self.detections.take() {
            absorb(live::Event::Detection(Box::new(detection)).into());
        }
        if let Some((tracked, _)) = self.tracked.take() {
            absorb(track::Event::Tracked(Arc::new(tracked)).into());
        }
        if let Some(status) = self.follow.take_status() {
            absorb(track::Event::Follow(status).into());
        }
    }

    /// Requests a stop. The request is never lost: it is carried out as soon as the arm can be reached, over the control
    /// worker's connection, whoever moves the arm. A motion or a jog of this program ends as well, and nothing is left
    /// that could begin afterwards.
    pub(crate) fn press_stop(&self) {
        self.stop.press();
    }

    /// The stop for the arm, for use by other threads.
    pub fn stop_line(&self) -> &Arc<StopLine> {
        &self.stop
    }

    /// Makes the arm keep out of these from its next motion on, also over the next connection.
    pub fn keep_out(&self, keep_out: Arc<Surroundings>) {
        self.desk.keep_out(keep_out);
    }

    /// Requests a motion. However it ends, [`Moved`](crate::motion::Event::Moved) is reported once, also when it is
    /// refused because something moves already.
    ///
    /// # Errors
    /// [`Busy`] when the program ends; then nothing is reported.
    pub fn move_to(&self, request: MotionRequest) -> Result<(), Busy> {
        self.begin(MotionTask::Move(request))
    }

    /// Requests one step of a jog at a share of the fastest speed: metres along a line or of a prismatic joint, radians about an
    /// axis or of a revolute joint. Reported as [`Self::move_to`].
    ///
    /// # Errors
    /// As [`Self::move_to`].
    pub fn jog_step(
        &self,
        id: MotionId,
        jog: Jog,
        length: f64,
        speed: f64,
        tip_from_camera: Option<Pose<Tip, CameraFrame>>,
    ) -> Result<(), Busy> {
        self.begin(MotionTask::JogStep { id, request: JogRequest { jog, tip_from_camera, speed }, length })
    }

    /// Makes the arm follow the tracked board, from a place where it has room if that is requested, to which it moves at a
    /// share of the fastest speed; until [`Self::cancel_motion`], a stop, or the board is lost. Reported as
    /// [`Self::move_to`]; why it ended by itself is the reason of a motion that failed.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    pub fn follow(&self, id: MotionId, requested: FollowRequest, speed: f64) -> Result<(), Busy> {
        self.begin(MotionTask::Follow { id, requested, speed })
    }

    /// Requests poses from which to look at the board. [`Planned`](crate::taught::Event::Planned) reports them;
    /// [`Moved`](crate::motion::Event::Moved), with the same number, why they are not planned.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    pub(crate) fn plan_views(&self, id: MotionId, request: ViewsRequest) -> Result<(), Busy> {
        self.begin(MotionTask::Plan { id, request: Box::new(request) })
    }

    /// Requests the next pose of a guided sequence. [`Chosen`](crate::guided::Event::Chosen) reports it;
    /// [`Moved`](crate::motion::Event::Moved), with the same number, why it is not chosen.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    pub fn guide(&self, id: MotionId, request: GuideRequest) -> Result<(), Busy> {
        self.begin(MotionTask::Guide { id, request: Box::new(request) })
    }

    /// Ends the motion that is under way, without a stop of everything else.
    pub(crate) fn cancel_motion(&self) {
        self.desk.cancel(self.now_s());
    }

    /// A jog button is held now: to be called when it is pressed, and repeatedly while it is held, or the arm stops by
    /// itself after [`HELD_S`]. [`JogEnded`](crate::motion::Event::JogEnded) reports that the arm is at rest: when the
    /// jog ends, and once more when a button is released that had been held for longer.
    pub(crate) fn hold_jog(&self, jog: Jog, speed: f64, tip_from_camera: Option<Pose<Tip, CameraFrame>>) {
        let request = JogRequest { jog, tip_from_camera, speed };
        if self.desk.hold(request, &self.stop, self.now_s()) {
            self.wake_motion();
        }
    }

    /// No jog button is held now.
    pub(crate) fn release_jog(&self) {
        self.desk.release();
    }

    fn begin(&self, task: MotionTask) -> Result<(), Busy> {
        if self.motion.is_closed() {
            return Err(Busy);
        }
        self.desk.ask(task, &self.stop);
        self.wake_motion();
        Ok(())
    }

    /// A worker that is too busy to be woken looks at the desk by itself.
    fn wake_motion(&self) {
        let woken = self.motion.ask(Request::Do(MotionLook));
        tracing::trace!(?woken, "the motion worker was told to look");
    }

    fn now_s(&self) -> f64 {
        (self.clock)()
    }

    /// Makes every worker without a connection try now.
    ///
    /// # Errors
    /// [`Busy`] when one does not take requests.
    pub fn reconnect(&self) -> Result<(), Busy> {
        self.connector.iter().for_each(|connector| connector.again());
        self.look_at_connection()
    }

    /// Makes the workers stop trying to connect until [`Self::reconnect`], if a try starts a program.
    ///
    /// # Errors
    /// As [`Self::reconnect`].
    pub(crate) fn stop_trying(&self) -> Result<(), Busy> {
        self.connector.iter().for_each(|connector| connector.rest());
        self.look_at_connection()
    }

    fn look_at_connection(&self) -> Result<(), Busy> {
        let motion = self.motion.ask(Request::Reconnect);
        self.ask_control(Request::Reconnect).and(self.ask_camera(Request::Reconnect)).and(motion)
    }

    /// Asks the control worker for something.
    ///
    /// # Errors
    /// [`Busy`] when it does not take requests.
    pub(crate) fn ask_control(&self, request: Request<ControlTask>) -> Result<(), Busy> {
        self.control.ask(request)
    }

    /// Asks the camera worker for something.
    ///
    /// # Errors
    /// [`Busy`] when it does not take requests.
    pub(crate) fn ask_camera(&self, request: Request<CameraTask>) -> Result<(), Busy> {
        self.camera.ask(request)
    }

    /// Asks the vision thread for something.
    ///
    /// # Errors
    /// [`Busy`] when it does not take requests.
    pub(crate) fn ask_vision(&self, task: VisionTask) -> Result<(), Busy> {
        self.vision.ask(task)
    }

    /// Whether this program moves the arm, or is about to.
    pub fn is_moving(&self) -> bool {
        self.desk.is_busy(self.now_s())
    }

    /// Waits until this program does not move the arm and a requested stop is done, but no longer than until `end`;
    /// whether that is reached. What is reported meanwhile is lost: for the end of the program.
    pub(crate) fn come_to_rest(&self, end: Instant) -> bool {
        loop {
            // A worker whose reports are not taken would wait, and the arm would keep moving.
            self.drain(|_lost| {});
            if !self.is_moving() && !self.stop.is_pressed() {
                return true;
            }
            let Some([events, _]) = self.events.as_ref().filter(|_| Instant::now() < end) else { return false };
            let _lost = events.recv_timeout(POLL).is_ok();
        }
    }

    /// Ends the threads: calls under way are cancelled, channels closed, threads joined. A thread that does not end
    /// within the deadline is abandoned, so that the program can end; returns how many there are.
    pub(crate) fn shut_down(&mut self, deadline: Duration) -> usize {
        self.shutdown.cancel();
        self.stop.lead_away_from(&self.desk);
        self.control.close();
        self.camera.close();
        self.motion.close();
        self.vision.close();
        self.events = None;
        self.connector = None;
        let end = Instant::now() + deadline;
        self.threads.drain(..).map(|thread| thread.join_until(end)).filter(|has_ended| !has_ended).count()
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        self.shut_down(JOIN_DEADLINE);
    }
}

#[cfg(test)]
#[path = "threads_live_tests.rs"]
mod live_tests;
#[cfg(test)]
#[path = "threads_motion_tests.rs"]
mod motion_tests;
#[cfg(test)]
#[path = "threads_tests.rs"]
mod tests;
