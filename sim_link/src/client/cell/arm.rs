//! The arm: where it is, how to move it, how to stop it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use handeye_core::frames::{Base, Pose, Tip};

use super::hold::Hold;
use super::stream::clock_past;
use super::truth::{self, GroundTruth};
use super::{CellInfo, CellObjects, CellPaths, JOINTS, JointAngles, discover, read_joint_angles, require_running};
use crate::client::endpoint::Endpoint;
use crate::client::error::LinkError;
use crate::client::options::{CallOptions, ConnectionOptions};
use crate::client::sim::{JointMotion, MotionLimits, MotionState, MotionStatus, ObjectHandle, PoseMotion, Sim};
use handeye_core::progress::CancelToken;

/// Longest motion, in real time. The slowest sensible one takes a minute; a simulation may run slower than real time.
const LONGEST_MOTION: Duration = Duration::from_mins(10);

/// Passes in a row that have to be at rest: one alone may be the turning point of an oscillation.
const RESTING_PASSES: u32 = 3;

/// How long a pass that is under way may go on after a motion was cancelled: a pass takes a twentieth of a second, but
/// another client may hold the simulation for ever.
const BRAKE_GRACE: Duration = Duration::from_millis(300);

/// Longest time to come to rest, in real time. From the fastest motion of the reference tour it takes about two seconds.
const LONGEST_BRAKING: Duration = Duration::from_secs(10);

/// The built-in cell's function that brakes every motion.
const STOP_FUNCTION: &str = "handeye.stop";

/// How far from its goal a tip may stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionTolerance {
    /// Distance (m).
    pub distance_m: f64,
    /// Angle (rad).
    pub angle_rad: f64,
}

impl Default for MotionTolerance {
    /// Twice the precision to which the simulator's inverse kinematics works by default (1 mm, 0.5°).
    fn default() -> Self {
        Self { distance_m: 0.002, angle_rad: 1.0_f64.to_radians() }
    }
}

/// When an arm counts as standing still.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettleOptions {
    /// Fastest joint (rad/s) that counts as at rest.
    pub rate_rad_s: f64,
    /// Longest wait, in simulated time (s).
    pub limit_s: f64,
    /// Longest wait in real time, for a simulation whose time stands, runs backwards or hardly goes on.
    pub longest: Duration,
}

impl Default for SettleOptions {
    /// At 0.001 rad/s an arm of 1 m reach moves by 0.05 mm in a pass: less than a tenth of a pixel at working distance.
    /// Five seconds of a simulation at a twentieth of real time take less than two minutes.
    fn default() -> Self {
        Self { rate_rad_s: 1e-3, limit_s: 5.0, longest: Duration::from_mins(2) }
    }
}

/// The arm of a cell, over a connection of its own.
pub struct Arm {
    pub(super) sim: Sim,
    pub(super) objects: Arc<CellObjects>,
    pub(super) info: Arc<CellInfo>,
    pub(super) hold: Hold,
}

/// What differs between motions of joints and of the tip.
enum Motion {
    Joints(JointMotion),
    Pose(PoseMotion),
}

impl Motion {
    fn init(&self, sim: &mut Sim) -> Result<MotionState, LinkError> {
        match self {
            Self::Joints(motion) => sim.move_to_config_init(motion),
            Self::Pose(motion) => sim.move_to_pose_init(motion),
        }
    }

    fn step(&self, sim: &mut Sim, state: &mut MotionState) -> Result<MotionStatus, LinkError> {
        match self {
            Self::Joints(_) => sim.move_to_config_step(state),
            Self::Pose(_) => sim.move_to_pose_step(state),
        }
    }

    fn cleanup(&self, sim: &mut Sim, state: MotionState) -> Result<(), LinkError> {
        match self {
            Self::Joints(_) => sim.move_to_config_cleanup(state),
            Self::Pose(_) => sim.move_to_pose_cleanup(state),
        }
    }

    fn whole(&self, sim: &mut Sim, options: &CallOptions) -> Result<(), LinkError> {
        match self {
            Self::Joints(motion) => sim.move_to_config(motion, options),
            Self::Pose(motion) => sim.move_to_pose(motion, options),
        }
    }
}

impl Arm {
    pub(super) fn new(sim: Sim, objects: Arc<CellObjects>, info: Arc<CellInfo>) -> Self {
        Self { sim, objects, info, hold: Hold::default() }
    }

    /// Connects once, for an arm without its camera.
    ///
    /// # Errors
    /// As [`super::CellClient::connect`].
    pub fn connect(endpoint: &Endpoint, options: &ConnectionOptions, paths: &CellPaths) -> Result<Self, LinkError> {
        let (sim, objects, info) = discover(endpoint, options, paths)?;
        Ok(Self::new(sim, objects, info))
    }

    /// What is known about the cell.
    pub fn info(&self) -> &CellInfo {
        &self.info
    }

    /// The typed calls, for what has no method here: start, stop and step the simulation, write to its log.
    pub fn sim(&mut self) -> &mut Sim {
        &mut self.sim
    }

    /// Positions of the joints from the base up (rad).
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn joint_angles(&mut self) -> Result<JointAngles, LinkError> {
        read_joint_angles(&mut self.sim, &self.objects.joints)
    }

    /// The tip as the controller reports it: its pose in the world of the scene.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn base_from_tip(&mut self) -> Result<Pose<Base, Tip>, LinkError> {
        self.sim.get_object_pose(self.objects.tip, ObjectHandle::WORLD)
    }

    /// See [`super::CameraFeed::ground_truth`].
    ///
    /// # Errors
    /// As there.
    pub fn ground_truth(&mut self) -> Result<GroundTruth, LinkError> {
        truth::read(&mut self.sim, &self.objects, &self.info)
    }

    /// Moves the joints to `goal` (rad) within `limits` and returns when the motion is over; an arm with dynamic joints
    /// still follows for a moment, see [`Arm::settle`].
    ///
    /// # Errors
    /// [`LinkError::JointOutOfRange`] or [`LinkError::BadMotion`] before anything moves; [`LinkError::NotRunning`];
    /// [`LinkError::Cancelled`] with the arm stopped, [`LinkError::MotionStopped`] when it was another client that
    /// stopped it; [`LinkError::Unsupported`] before CoppeliaSim 4.7.
    pub fn move_to_joints(
        &mut self,
        goal: &JointAngles,
        limits: &MotionLimits,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        self.check_range(goal)?;
        self.drive(
            &Motion::Joints(JointMotion {
                joints: self.objects.joints.to_vec(),
                target_rad: goal.to_vec(),
                limits: limits.clone(),
            }),
            "moving the joints",
            cancel,
        )
    }

    /// Moves the tip to `goal` within `limits` (x, y, z, angle), waits until the arm stands still, and compares.
    ///
    /// # Errors
    /// As [`Arm::move_to_joints`]; [`LinkError::Unreached`] when the tip is elsewhere, [`LinkError::NotSettled`] when it
    /// does not come to rest, [`LinkError::NoSuchObject`] in a scene without a target dummy.
    pub fn move_to_pose(
        &mut self,
        goal: &Pose<Base, Tip>,
        limits: &MotionLimits,
        tolerance: &MotionTolerance,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        if !goal.is_finite() {
            let value = f64::NAN;
            return Err(LinkError::BadMotion { what: "the goal", expected: "a finite pose", value });
        }
        let Some(target) = self.objects.target else {
            let path = self.objects.target_path.clone();
            return Err(LinkError::NoSuchObject { path, what: "target dummy of motions" });
        };
        let motion = PoseMotion { tip: self.objects.tip, target, target_pose: *goal, limits: limits.clone() };
        self.drive(&Motion::Pose(motion), "moving the tip", cancel)?;
        self.settle(&SettleOptions::default(), cancel)?;
        let (distance_m, angle_rad) = self.base_from_tip()?.distance_to(goal);
        if distance_m <= tolerance.distance_m && angle_rad <= tolerance.angle_rad {
            return Ok(());
        }
        Err(LinkError::Unreached { distance_mm: distance_m * 1e3, angle_deg: angle_rad.to_degrees() })
    }

    /// Brings the arm to rest, whoever moves it: the built-in cell brakes every motion within its limits. CoppeliaSim has
    /// no such call; there every joint is told to stay where it is now.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call; the arm may then still move.
    pub fn stop(&mut self) -> Result<(), LinkError> {
        if self.brake()? {
            return Ok(());
        }
        for &joint in &self.objects.joints {
            let here_rad = self.sim.get_joint_position(joint)?;
            self.sim.set_joint_target_position(joint, here_rad)?;
        }
        Ok(())
    }

    /// Has the server brake every motion; `false` when it has no function for that.
    fn brake(&mut self) -> Result<bool, LinkError> {
        match self.sim.connection().call(STOP_FUNCTION, Vec::new()) {
            Ok(_nothing) => Ok(true),
            Err(error) if error.is_unknown_function() => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Waits until the arm stands still, and one complete pass longer, so that images show it so. Returns the simulated
    /// time that it took (s).
    ///
    /// # Errors
    /// [`LinkError::NotSettled`] after `options.limit_s` of simulated time; [`LinkError::WaitedTooLong`] after
    /// `options.longest` of real time; [`LinkError::NotRunning`]; [`LinkError::Cancelled`].
    pub fn settle(&mut self, options: &SettleOptions, cancel: &CancelToken) -> Result<f64, LinkError> {
        let task = "waiting for the arm to stand still";
        require_running(&mut self.sim, task)?;
        let call = CallOptions::cancelled_by(cancel);
        let started = Instant::now();
        let mut start_s = self.sim.get_simulation_time()?;
        let (mut before_s, mut before) = (start_s, self.joint_angles()?);
        let mut resting = 0;
        loop {
            self.sim.step(&call)?;
            let (now_s, now) = (self.sim.get_simulation_time()?, self.joint_angles()?);
            let has_advanced = now_s > before_s;
            let after = started.elapsed();
            if after > options.longest {
                let awaited = if has_advanced { "the joints to be at rest".to_owned() } else { clock_past(now_s) };
                return Err(LinkError::WaitedTooLong { task, awaited, after });
            }
            if !has_advanced {
                require_running(&mut self.sim, task)?;
                if now_s < before_s {
                    // The simulation was ended and started again.
                    (start_s, before_s, before, resting) = (now_s, now_s, now, 0);
                }
                continue;
            }
            let travel_rad = before.iter().zip(&now).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
            let rate_rad_s = travel_rad / (now_s - before_s);
            resting = if rate_rad_s <= options.rate_rad_s { resting + 1 } else { 0 };
            let after_s = now_s - start_s;
            if resting >= RESTING_PASSES {
                return Ok(after_s);
            }
            // A simulation that runs faster than it is asked may be past the limit and at rest for long.
            if resting == 0 && after_s > options.limit_s {
                return Err(LinkError::NotSettled { after_s, rate_deg_s: rate_rad_s.to_degrees() });
            }
            (before_s, before) = (now_s, now);
        }
    }

    fn check_range(&self, goal: &JointAngles) -> Result<(), LinkError> {
        for (index, (&goal_rad, interval)) in goal.iter().zip(&self.info.joint_intervals).enumerate() {
            if !goal_rad.is_finite() {
                let expected = "finite angles";
                return Err(LinkError::BadMotion { what: "the goal", expected, value: goal_rad });
            }
            // A millionth of a radian over the end is rounding, and clamping it moves nothing.
            let inside = (interval.min_rad - 1e-6..=interval.max_rad + 1e-6).contains(&goal_rad);
            if !interval.cyclic && !inside {
                return Err(LinkError::JointOutOfRange {
                    joint: index + 1,
                    goal_deg: goal_rad.to_degrees(),
                    min_deg: interval.min_rad.to_degrees(),
                    max_deg: interval.max_rad.to_degrees(),
                });
            }
        }
        Ok(())
    }

    fn drive(&mut self, motion: &Motion, task: &'static str, cancel: &CancelToken) -> Result<(), LinkError> {
        match motion {
            Motion::Joints(motion) => motion.limits.validate(JOINTS)?,
            Motion::Pose(motion) => motion.limits.validate(4)?,
        }
        require_running(&mut self.sim, task)?;
        if cancel.is_cancelled() {
            return Err(LinkError::Cancelled { call: task.to_owned() });
        }
        match motion.init(&mut self.sim) {
            Ok(state) => self.drive_stepwise(motion, state, task, cancel),
            Err(LinkError::Unsupported { .. }) => {
                let outcome = motion.whole(&mut self.sim, &CallOptions::long(LONGEST_MOTION, cancel));
                match outcome {
                    Err(LinkError::Cancelled { .. } | LinkError::Timeout { .. }) => self.stop().and(outcome),
                    outcome => outcome,
                }
            }
            Err(error) => Err(error),
        }
    }

    fn drive_stepwise(
        &mut self,
        motion: &Motion,
        mut state: MotionState,
        task: &'static str,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        let started = Instant::now();
        // A pass that is under way may end: then the motion is still there to be braked.
        let patient = CallOptions { grace: BRAKE_GRACE, ..CallOptions::cancelled_by(cancel) };
        let mut braking_since: Option<Instant> = None;
        let outcome = loop {
            if cancel.is_cancelled() && braking_since.is_none() {
                match self.brake() {
                    Ok(true) => braking_since = Some(Instant::now()),
                    Ok(false) => break Err(LinkError::Cancelled { call: task.to_owned() }),
                    Err(error) => break Err(error),
                }
            }
            if let Some(since) = braking_since.filter(|since| since.elapsed() > LONGEST_BRAKING) {
                let (awaited, after) = ("the arm to brake".to_owned(), since.elapsed());
                break Err(LinkError::WaitedTooLong { task, awaited, after });
            }
            if started.elapsed() > LONGEST_MOTION {
                let (awaited, after) = ("the arm to arrive".to_owned(), started.elapsed());
                break Err(LinkError::WaitedTooLong { task, awaited, after });
            }
            let call = if braking_since.is_some() { CallOptions::default() } else { patient.clone() };
            let stepped = motion.step(&mut self.sim, &mut state);
            // The commanded point takes effect in the pass that follows, also the last one.
            match stepped.and_then(|status| self.sim.step(&call).map(|()| status)) {
                Ok(MotionStatus::Running) => {}
                Ok(MotionStatus::Done) => break Ok(()),
                Ok(MotionStatus::Stopped) => {
                    motion.cleanup(&mut self.sim, state)?;
                    return Err(match braking_since {
                        Some(_) => LinkError::Cancelled { call: task.to_owned() },
                        None => LinkError::MotionStopped { task },
                    });
                }
                Err(error) => break Err(error),
            }
        };
        match &outcome {
            Ok(()) => motion.cleanup(&mut self.sim, state),
            // A server that has gone or hangs drives nothing any more, and asking it to tidy up only takes time.
            Err(LinkError::Disconnected { .. } | LinkError::Timeout { .. } | LinkError::Unreachable { .. }) => outcome,
            // The arm has to stand before the caller hears of it. If it cannot be told to, that is the worse news.
            Err(_) => self.stop().and(motion.cleanup(&mut self.sim, state)).and(outcome),
        }
    }
}
