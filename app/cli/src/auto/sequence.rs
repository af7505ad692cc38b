//! Visiting the poses, with a capture at each.

use std::thread;
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::{CellClient, CellInfo, MotionTolerance, SettleOptions};
use handeye_coppeliasim::{CallOptions, LinkError, SimulationState};
use handeye_dataset::taught_poses::Goal;
use handeye_geometry::progress::CancelToken;
use handeye_session::{CaptureId, Store};

use super::super::late::Late;
use super::super::{Failure, record};
use super::poses::Plan;
use handeye_link::limits;
use handeye_workbench::capture::{self, CaptureEnd, CaptureRequest, Images, Measured};
use handeye_workbench::model::{CaptureOptions, CapturePurpose, LiveFrame, RefusalKind};
use handeye_workbench::rerun_log::Recorder;
use handeye_workbench::text::Language;

/// How often a conversation that broke on the way to one pose is taken up again.
const TRIES: u32 = 3;
/// Pause before such a try: a network comes back when the computer wakes up, and a server that died is reported within
/// two seconds.
const BEFORE_TRY: Duration = Duration::from_millis(400);
/// Between two looks at a simulation that is paused.
const LOOK: Duration = Duration::from_millis(100);

/// A sequence of the poses of a plan.
pub struct PoseSequence<'a> {
    pub cell: &'a mut CellClient,
    pub plan: &'a Plan,
    pub options: CaptureOptions,
    /// Whether the simulation keeps its own pace.
    pub real_time: bool,
    pub session: &'a mut Store,
    pub recorder: &'a Recorder,
    pub cancel: &'a CancelToken,
    /// The clock of the images.
    pub began: Instant,
    /// Images so far.
    pub images: u64,
}

/// What came of a pose.
enum Visit {
    Ended(CaptureEnd),
    Unreached(LinkError),
}

impl PoseSequence<'_> {
    /// Visits every pose and captures there. A pose that the arm cannot reach, or that gives no capture, is named and
    /// left out; anything else ends the sequence.
    pub fn run(&mut self) -> Result<(), Failure> {
        let plan = self.plan;
        self.begin()?;
        for (index, (name, goal)) in plan.goals.iter().enumerate() {
            let number = index as u64 + 1;
            if self.visit(number, name, goal, CapturePurpose::Calibrate)?.is_some() {
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

    /// Starts the simulation and goes to where the plan begins.
    pub fn begin(&mut self) -> Result<(), Failure> {
        self.set_going().map_err(Failure::failed)?;
        match &self.plan.start_joints {
            Some(start) => self.persisting("the start", |sequence| sequence.move_to_joints(start)),
            None => Ok(()),
        }
    }

    /// Goes to a pose and captures there; the capture, recorded in the session. `None` for a pose that the arm cannot
    /// reach, or that gives no capture: why is in the log.
    pub fn visit(
        &mut self,
        number: u64,
        name: &str,
        goal: &Goal,
        purpose: CapturePurpose,
    ) -> Result<Option<(CaptureId, Box<Measured>)>, Failure> {
        let visit = self.persisting(&format!("pose {name:?}"), |sequence| {
            match sequence.go_to(goal) {
                Err(error @ (LinkError::Unreached { .. } | LinkError::InTheWay { .. })) => {
                    return Ok(Visit::Unreached(error));
                }
                arrived => arrived?,
            }
            let (options, document) = (sequence.options, sequence.session.document());
            let request = CaptureRequest::new(number, purpose, options, Some(name.to_owned()), document);
            let target = document.meta.target;
            let info = sequence.cell.info().clone();
            let mut eye = Passes {
                cell: &mut *sequence.cell,
                info,
                cancel: sequence.cancel,
                began: sequence.began,
                images: &mut sequence.images,
                first: true,
            };
            match capture::take(request, &target, &mut eye, sequence.cancel)? {
                // The next try waits for the simulation, and takes the capture from the beginning.
                CaptureEnd::Refused(refused) if refused.kind == RefusalKind::Paused => {
                    Err(LinkError::NotRunning { task: "a capture", state: SimulationState::Paused })
                }
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
                tracing::warn!("pose {name:?} is left out: {}", refused.why.say(Language::English));
            }
            Visit::Ended(CaptureEnd::Refused(refused)) => {
                return Err(Failure::failed(anyhow::anyhow!("{}", refused.why.say(Language::English))));
            }
            Visit::Unreached(error) => tracing::warn!("pose {name:?} is left out: {error}"),
        }
        Ok(None)
    }

    fn go_to(&mut self, goal: &Goal) -> Result<(), LinkError> {
        let Self { cell, plan, cancel, .. } = self;
        match goal {
            Goal::Tip(pose) => {
                let limits = limits::of_tip(&plan.limits, 1.0);
                cell.arm().move_to_pose(pose, &limits, &MotionTolerance::default(), cancel)
            }
            Goal::Joints(joints) => {
                self.move_to_joints(joints)?;
                // Waiting for the joints costs no images.
                self.cell.arm().settle(&SettleOptions::default(), self.cancel).map(drop)
            }
        }
    }

    fn move_to_joints(&mut self, joints: &[f64]) -> Result<(), LinkError> {
        let limits = limits::of_joints(&self.plan.limits, 1.0, self.cell.info().joint_kinds());
        self.cell.arm().move_to_joints(joints, &limits, self.cancel)
    }

    /// Stepped, a pass takes as long as it takes, and the same command gives the same images on every machine.
    fn set_going(&mut self) -> Result<(), LinkError> {
        let sim = self.cell.arm().sim();
        sim.set_stepping(!self.real_time)?;
        sim.start_simulation()
    }

    /// Does something that can be done again: a computer that slept is forgotten by the server, and with it its stepping
    /// and the motion that was under way; the arm stands where it was.
    fn persisting<T>(
        &mut self,
        what: &str,
        mut work: impl FnMut(&mut Self) -> Result<T, LinkError>,
    ) -> Result<T, Failure> {
        let mut tries = 0;
        let mut outcome = work(self);
        loop {
            outcome = match outcome {
                Err(LinkError::NotRunning { state: SimulationState::Paused, .. }) => {
                    self.wait_out_pause(what).and_then(|()| work(self))
                }
                Err(error) if is_forgotten(&error) && !self.cancel.is_cancelled() && tries < TRIES => {
                    tries += 1;
                    tracing::warn!(
                        "on the way to {what}: {error}. If this computer was asleep, that is why; going on, try {tries} \
                         of {TRIES}"
                    );
                    thread::sleep(BEFORE_TRY);
                    self.take_up_again().and_then(|()| work(self))
                }
                // A client that was killed is forgotten by the server within seconds, and with it what it holds.
                Err(error @ LinkError::Held { .. }) if !self.cancel.is_cancelled() && tries < TRIES => {
                    tries += 1;
                    tracing::warn!("on the way to {what}: {error}. Trying once more, {tries} of {TRIES}");
                    self.take_up_again().and_then(|()| work(self))
                }
                outcome => return outcome.map_err(Failure::failed),
            };
        }
    }

    /// Until somebody lets the simulation go on. One that is ended meanwhile is found out by what comes next.
    fn wait_out_pause(&mut self, what: &str) -> Result<(), LinkError> {
        tracing::warn!("on the way to {what}: the simulation is paused; this goes on when it does");
        while self.cell.arm().sim().get_simulation_state()? == SimulationState::Paused {
            if self.cancel.is_cancelled() {
                return Err(LinkError::Cancelled { call: "waiting for the simulation to go on".to_owned() });
            }
            thread::sleep(LOOK);
        }
        Ok(())
    }

    /// As new clients: what the server may still keep for these would only be in the way.
    fn take_up_again(&mut self) -> Result<(), LinkError> {
        self.cell.arm().sim().connection().renew();
        self.cell.camera().sim().connection().renew();
        self.set_going()
    }
}

/// Whether the server may no longer know this client, and everything else may be as it was.
fn is_forgotten(error: &LinkError) -> bool {
    matches!(
        error,
        LinkError::Forgotten { .. }
            | LinkError::Disconnected { .. }
            | LinkError::Timeout { .. }
            | LinkError::Unreachable { .. }
            | LinkError::OwnCellSilent { .. }
    )
}

/// The images of one pass after the other.
struct Passes<'a> {
    cell: &'a mut CellClient,
    info: CellInfo,
    cancel: &'a CancelToken,
    began: Instant,
    images: &'a mut u64,
    /// The arm has just come to rest, and the images of that pass are there.
    first: bool,
}

impl Images for Passes<'_> {
    type Error = LinkError;

    fn now_s(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn next(&mut self) -> Result<LiveFrame, LinkError> {
        let mut late = Late::default();
        let frame = loop {
            if !std::mem::take(&mut self.first) {
                self.cell.arm().sim().step(&CallOptions::cancelled_by(self.cancel))?;
            }
            if let Some(frame) = late.grabbed(self.cell.camera().grab(), Instant::now())? {
                break frame;
            }
        };
        *self.images += 1;
        Ok(record::live_frame(&self.info, *self.images, self.now_s(), frame))
    }
}
