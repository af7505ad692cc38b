//! A cell with its connections open, for a command that does one thing after the other.

use std::sync::Arc;
use std::time::{Duration, Instant};

use handeye_arm::{JointKind, JointValues};
use handeye_coppeliasim::cell::{ArmKinematics, BoardInView, FollowEnd};
use handeye_dataset::taught_poses::{Goal, MotionLimits};
use handeye_driver::{LogLevel, Place, RestWatch};
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_link::{
    ArmDoubt, CameraPort, Cell, CellFacts, CellSource, ControlPort, MotionGoal, MotionOutcome, MotionPort, Moves,
    PortError, RemoteCell, RobotState, Simulation, ViewsRequest, moved_text,
};
use handeye_plan::Surroundings;
use handeye_plan::guided::choose::Robot;
use handeye_server::{CellConfig, CellServer};
use handeye_workbench::model::FollowRequest;
use handeye_workbench::text::Language;
use handeye_workbench::track::follow::follow;
use handeye_workbench::worker::FollowLine;

use crate::Failure;
use crate::cell_choice::CellChoice;
use crate::driver::python;

/// How long a robot behind a driver may take to report its pose, and to be identified by its joints.
const FIRST_STATE: Duration = Duration::from_secs(5);
/// Between two checks while waiting.
const LOOK: Duration = Duration::from_millis(20);
/// How long a robot that was commanded to stop may take to come to rest, as in the window.
const TO_REST: Duration = Duration::from_secs(2);

/// A cell and its connections. Motions go through [`Self::move_to`] only, which logs them and moves no robot behind a driver
/// without permission.
pub struct OpenCell {
    cell: Arc<dyn Cell>,
    pub control: Box<dyn ControlPort>,
    pub camera: Box<dyn CameraPort>,
    motion: Box<dyn MotionPort>,
    pub facts: CellFacts,
    /// Whether simulated time is stepped.
    is_stepped: bool,
    speed: f64,
    /// Motions so far.
    motions: u64,
}

/// As a failure of a command.
pub fn port_failure(error: &PortError) -> Failure {
    Failure::failed(anyhow::anyhow!("{}", error.why().in_language(Language::English)))
}

impl OpenCell {
    /// Connects to the chosen cell, or starts the built-in one with `own` if none was chosen.
    ///
    /// # Errors
    /// When it cannot be reached or started, or its robot does not report where it is.
    pub fn connect(choice: &CellChoice, own: CellConfig, cancel: &CancelToken) -> Result<Self, Failure> {
        let paths = choice.paths(&own.scene.robot.name);
        let cell: Arc<dyn Cell> = match choice.source()? {
            Some(source @ (CellSource::Address(_) | CellSource::Drivers(_))) => {
                if let CellSource::Drivers(drivers) = &source {
                    // Here, where its progress is visible and nothing waits for an answer.
                    for command in [&drivers.robot, &drivers.camera].into_iter().flatten() {
                        if let Ok(spec) = command.parse() {
                            python::prepare(&spec)?;
                        }
                    }
                }
                source.cell(&paths)
            }
            Some(CellSource::BuiltIn(_)) | None => {
                Arc::new(RemoteCell::own(CellServer::start(own).map_err(Failure::failed)?, paths))
            }
        };
        Self::over(cell, choice.driver.is_some(), choice.speed(), cancel)
    }

    fn over(cell: Arc<dyn Cell>, is_driven: bool, speed: f64, cancel: &CancelToken) -> Result<Self, Failure> {
        let failed = |error: PortError| port_failure(&error);
        // Connections outlive Ctrl-C: the arm has to be stopped over them. Only drivers, which may take long, are not waited for.
        let shutdown = if is_driven { cancel.clone() } else { CancelToken::default() };
        let mut control = cell.control(&shutdown).map_err(failed)?.port;
        let camera = cell.camera(&shutdown).map_err(failed)?.port;
        let motion = cell.motion(&shutdown).map_err(failed)?.port;
        let facts = first_facts(control.as_mut(), cancel)?;
        let (is_stepped, motions) = (false, 0);
        Ok(Self { cell, control, camera, motion, facts, is_stepped, speed, motions })
    }

    /// Whether it is a simulation, which may always be moved.
    pub fn is_simulated(&self) -> bool {
        self.facts.moves == Moves::Freely
    }

    /// The same cell over connections of its own, for another thread.
    ///
    /// # Errors
    /// When they cannot be made.
    pub fn another(&self, cancel: &CancelToken) -> Result<Self, Failure> {
        Self::over(Arc::clone(&self.cell), !self.is_simulated(), self.speed, cancel)
    }

    /// From now on at most at this share of its fastest speed.
    pub fn go_no_faster_than(&mut self, share: f64) {
        self.speed = self.speed.min(share);
    }

    /// Makes a simulated arm do what is requested about the tracked board; see [`follow`].
    ///
    /// # Errors
    /// When the connection is lost.
    pub fn follow(
        &mut self,
        line: &FollowLine,
        requested: FollowRequest,
        cancel: &CancelToken,
    ) -> Result<Result<FollowEnd, MotionOutcome>, Failure> {
        let mut makes_room = || {
            tracing::info!(
                "here the arm has no room to follow the board: it moves to the nearest place where it has, and keeps the \
                 view from there"
            );
        };
        let followed = follow(self.motion.as_mut(), line, requested, self.speed, cancel, &mut makes_room);
        followed.map_err(|error| port_failure(&error))
    }

    /// Allows motions of the robot: a simulated one, or one for which that was requested on the command line.
    ///
    /// # Errors
    /// When it may not be moved.
    pub fn allow_motion(&mut self, is_allowed: bool) -> Result<(), Failure> {
        match self.facts.moves {
            Moves::Freely => Ok(()),
            Moves::Never => Err(Failure::failed(anyhow::anyhow!("this cell has no robot that could be moved"))),
            Moves::OnceArmed { .. } if !is_allowed => Err(Failure::unusable(anyhow::anyhow!(
                "this moves a robot behind a driver, which is only read so far: look at what it would do with --dry-run, keep \
                 its emergency stop at hand, and give --allow-motion"
            ))),
            Moves::OnceArmed { .. } => self.control.arm(true).map_err(|error| port_failure(&error)),
        }
    }

    /// Where the robot is now.
    ///
    /// # Errors
    /// When it does not report it.
    pub fn robot_state(&mut self) -> Result<RobotState, Failure> {
        let state = self.control.state().map_err(|error| port_failure(&error))?;
        state.ok_or_else(|| Failure::failed(anyhow::anyhow!("the robot does not report where it is")))
    }

    /// The arm as guided capture drives it from its position; or why it cannot.
    ///
    /// # Errors
    /// When the connection is lost.
    pub fn robot(&mut self) -> Result<Result<Robot, Failure>, Failure> {
        let robot = self.motion.robot(self.speed).map_err(|error| port_failure(&error))?;
        Ok(robot.map_err(|why| Failure::failed(anyhow::anyhow!("{}", why.in_language(Language::English)))))
    }

    /// Views of a board, from the arm's position; or why there are none.
    ///
    /// # Errors
    /// When the connection is lost.
    pub fn views(
        &mut self,
        board: &BoardInView,
        count: usize,
        seed: u64,
    ) -> Result<Result<Vec<JointValues>, Failure>, Failure> {
        let request = ViewsRequest { board: *board, taken: Vec::new(), count, seed };
        let views = self.motion.views(&request).map_err(|error| port_failure(&error))?;
        Ok(views.map_err(|why| Failure::failed(anyhow::anyhow!("{}", why.in_language(Language::English)))))
    }

    /// Where a simulated cell has its board: from its ground truth if it publishes that, and else from its scene; `None` if
    /// neither has it.
    ///
    /// # Errors
    /// When the connection is lost.
    pub fn base_from_target(&mut self, target: &TargetSpec) -> Result<Option<Pose<Base, Target>>, Failure> {
        match self.facts.truth.as_ref().and_then(|truth| truth.base_from_target) {
            Some(published) => Ok(Some(published)),
            None => self.control.base_from_board(target).map_err(|error| port_failure(&error)),
        }
    }

    /// The chain of the arm, if it is known.
    pub fn kinematics(&self) -> Option<&ArmKinematics> {
        self.facts.arm.as_ref()
    }

    /// Plans for the arm with this chain from now on; to be called before the keep-out boxes are set.
    pub fn plan_by(&mut self, kinematics: ArmKinematics) {
        self.motion.plan_by(&kinematics);
        self.facts.arm = Some(kinematics);
    }

    /// Makes the arm keep out of these from now on.
    ///
    /// # Errors
    /// When that is not possible because the chain of the arm is not known.
    pub fn keep_out(&mut self, keep_out: &Surroundings) -> Result<(), Failure> {
        self.motion.keep_out(keep_out).map_err(|why| {
            Failure::failed(anyhow::anyhow!(
                "--keep-out needs an arm whose chain is known, to know what it would touch (docs/reference/arms.md): {}",
                why.in_language(Language::English)
            ))
        })?;
        Ok(())
    }

    /// The limits of a simulated arm from now on.
    pub fn limit(&mut self, limits: &MotionLimits) {
        self.motion.limit(limits);
    }

    /// Starts the simulation. If stepped, a pass may take any time, and the same command gives the same images on every
    /// machine.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn set_going(&mut self, is_stepped: bool) -> Result<(), PortError> {
        self.is_stepped = is_stepped;
        if !self.is_simulated() {
            return Ok(());
        }
        self.motion.step_by_step(is_stepped)?;
        self.control.start_simulation()
    }

    /// Lets a stepped simulation advance to its next pass.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn pass(&mut self, cancel: &CancelToken) -> Result<(), PortError> {
        self.motion.pass(cancel)
    }

    /// Resumes what was interrupted, as new clients of the same server.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn take_up_again(&mut self) -> Result<(), PortError> {
        self.control.renew()?;
        self.camera.renew()?;
        self.motion.renew()?;
        self.set_going(self.is_stepped)
    }

    /// Moves the robot, and logs it.
    ///
    /// # Errors
    /// [`PortError`]; everything else is an outcome.
    pub fn move_to(&mut self, what: &str, goal: &Goal, cancel: &CancelToken) -> Result<MotionOutcome, PortError> {
        self.motions += 1;
        let (number, place) = (self.motions, self.described(goal));
        let speed = self.speed * 100.0;
        self.log(&format!("motion {number}, to {what}: {place}, at {speed:.0} % of its speed"));
        let goal = match goal {
            Goal::Tip(pose) => MotionGoal::Tip(*pose),
            Goal::Joints(values) => match JointValues::try_from(&values[..]) {
                Ok(joints) => MotionGoal::Joints(joints),
                Err(error) => return Ok(MotionOutcome::Refused(error.into())),
            },
        };
        let outcome = self.motion.move_to(&goal, self.speed, cancel);
        let ended = match &outcome {
            Ok(MotionOutcome::Arrived) => "arrived".to_owned(),
            Ok(MotionOutcome::Stopped) => "stopped".to_owned(),
            Ok(outcome) => outcome.why().map_or_else(String::new, |why| why.in_language(Language::English)),
            Err(error) => error.why().in_language(Language::English),
        };
        self.log(&format!("motion {number}: {ended}"));
        self.tell_what_is_heard();
        outcome
    }

    /// Motions of a real robot are always printed; simulated ones are only logged.
    fn log(&self, line: &str) {
        if self.is_simulated() {
            tracing::debug!("{line}");
        } else {
            tracing::info!("{line}");
        }
    }

    fn tell_what_is_heard(&mut self) {
        for (level, words) in self.control.heard() {
            match level {
                LogLevel::Error | LogLevel::Warn => tracing::warn!("{words}"),
                LogLevel::Info => tracing::info!("{words}"),
                LogLevel::Debug => tracing::debug!("{words}"),
            }
        }
    }

    /// A goal in numbers with units.
    pub fn described(&self, goal: &Goal) -> String {
        match goal {
            Goal::Joints(joints) => {
                let kind = |i: usize| self.facts.joints.get(i).map_or(JointKind::Revolute, |joint| joint.kind);
                let values: Vec<String> =
                    joints.iter().enumerate().map(|(i, value)| format!("{:.1}", kind(i).quantity(*value))).collect();
                format!("joints {}", values.join(" "))
            }
            Goal::Tip(pose) => {
                let at = pose.translation() * 1e3;
                let turned = pose.rotation().scaled_axis().map(f64::to_degrees);
                format!(
                    "tip at {:.1} {:.1} {:.1} mm, turned about {:.1} {:.1} {:.1}°",
                    at.x, at.y, at.z, turned.x, turned.y, turned.z
                )
            }
        }
    }

    /// Whether another client has paused the simulation.
    pub fn is_paused(&mut self) -> bool {
        matches!(self.control.state(), Ok(Some(state)) if state.simulation == Simulation::Paused)
    }

    /// Leaves the robot where it is, whatever happened before, and the simulation as it was: it ends with `ends_simulation`. A
    /// robot behind a driver is commanded to stop if it was `interrupted`, whether it is at rest is reported, and it may not be
    /// moved any longer.
    pub fn leave(&mut self, interrupted: bool, ends_simulation: bool) {
        if !self.is_simulated() {
            if interrupted {
                self.stop_and_watch();
            }
            if let Err(error) = self.control.arm(false) {
                tracing::debug!(?error, "the driver could not be told that it may no longer move the robot");
            }
            return self.tell_what_is_heard();
        }
        let left = self.control.stop().and_then(|()| self.motion.step_by_step(false));
        let ended = left.and_then(|()| if ends_simulation { self.control.stop_simulation() } else { Ok(()) });
        if let Err(error) = ended {
            tracing::warn!("the simulation could not be stopped: {}", error.why().in_language(Language::English));
        }
    }

    /// As STOP in the window: the reported states of the robot count.
    fn stop_and_watch(&mut self) {
        if let Err(error) = self.control.stop() {
            let why = error.why().in_language(Language::English);
            tracing::error!("the robot may still move, the stop failed: {why}. Use its own emergency stop");
            return;
        }
        let (until, mut watch) = (Instant::now() + TO_REST, RestWatch::default());
        while Instant::now() < until {
            if let Ok(Some(state)) = self.control.state() {
                let joints = Some(state.joints_rad).filter(|joints| !joints.is_empty());
                let place = Place { stamp_s: state.sim_time_s, joints, base_from_tip: state.base_from_tip };
                let is_news = watch.newest().is_none_or(|newest| newest.stamp_s != place.stamp_s);
                if is_news && watch.take(place) {
                    tracing::info!("the robot was told to stop, and stands");
                    return;
                }
            }
            std::thread::sleep(LOOK);
        }
        let Some(moved) = watch.moved() else {
            return tracing::error!(
                "the robot was told to stop, and no state has come since: it is not known whether it stands. Look at it"
            );
        };
        let kind = |joint: usize| self.facts.joints.get(joint).map(|joint| joint.kind);
        let moved = moved_text(&moved, kind).in_language(Language::English);
        tracing::error!("the robot was told to stop and still moves: {moved} since. Use its own emergency stop");
    }
}

/// What the cell reports about itself, once its robot has reported. A chain of joints that a driver names is given a
/// moment to be placed.
fn first_facts(control: &mut dyn ControlPort, cancel: &CancelToken) -> Result<CellFacts, Failure> {
    let failed = |error: PortError| port_failure(&error);
    let until = Instant::now() + FIRST_STATE;
    while control.state().map_err(failed)?.is_none() {
        if Instant::now() > until || cancel.is_cancelled() {
            let seconds = FIRST_STATE.as_secs();
            return Err(Failure::failed(anyhow::anyhow!("the robot has not reported where it is for {seconds} s")));
        }
        std::thread::sleep(LOOK);
    }
    let mut facts = control.facts().map_err(failed)?;
    let settled = Instant::now() + Duration::from_secs(1);
    while facts.arm_doubt == Some(ArmDoubt::Open) && Instant::now() < settled && !cancel.is_cancelled() {
        std::thread::sleep(LOOK);
        facts = control.facts().map_err(failed)?;
    }
    Ok(facts)
}
