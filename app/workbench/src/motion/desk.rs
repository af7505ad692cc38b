//! What the arm is requested to do. There is one slot, not a queue: what arrives while the arm moves is refused with a
//! reason, and a stop leaves nothing that could begin later.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use handeye_coppeliasim::CancelToken;
use handeye_plan::Surroundings;

use super::command::Event;
use super::grip::{Grip, SILENCE};
use super::jog_line::{Held, JogLine};
use crate::guided::state::GuideRequest;
use crate::motion::state::{MotionId, MotionRequest};
use crate::motion::stop_line::StopLine;
use crate::text::Text;
use crate::track::state::FollowRequest;
use crate::worker::shared::Waker;
use handeye_link::{JogRequest, ViewsRequest};
use handeye_link::{MotionGoal, MotionOutcome};
use handeye_wording::text;

/// A motion with an end.
#[derive(Debug, Clone, PartialEq)]
pub enum MotionTask {
    /// To a place.
    Move(MotionRequest),
    JogStep {
        /// Its number.
        id: MotionId,
        /// Which way, and how fast.
        request: JogRequest,
        /// How far: metres for translations and prismatic joints, radians for rotations and revolute joints.
        length: f64,
    },
    /// After the board, until it is cancelled.
    Follow {
        /// Its number.
        id: MotionId,
        /// What is wanted.
        requested: FollowRequest,
        /// Share of the fastest speed at which it moves to where it has room.
        speed: f64,
    },
    /// Nothing that moves: the next pose of a guided sequence.
    Guide {
        /// Its number.
        id: MotionId,
        /// What is wanted.
        request: Box<GuideRequest>,
    },
    /// Nothing that moves: where the board can be seen from, which only the arm's kinematics determines.
    Plan {
        /// Its number.
        id: MotionId,
        /// What is wanted.
        request: Box<ViewsRequest>,
    },
}

impl MotionTask {
    /// Its number.
    pub(crate) fn id(&self) -> MotionId {
        match self {
            Self::Move(request) => request.id,
            Self::JogStep { id, .. } | Self::Follow { id, .. } | Self::Plan { id, .. } | Self::Guide { id, .. } => *id,
        }
    }

    fn what(&self) -> Text {
        match self {
            Self::Move(MotionRequest { goal: MotionGoal::Joints(_), .. }) => text!("a motion of the joints"),
            Self::Move(MotionRequest { goal: MotionGoal::Tip(_), .. }) => text!("a motion of the tip"),
            Self::JogStep { .. } => text!("a step"),
            Self::Follow { .. } => text!("following the board"),
            Self::Plan { .. } | Self::Guide { .. } => text!("planning of poses"),
        }
    }
}

/// What the worker has to do next.
#[derive(Debug)]
pub enum Work {
    Nothing,
    /// A motion, which the token cancels.
    Motion(MotionTask, CancelToken),
    /// A button is held.
    Jog(JogRequest),
}

#[derive(Debug, Default)]
enum Doing {
    #[default]
    Nothing,
    Asked(MotionTask),
    Moving {
        what: Text,
        cancel: CancelToken,
    },
    Jogging,
}

#[derive(Default)]
struct Inner {
    connected: bool,
    doing: Doing,
    line: JogLine,
    /// A stop came while a button was held.
    jog_stopped: bool,
    /// A button was held since the window was last notified that the arm is at rest.
    owes_end: bool,
    /// What the window has to be notified of from here.
    reported: Vec<Event>,
    /// What the user keeps the arm out of.
    keep_out: Arc<Surroundings>,
    /// The same while the connection has not received it.
    owed_keep_out: Option<Arc<Surroundings>>,
}

/// Shared by the application and the motion worker.
pub struct MotionQueue {
    inner: Mutex<Inner>,
    grip: Arc<Grip>,
    waker: Waker,
}

impl MotionQueue {
    /// Nothing is requested; `grip` knows whether what the window takes for held is held, and `waker` notifies the
    /// window that something was refused.
    pub fn new(grip: Arc<Grip>, waker: Waker) -> Self {
        Self { inner: Mutex::default(), grip, waker }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks for a motion. A refusal is reported as the end of the motion.
    pub fn ask(&self, task: MotionTask, stop: &StopLine) {
        let mut inner = self.inner();
        // Checked here and not before: a stop that comes now cancels what is begun here.
        match inner.obstacle(stop.is_barred()) {
            None => inner.doing = Doing::Asked(task),
            Some(why) => {
                let outcome = MotionOutcome::Refused(why);
                inner.say(Event::Moved { id: task.id(), outcome }, &self.waker);
            }
        }
    }

    /// A jog button is held now. `true` when the worker has something to begin.
    pub(crate) fn hold(&self, request: JogRequest, stop: &StopLine, now_s: f64) -> bool {
        let mut inner = self.inner();
        inner.owes_end = true;
        // The window does not know yet that it was released.
        if !self.grip.is_firm(Instant::now()) {
            return false;
        }
        let stopping = stop.is_barred();
        if !inner.line.hold(request, now_s) || matches!(inner.doing, Doing::Jogging) && !stopping {
            return false;
        }
        let obstacle = inner.obstacle(stopping);
        let begins = obstacle.is_none();
        if let Some(why) = obstacle {
            inner.line.bar(now_s);
            inner.say(Event::JogEnded { why: Some(why) }, &self.waker);
        }
        begins
    }

    /// No jog button is held now.
    pub(crate) fn release(&self) {
        let mut inner = self.inner();
        inner.line.release();
        // Pressed and released before the worker looked, or held for too long to count.
        if inner.owes_end && !matches!(inner.doing, Doing::Jogging) {
            inner.say(Event::JogEnded { why: None }, &self.waker);
        }
    }

    /// What the arm should keep out of, from its next motion on and over every connection.
    pub(crate) fn keep_out(&self, keep_out: Arc<Surroundings>) {
        let mut inner = self.inner();
        inner.owed_keep_out = Some(Arc::clone(&keep_out));
        inner.keep_out = keep_out;
    }

    /// The same for the worker, once for each change and for each connection.
    pub(crate) fn take_keep_out(&self) -> Option<Arc<Surroundings>> {
        self.inner().owed_keep_out.take()
    }

    /// Cancels the motion and clears the next one.
    pub(crate) fn cancel(&self, now_s: f64) {
        let mut inner = self.inner();
        let is_held = inner.bar_held(now_s);
        match &inner.doing {
            Doing::Moving { cancel, .. } => cancel.cancel(),
            Doing::Jogging => inner.jog_stopped |= is_held,
            Doing::Asked(task) => {
                let id = task.id();
                inner.doing = Doing::Nothing;
                inner.say(Event::Moved { id, outcome: MotionOutcome::Stopped }, &self.waker);
            }
            Doing::Nothing if is_held => inner.say(Event::JogEnded { why: Some(stopped()) }, &self.waker),
            Doing::Nothing => {}
        }
    }

    /// Whether the arm is moved from here, or about to be.
    pub(crate) fn is_busy(&self, now_s: f64) -> bool {
        let mut inner = self.inner();
        !matches!(inner.doing, Doing::Nothing) || inner.connected && inner.line.request(now_s).is_some()
    }

    /// Hands over what the window has not received.
    pub(crate) fn take_messages(&self) -> Vec<Event> {
        std::mem::take(&mut self.inner().reported)
    }

    /// The worker has a connection.
    pub fn connected(&self) {
        let mut inner = self.inner();
        inner.connected = true;
        inner.owed_keep_out = Some(Arc::clone(&inner.keep_out));
    }

    /// The worker has none now. What it had not begun is refused.
    pub(crate) fn disconnected(&self, now_s: f64) {
        let mut inner = self.inner();
        inner.connected = false;
        let is_held = inner.bar_held(now_s);
        match std::mem::take(&mut inner.doing) {
            Doing::Asked(task) => {
                let outcome = MotionOutcome::Refused(no_connection());
                inner.say(Event::Moved { id: task.id(), outcome }, &self.waker);
            }
            Doing::Nothing if is_held => inner.say(Event::JogEnded { why: Some(no_connection()) }, &self.waker),
            _ => {}
        }
    }

    /// Takes the request; the worker carries it out and then calls [`Self::done`].
    pub fn take(&self, now_s: f64) -> Work {
        let mut inner = self.inner();
        match std::mem::take(&mut inner.doing) {
            Doing::Asked(task) => {
                let cancel = CancelToken::default();
                inner.doing = Doing::Moving { what: task.what(), cancel: cancel.clone() };
                Work::Motion(task, cancel)
            }
            _ => match inner.line.request(now_s).filter(|_| self.grip.is_firm(Instant::now())) {
                Some(request) => {
                    inner.doing = Doing::Jogging;
                    inner.jog_stopped = false;
                    Work::Jog(request)
                }
                None => Work::Nothing,
            },
        }
    }

    /// The motion or the jog is over.
    pub(crate) fn done(&self) {
        self.inner().doing = Doing::Nothing;
    }

    /// Whether a jog is still held.
    pub(crate) fn is_held(&self, request: &JogRequest, now_s: f64) -> Held {
        let now = Instant::now();
        if self.grip.is_firm(now) {
            return self.inner().line.is_held(request.jog, now_s);
        }
        if self.grip.is_silent(now) { Held::Forgotten { after_s: SILENCE.as_secs_f64() } } else { Held::Released }
    }

    /// A jog is over: `why` is what ended it, if that was not its button, and `forgotten` after how long \[s\] without a
    /// report from the button. `None` when another button is held already, which continues without a report.
    pub(crate) fn end_jog(
        &self,
        request: &JogRequest,
        why: Option<Text>,
        forgotten: Option<f64>,
        now_s: f64,
    ) -> Option<Event> {
        let mut inner = self.inner();
        inner.doing = Doing::Nothing;
        let why = match why {
            Some(why) => Some(why),
            None if std::mem::take(&mut inner.jog_stopped) => Some(stopped()),
            None => forgotten.map(forgotten_for),
        };
        inner.line.bar_jog(request.jog, now_s);
        let goes_on = why.is_none() && inner.line.request(now_s).is_some();
        inner.owes_end &= goes_on;
        (!goes_on).then_some(Event::JogEnded { why })
    }
}

impl Inner {
    /// Makes the held button do nothing more; `false` when none is held.
    fn bar_held(&mut self, now_s: f64) -> bool {
        let is_held = self.line.request(now_s).is_some();
        if is_held {
            self.line.bar(now_s);
        }
        is_held
    }

    /// Why nothing can begin now.
    fn obstacle(&self, stopping: bool) -> Option<Text> {
        if stopping {
            return Some(text!("The arm is being stopped"));
        }
        if !self.connected {
            return Some(no_connection());
        }
        match &self.doing {
            Doing::Nothing => None,
            Doing::Asked(task) => Some(still_moving(task.what())),
            Doing::Moving { what, .. } => Some(still_moving(what.clone())),
            Doing::Jogging => Some(text!("The arm is being jogged")),
        }
    }

    fn say(&mut self, event: Event, waker: &Waker) {
        self.owes_end &= !matches!(event, Event::JogEnded { .. });
        self.reported.push(event);
        waker();
    }
}

fn still_moving(what: Text) -> Text {
    text!("{what} is still under way", what = what)
}

fn no_connection() -> Text {
    text!("There is no connection that moves the arm")
}

fn stopped() -> Text {
    text!("The arm was stopped")
}

fn forgotten_for(after_s: f64) -> Text {
    text!("The arm was stopped: no signal from the jog button for {seconds} s", seconds = after_s)
}

#[cfg(test)]
#[path = "desk_tests.rs"]
mod tests;
