//! Visiting the poses, with a capture at each.

use std::thread;
use std::time::{Duration, Instant};

use handeye_dataset::taught_poses::Goal;
use handeye_geometry::progress::CancelToken;
use handeye_link::{MotionOutcome, Newest, PortError};
use handeye_session::{CaptureId, Store};

use super::super::late::Late;
use super::super::open_cell::{OpenCell, port_failure};
use super::super::{Failure, record};
use super::poses::Plan;
use handeye_record::Recorder;
use handeye_workbench::capture::{self, CaptureEnd, CaptureRequest, Measured};
use handeye_workbench::model::{CaptureOptions, CapturePurpose, LiveFrame, RefusalKind};
use handeye_workbench::text::{Language, Text};

/// How often an interrupted operation at one pose is retried.
const TRIES: u32 = 3;
/// Pause before such a retry: a network comes back when the computer wakes up, and a dead server is reported within two
/// seconds.
const BEFORE_TRY: Duration = Duration::from_millis(400);
/// Between two checks of a paused simulation.
const LOOK: Duration = Duration::from_millis(100);

/// A sequence of the poses of a plan.
pub struct PoseSequence<'a> {
    pub cell: &'a mut OpenCell,
    pub plan: &'a Plan,
    pub options: CaptureOptions,
    /// Whether the simulation runs at its own pace.
    pub real_time: bool,
    pub session: &'a mut Store,
    pub recorder: &'a Recorder,
    pub cancel: &'a CancelToken,
    /// The clock of the images.
    pub began: Instant,
    pub images: Images,
}

/// Images so far.
#[derive(Debug, Default, Clone, Copy)]
pub struct Images {
    count: u64,
    /// Time of the last one \[s\].
    newest_s: Option<f64>,
}

/// The outcome of a pose.
enum Visit {
    Ended(CaptureEnd),
    LeftOut(Text),
}

/// Why work at a pose did not finish.
enum Trouble {
    Port(PortError),
    /// Another client holds the simulation.
    Held(Text),
    /// The simulation is paused.
    Paused,
    /// The motion failed.
    Failed(Text),
    Interrupted,
}

impl From<PortError> for Trouble {
    fn from(error: PortError) -> Self {
        match error {
            PortError::Held(why) => Self::Held(why),
            error => Self::Port(error),
        }
    }
}

impl From<Trouble> for Failure {
    fn from(trouble: Trouble) -> Self {
        match trouble {
            Trouble::Port(error) => port_failure(&error),
            Trouble::Held(why) | Trouble::Failed(why) => {
                Self::failed(anyhow::anyhow!("{}", why.in_language(Language::English)))
            }
            Trouble::Paused => Self::failed(anyhow::anyhow!("the simulation is paused")),
            Trouble::Interrupted => Self::failed(anyhow::anyhow!("interrupted")),
        }
    }
}

impl PoseSequence<'_> {
    /// Visits every pose and captures there. A pose that the arm cannot reach, or that gives no capture, is named and
    /// skipped; anything else ends the sequence.
    pub fn run(&mut self) -> Result<(), Failure> {
        let plan = self.plan;
        self.begin()?;
        for (index, (name, goal)) in plan.goals.iter().enumerate() {
            let number = index as u64 + 1;
            if self.visit(number, name, Some(goal), CapturePurpose::Calibrate)?.is_some() {
                tracing::info!("pose {number} of {} captured ({name})", plan.goals.len());
            }
        }
        if self.session.document().captures.is_empty() {
            let count = plan.goals.len();
            return Err(Failure::failed(anyhow::anyhow!(
                "none of the {count} poses gave a capture: see above why each was left out"
            )));
        }
        Ok(())
    }

    /// Starts the simulation and goes to the start of the plan.
    pub fn begin(&mut self) -> Result<(), Failure> {
        self.cell.set_going(!self.real_time).map_err(|error| port_failure(&error))?;
        let Some(start) = self.plan.start_joints.clone().map(Goal::Joints) else { return Ok(()) };
        let gone = self.persisting("the start", |sequence| sequence.go_to("the start", &start))?;
        gone.map_err(|why| {
            Failure::failed(anyhow::anyhow!("the arm does not go to the start: {}", why.in_language(Language::English)))
        })
    }

    /// Goes to a pose, if not at the arm's position, and captures there; the capture, recorded in the session. `None` for a
    /// pose that the arm cannot reach, or that gives no capture: the reason is in the log.
    pub fn visit(
        &mut self,
        number: u64,
        name: &str,
        goal: Option<&Goal>,
        purpose: CapturePurpose,
    ) -> Result<Option<(CaptureId, Box<Measured>)>, Failure> {
        let visit = self.persisting(&format!("pose {name:?}"), |sequence| {
            if let Some(goal) = goal
                && let Err(why) = sequence.go_to(&format!("pose {name:?}"), goal)?
            {
                return Ok(Visit::LeftOut(why));
            }
            let (options, document) = (sequence.options, sequence.session.document());
            let request = CaptureRequest::new(number, purpose, options, Some(name.to_owned()), document);
            let target = document.meta.target;
            let mut eye = Passes {
                cell: &mut *sequence.cell,
                cancel: sequence.cancel,
                began: sequence.began,
                images: &mut sequence.images,
                has_come_to_rest: goal.is_some(),
            };
            match capture::take(request, &target, &mut eye, sequence.cancel)? {
                // The next retry waits for the simulation, and takes the capture from the beginning.
                CaptureEnd::Refused(refused) if refused.kind == RefusalKind::Paused => Err(Trouble::Paused),
                ended => Ok(Visit::Ended(ended)),
            }
        })?;
        match visit {
            Visit::Ended(CaptureEnd::Good(measured, last)) => {
                let id = measured.record(self.session).map_err(Failure::failed)?;
                record::capture(self.recorder, *last, self.session);
                return Ok(Some((id, measured)));
            }
            Visit::Ended(CaptureEnd::Refused(refused)) if refused.kind.concerns_the_pose() => {
                tracing::warn!("pose {name:?} is left out: {}", refused.why.in_language(Language::English));
            }
            Visit::Ended(CaptureEnd::Refused(refused)) => {
                return Err(Failure::failed(anyhow::anyhow!("{}", refused.why.in_language(Language::English))));
            }
            Visit::LeftOut(why) => tracing::warn!("pose {name:?} is left out: {}", why.in_language(Language::English)),
        }
        Ok(None)
    }

    /// Whether the arm is there; or why it cannot go there, and others may be tried.
    fn go_to(&mut self, what: &str, goal: &Goal) -> Result<Result<(), Text>, Trouble> {
        match self.cell.move_to(what, goal, self.cancel)? {
            MotionOutcome::Arrived => Ok(Ok(())),
            // A driver that no longer moves its robot will not move it to the next pose, either.
            MotionOutcome::Refused(why) if !self.cell.is_simulated() && !self.is_armed() => Err(Trouble::Failed(why)),
            MotionOutcome::Refused(why) | MotionOutcome::Unreached(why) => Ok(Err(why)),
            MotionOutcome::Held(why) => Err(Trouble::Held(why)),
            MotionOutcome::Failed(why) => Err(Trouble::Failed(why)),
            MotionOutcome::Stopped if self.cancel.is_cancelled() => Err(Trouble::Interrupted),
            MotionOutcome::Stopped => Err(Trouble::Failed(handeye_wording::text!("The arm was stopped"))),
        }
    }

    fn is_armed(&mut self) -> bool {
        matches!(self.cell.control.state(), Ok(Some(state)) if state.is_armed)
    }

    /// Does something that can be retried in a simulation: a computer that slept is dropped by the server, and with it its
    /// stepping and the motion that was under way; the arm stays where it was. A robot behind a driver is not moved again
    /// automatically.
    fn persisting<T>(
        &mut self,
        what: &str,
        mut work: impl FnMut(&mut Self) -> Result<T, Trouble>,
    ) -> Result<T, Failure> {
        let mut tries = 0;
        let mut outcome = work(self);
        loop {
            let trouble = match outcome {
                Ok(done) => return Ok(done),
                Err(_) if self.cancel.is_cancelled() => return Err(Trouble::Interrupted.into()),
                Err(trouble) => trouble,
            };
            let may_pass = self.cell.is_simulated() && tries < TRIES;
            outcome = match trouble {
                Trouble::Paused | Trouble::Failed(_) if self.cell.is_paused() => {
                    self.wait_out_pause(what).and_then(|()| work(self))
                }
                Trouble::Port(error @ PortError::Lost(_)) if may_pass => {
                    tries += 1;
                    tracing::warn!(
                        "on the way to {what}: {}. If this computer was asleep, that is why; going on, try {tries} of {TRIES}",
                        error.why().in_language(Language::English)
                    );
                    thread::sleep(BEFORE_TRY);
                    self.take_up_again().and_then(|()| work(self))
                }
                // A client that was killed is dropped by the server within seconds, and with it what it holds.
                Trouble::Held(why) if may_pass => {
                    tries += 1;
                    let why = why.in_language(Language::English);
                    tracing::warn!("on the way to {what}: {why}. Trying once more, {tries} of {TRIES}");
                    self.take_up_again().and_then(|()| work(self))
                }
                trouble => return Err(trouble.into()),
            };
        }
    }

    /// Waits until the simulation is resumed. If it ends meanwhile, the next call notices.
    fn wait_out_pause(&mut self, what: &str) -> Result<(), Trouble> {
        tracing::warn!("on the way to {what}: the simulation is paused; this goes on when it does");
        while self.cell.is_paused() {
            if self.cancel.is_cancelled() {
                return Err(Trouble::Interrupted);
            }
            thread::sleep(LOOK);
        }
        Ok(())
    }

    fn take_up_again(&mut self) -> Result<(), Trouble> {
        self.cell.take_up_again().map_err(Trouble::from)
    }
}

/// The images of one pass after the other.
struct Passes<'a> {
    cell: &'a mut OpenCell,
    cancel: &'a CancelToken,
    began: Instant,
    images: &'a mut Images,
    /// The arm has just come to rest, and the images of that pass are available.
    has_come_to_rest: bool,
}

impl capture::Images for Passes<'_> {
    type Error = Trouble;

    fn now_s(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn next(&mut self) -> Result<LiveFrame, Trouble> {
        let mut late = Late::default();
        let raw = loop {
            if self.cancel.is_cancelled() {
                return Err(Trouble::Interrupted);
            }
            if !std::mem::take(&mut self.has_come_to_rest) {
                self.cell.pass(self.cancel)?;
            }
            match self.cell.camera.newest(self.images.newest_s)? {
                Newest::Frame(raw) => break raw,
                // Time is paused, which the capture has to notice.
                Newest::Same => self.images.newest_s = None,
                Newest::Awaited => late.waits(Instant::now())?,
            }
        };
        self.images.newest_s = Some(raw.sim_time_s);
        self.images.count += 1;
        Ok(record::live_frame(*raw, self.cell.camera.depth_limits_m(), self.images.count, self.now_s()))
    }
}
