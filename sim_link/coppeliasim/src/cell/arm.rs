//! The arm: where it is, how to move it, how to stop it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use handeye_arm::{JointKind, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;

use super::joint_elsewhere::joint_elsewhere;
use super::joints::{largest_change, of_rad, read_joint_values};
use super::objects::CellObjects;
use super::surroundings::Among;
use super::truth::{self, GroundTruth};
use super::{CellInfo, CellPaths, discover, require_running};
use crate::endpoint::Endpoint;
use crate::error::LinkError;
use crate::options::{CallOptions, ConnectionOptions};
use crate::sim::{ObjectHandle, Sim};

/// Passes in a row that have to be at rest: one alone may be the turning point of an oscillation.
const RESTING_PASSES: u32 = 3;

/// How far a kinematic joint is sent to make it take positions again \[rad\]: the simulator moves it only if it is more
/// than 0.01° away. A fifth of a millimetre at the reach of the arm.
const NUDGE_RAD: f64 = 0.02 * std::f64::consts::PI / 180.0;

/// How long that may take, in real time: a second at the limits that a joint has by default.
const LONGEST_NUDGE: Duration = Duration::from_secs(5);

/// The built-in cell's function that brakes every motion.
const STOP_FUNCTION: &str = "handeye.stop";

/// Largest distance of a tip from its goal after a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionTolerance {
    /// Distance, metres.
    pub distance_m: f64,
    /// Angle, radians.
    pub angle_rad: f64,
}

impl Default for MotionTolerance {
    /// Twice the precision to which the simulator's inverse kinematics works by default (1 mm, 0.5°).
    fn default() -> Self {
        Self { distance_m: 0.002, angle_rad: 1.0_f64.to_radians() }
    }
}

/// When an arm counts as at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettleOptions {
    /// Fastest joint (rad/s) that counts as at rest; one that shifts over [`super::RAD_PER_M`] of it (m/s).
    pub rate_rad_s: f64,
    /// Longest wait, in simulated time (s).
    pub limit_s: f64,
    /// Longest wait in real time, for a simulation whose time stops, runs backwards or hardly advances.
    pub longest: Duration,
}

impl Default for SettleOptions {
    /// At 0.001 rad/s an arm of 1 m reach moves by 0.05 mm in a pass: less than a tenth of a pixel at working distance.
    /// Five seconds of a simulation at a twentieth of real time take less than two minutes.
    fn default() -> Self {
        Self { rate_rad_s: 1e-3, limit_s: 5.0, longest: Duration::from_mins(2) }
    }
}

/// The arm of a cell, over its own connection.
pub struct Arm {
    pub(super) sim: Sim,
    pub(super) objects: Arc<CellObjects>,
    pub(super) info: Arc<CellInfo>,
    /// Obstacles that its motions avoid.
    pub(super) among: Option<Arc<Among>>,
}

impl Arm {
    pub(super) fn new(sim: Sim, objects: Arc<CellObjects>, info: Arc<CellInfo>) -> Self {
        Self { sim, objects, info, among: None }
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

    /// Positions of the joints from the base up (rad, or m of a prismatic joint).
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn joint_values(&mut self) -> Result<JointValues, LinkError> {
        read_joint_values(&mut self.sim, &self.objects)
    }

    /// How joint `index`, counted from 0, moves.
    pub(super) fn kind(&self, index: usize) -> JointKind {
        self.info.joints[index].kind
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
    /// As for [`super::CameraFeed::ground_truth`].
    pub fn ground_truth(&mut self) -> Result<GroundTruth, LinkError> {
        truth::read(&mut self.sim, &self.objects, &self.info)
    }

    /// Brings the arm to rest, whoever moves it: the built-in cell brakes every motion within its limits. CoppeliaSim has
    /// no such call; there a joint that a target position moves gets its present position as the target. A joint whose
    /// positions are set directly is at rest as soon as no client sets them, and is left alone.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call; the arm may then still move.
    pub fn stop(&mut self) -> Result<(), LinkError> {
        if self.brake()? {
            return Ok(());
        }
        for index in 0..self.objects.joints.len() {
            let joint = self.objects.joints[index];
            let here = self.sim.get_joint_position(joint)?;
            if self.sim.is_joint_dynamic(joint)? {
                self.sim.set_joint_target_position(joint, here)?;
            } else if !self.sim.set_joint_position(joint, here)? {
                self.nudge(index, here)?;
            }
        }
        Ok(())
    }

    /// Where the joints are, each of them ready to be moved.
    ///
    /// A kinematic joint that was sent to a target position refuses any other until it has been moved there, and one that
    /// was there already is never moved: a script, or a client that stopped it, leaves an arm that reports success
    /// without moving, until the simulation ends.
    ///
    /// # Errors
    /// [`LinkError::JointElsewhere`] for a joint that something else keeps moving.
    pub(super) fn movable_joints(&mut self) -> Result<JointValues, LinkError> {
        let started = Instant::now();
        let mut nudged_to = vec![None; self.objects.joints.len()];
        loop {
            let mut refuses = None;
            let here = self.joint_values()?;
            for index in 0..here.len() {
                let joint = self.objects.joints[index];
                if self.sim.is_joint_dynamic(joint)? || self.sim.set_joint_position(joint, here[index])? {
                    continue;
                }
                let goal = match nudged_to[index] {
                    Some(goal) => goal,
                    None => *nudged_to[index].insert(self.nudge(index, here[index])?),
                };
                refuses = Some((index, goal));
            }
            let Some((index, goal)) = refuses else { return Ok(here) };
            if started.elapsed() > LONGEST_NUDGE {
                return Err(joint_elsewhere(index, self.kind(index), here[index], goal));
            }
            self.sim.step(&CallOptions::default())?;
        }
    }

    /// Sends a kinematic joint a little towards the middle of its range, and returns where.
    fn nudge(&mut self, index: usize, here: f64) -> Result<f64, LinkError> {
        let joint = &self.info.joints[index];
        // The middle of a joint without end is not a number, and either way is good.
        let to_middle = if here > f64::midpoint(joint.range.min, joint.range.max) { -1.0 } else { 1.0 };
        let goal = here + to_middle * of_rad(joint.kind, NUDGE_RAD);
        self.sim.set_joint_target_position(self.objects.joints[index], goal)?;
        Ok(goal)
    }

    /// Has the server brake every motion; `false` when it has no function for that.
    pub(super) fn brake(&mut self) -> Result<bool, LinkError> {
        match self.sim.connection().call(STOP_FUNCTION, Vec::new()) {
            Ok(_nothing) => Ok(true),
            Err(error) if error.is_unknown_function() => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Waits until the arm is at rest, and one complete pass longer, so that images show it at rest. Returns the
    /// simulated time that it took (s).
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
        let (mut before_s, mut before) = (start_s, self.joint_values()?);
        let (mut resting, mut looks) = (0, 0);
        loop {
            self.sim.step(&call)?;
            let (now_s, now) = (self.sim.get_simulation_time()?, self.joint_values()?);
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
                    (start_s, before_s, before, resting, looks) = (now_s, now_s, now, 0, 0);
                }
                continue;
            }
            let (fastest, travel_rad) = largest_change(self.info.joint_kinds(), &before, &now);
            let rate_rad_s = travel_rad / (now_s - before_s);
            resting = if rate_rad_s <= options.rate_rad_s { resting + 1 } else { 0 };
            let after_s = now_s - start_s;
            if resting >= RESTING_PASSES {
                return Ok(after_s);
            }
            // A simulation that runs faster than it is polled may be past the limit at the first check, and at rest for
            // long.
            looks += 1;
            if resting == 0 && looks > RESTING_PASSES && after_s > options.limit_s {
                let kind = self.kind(fastest);
                return Err(LinkError::NotSettled { after_s, rate: kind.quantity(of_rad(kind, rate_rad_s)) });
            }
            (before_s, before) = (now_s, now);
        }
    }
}

/// What is waited for when simulated time does not advance.
pub(super) fn clock_past(now_s: f64) -> String {
    format!("simulated time to go on from {now_s:.3} s")
}
