//! The motion worker: moves the arm, one motion at a time, and reports how it ended.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use handeye_coppeliasim::CancelToken;
use handeye_coppeliasim::cell::FollowEnd;
use handeye_plan::guided::choose::Robot;

use super::desk::{MotionQueue, MotionTask, Work};
use super::jog_line::Held;
use crate::connect::state::Link;
use crate::guided::state::{Choice, GuideRequest};
use crate::messages::state::Severity;
use crate::motion::state::MotionId;
use crate::text::Text;
use crate::track::follow::follow;
use crate::track::follow_line::FollowLine;
use crate::track::state::{FollowRequest, FollowStatus};
use crate::worker::link::{Duty, Outlet};
use crate::{guided, keep_out, motion, taught, track};
use handeye_link::MotionOutcome;
use handeye_link::{Cell, Connected, JogRequest, MotionPort, PortError, ViewsRequest, end_of_following};
use handeye_wording::text;

/// Pause between two looks at the connection. Work does not wait for it: the worker is woken.
const PERIOD: Duration = Duration::from_millis(100);

/// Look at the [`MotionQueue`] now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MotionLook;

/// The job of the motion worker.
pub struct Motions {
    desk: Arc<MotionQueue>,
    line: Arc<FollowLine>,
}

impl Motions {
    /// With the slots where it receives its requests, and where the board is.
    pub fn new(desk: Arc<MotionQueue>, line: Arc<FollowLine>) -> Self {
        Self { desk, line }
    }

    fn run(
        &self,
        port: &mut dyn MotionPort,
        task: &MotionTask,
        cancel: &CancelToken,
        outlet: &Outlet,
    ) -> Result<(), PortError> {
        let outcome = match task {
            MotionTask::Move(request) => match request.goal() {
                Ok(goal) => port.move_to(&goal, request.speed, cancel),
                Err(why) => Ok(MotionOutcome::Refused(why)),
            },
            MotionTask::JogStep { request, length, .. } => port.jog_step(request, *length, cancel),
            MotionTask::Follow { requested, speed, .. } => self.follow(port, *requested, *speed, cancel, outlet),
            MotionTask::Guide { id, request } => return self.guide(port, *id, request, cancel, outlet),
            MotionTask::Plan { id, request } => return self.plan(port, *id, request, outlet),
        };
        // First, so that what the window asks for next is not refused.
        self.desk.done();
        let (reported, ended) = match outcome {
            Ok(outcome) => (outcome, Ok(())),
            // Nobody sends the arm any further. What may still move is left to the stop.
            Err(error) if cancel.is_cancelled() => (MotionOutcome::Stopped, Err(error)),
            Err(error) => {
                (MotionOutcome::Failed(text!("The connection broke: {error}", error = error.why().clone())), Err(error))
            }
        };
        outlet.report(motion::Event::Moved { id: task.id(), outcome: reported });
        ended
    }

    fn plan(
        &self,
        port: &mut dyn MotionPort,
        id: MotionId,
        request: &ViewsRequest,
        outlet: &Outlet,
    ) -> Result<(), PortError> {
        let planned = port.views(request);
        self.desk.done();
        let (views, ended) = match planned {
            Ok(views) => (views, Ok(())),
            Err(error) => (Err(text!("The connection broke: {error}", error = error.why().clone())), Err(error)),
        };
        outlet.report(taught::Event::Planned { id, views });
        ended
    }

    fn guide(
        &self,
        port: &mut dyn MotionPort,
        id: MotionId,
        request: &GuideRequest,
        cancel: &CancelToken,
        outlet: &Outlet,
    ) -> Result<(), PortError> {
        let (outcome, ended) = match port.robot(request.speed) {
            Ok(robot) => (robot.and_then(|robot| chosen(request, &robot, cancel)), Ok(())),
            Err(error) => (Err(text!("The connection broke: {error}", error = error.why().clone())), Err(error)),
        };
        self.desk.done();
        outlet.report(guided::Event::Chosen { id, outcome });
        ended
    }

    fn follow(
        &self,
        port: &mut dyn MotionPort,
        requested: FollowRequest,
        speed: f64,
        cancel: &CancelToken,
        outlet: &Outlet,
    ) -> Result<MotionOutcome, PortError> {
        let mut makes_room = || {
            outlet.report(track::Event::Follow(FollowStatus::MakingRoom));
            outlet.notice(
                Severity::Info,
                text!(
                    "Here the arm has no room to follow the board: it moves to the nearest place where it has, and keeps the view from there"
                ),
            );
        };
        let followed = follow(port, &self.line, requested, speed, cancel, &mut makes_room)?;
        Ok(match (followed, self.line.take_ended()) {
            (Err(outcome), _) => outcome,
            (Ok(FollowEnd::Released | FollowEnd::Stopped), Some(why)) if !cancel.is_cancelled() => {
                MotionOutcome::Failed(why)
            }
            (Ok(FollowEnd::Released | FollowEnd::Stopped), _) => MotionOutcome::Stopped,
            (Ok(obstacle), _) => MotionOutcome::Failed(end_of_following(&obstacle)),
        })
    }

    fn jog(&self, port: &mut dyn MotionPort, request: &JogRequest, outlet: &Outlet) -> Result<(), PortError> {
        let mut forgotten = None;
        let mut held = || match self.desk.is_held(request, outlet.now_s()) {
            Held::Yes(speed) => Some(speed),
            Held::Released => None,
            Held::Forgotten { after_s } => {
                forgotten = Some(after_s);
                None
            }
        };
        let outcome = port.jog(request, &mut held);
        let (why, ended) = match outcome {
            Ok(why) => (why, Ok(())),
            Err(error) => (Some(text!("The connection broke: {error}", error = error.why().clone())), Err(error)),
        };
        if let Some(event) = self.desk.end_jog(request, why, forgotten, outlet.now_s()) {
            outlet.report(event);
        }
        ended
    }

    /// Before anything moves, and after a motion was taken: a wish made before the motion applies to it.
    fn keep_out(&self, port: &mut dyn MotionPort, outlet: &Outlet) {
        let Some(keep_out) = self.desk.take_keep_out() else { return };
        outlet.report(keep_out::Event::Standing(port.keep_out(&keep_out).map(Arc::new)));
    }

    fn work(&self, port: &mut dyn MotionPort, outlet: &Outlet) -> Result<Duration, PortError> {
        let work = self.desk.take(outlet.now_s());
        self.keep_out(port, outlet);
        match work {
            Work::Motion(task, cancel) => self.run(port, &task, &cancel, outlet)?,
            Work::Jog(request) => self.jog(port, &request, outlet)?,
            Work::Nothing => {
                port.check()?;
                return Ok(PERIOD);
            }
        }
        Ok(Duration::ZERO)
    }
}

impl Duty for Motions {
    type Port = Box<dyn MotionPort>;
    type Task = MotionLook;
    const LINK: Link = Link::Motion;

    fn connect(&mut self, connector: &dyn Cell, shutdown: &CancelToken) -> Result<Connected<Self::Port>, PortError> {
        let connected = connector.motion(shutdown)?;
        self.desk.connected();
        Ok(connected)
    }

    fn turn(&mut self, port: &mut Self::Port, outlet: &Outlet) -> Result<Duration, PortError> {
        let worked = self.work(port.as_mut(), outlet);
        if worked.is_err() {
            self.desk.disconnected(outlet.now_s());
        }
        worked
    }

    /// The next turn looks at it.
    fn perform(
        &mut self,
        _port: Option<&mut Self::Port>,
        _look: MotionLook,
        _outlet: &Outlet,
    ) -> Result<(), PortError> {
        Ok(())
    }
}

/// A bug in the choice must not end the thread that moves the arm.
fn chosen(request: &GuideRequest, robot: &Robot, cancel: &CancelToken) -> Result<Box<Choice>, Text> {
    let chosen = catch_unwind(AssertUnwindSafe(|| request.choose(robot, cancel)));
    chosen.map(Box::new).map_err(|_panic| text!("The choice of a pose failed by a defect of this program: report it"))
}
