//! Motions of a tip by the inverse kinematics of the server, whole or step by step.

use ciborium::Value;
use handeye_geometry::frames::{Base, Pose, Tip};

use super::{ObjectHandle, Sim};
use crate::constants::{MOTION_DONE, MOTION_RUNNING, MOTION_STOPPED};
use crate::convert::seven_from_pose;
use crate::error::LinkError;
use crate::options::CallOptions;
use crate::returned::Returned;
use handeye_wire as wire;

const MOVE: &str = "sim.moveToPose";
const INIT: &str = "sim.moveToPose_init";
const STEP: &str = "sim.moveToPose_step";
const CLEANUP: &str = "sim.moveToPose_cleanup";

/// Limits of a motion, one number per joint (rad), or for a pose motion x, y, z (m) and angle (rad).
#[derive(Debug, Clone, PartialEq)]
pub struct MotionLimits {
    /// Largest speed, per second.
    pub velocity: Vec<f64>,
    /// Largest acceleration, per second².
    pub acceleration: Vec<f64>,
    /// Largest jerk, per second³.
    pub jerk: Vec<f64>,
}

impl MotionLimits {
    /// The same limits for each of `count` joints, in radians.
    pub fn uniform(count: usize, velocity: f64, acceleration: f64, jerk: f64) -> Self {
        Self { velocity: vec![velocity; count], acceleration: vec![acceleration; count], jerk: vec![jerk; count] }
    }

    /// Checks that there are `count` positive numbers of each kind.
    ///
    /// # Errors
    /// [`LinkError::BadMotion`].
    pub(crate) fn validate(&self, count: usize) -> Result<(), LinkError> {
        let kinds = [("velocity", &self.velocity), ("acceleration", &self.acceleration), ("jerk", &self.jerk)];
        for (what, values) in kinds {
            if values.len() != count {
                let expected = "one limit per joint, or four for a pose";
                return Err(LinkError::BadMotion { what, expected, value: values.len() as f64 });
            }
            if let Some(&value) = values.iter().find(|v| !(v.is_finite() && **v > 0.0)) {
                return Err(LinkError::BadMotion { what, expected: "a positive number", value });
            }
        }
        Ok(())
    }

    fn entries(&self) -> [(&'static str, Value); 3] {
        [
            ("maxVel", wire::floats(self.velocity.iter().copied())),
            ("maxAccel", wire::floats(self.acceleration.iter().copied())),
            ("maxJerk", wire::floats(self.jerk.iter().copied())),
        ]
    }
}

/// A motion of a tip to a pose of the world, by inverse kinematics.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseMotion {
    /// The dummy at the end of the kinematic chain.
    pub tip: ObjectHandle,
    /// The dummy that the tip follows; it is moved.
    pub target: ObjectHandle,
    /// Goal of the tip, in the world.
    pub target_pose: Pose<Base, Tip>,
    /// Limits for x, y, z and angle.
    pub limits: MotionLimits,
}

impl PoseMotion {
    fn to_value(&self) -> Value {
        let [vel, accel, jerk] = self.limits.entries();
        let ik = wire::map([("tip", self.tip.to_value()), ("target", self.target.to_value())]);
        // No `metric`: together with `ik` it fails in every server from 4.7 to 4.10.
        wire::map([("ik", ik), ("targetPose", wire::floats(seven_from_pose(&self.target_pose))), vel, accel, jerk])
    }
}

/// A motion under way, as the server wrote it down; goes back and forth unread.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionState(Value);

/// Where a motion is after a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionStatus {
    /// Not there.
    Running,
    /// At its goal.
    Done,
    /// At rest before its goal, because it was stopped.
    Stopped,
}

impl Sim {
    /// Moves a tip to a pose of the world. The simulator does not report when its inverse kinematics fails: compare the
    /// tip with the goal afterwards.
    ///
    /// # Errors
    /// [`LinkError::BadMotion`] for invalid limits; otherwise as for any call.
    pub(crate) fn move_to_pose(&mut self, motion: &PoseMotion, options: &CallOptions) -> Result<(), LinkError> {
        self.motion_call(MOVE, motion, options).map(drop)
    }

    /// Prepares [`Sim::move_to_pose`] to be done step by step.
    ///
    /// # Errors
    /// [`LinkError::BadMotion`] for invalid limits; otherwise as for any call.
    pub(crate) fn move_to_pose_init(&mut self, motion: &PoseMotion) -> Result<MotionState, LinkError> {
        self.motion_call(INIT, motion, &CallOptions::default())?.into_map(0).map(MotionState)
    }

    /// Commands the next point of the motion; it takes effect with the next pass, see [`Sim::step`].
    ///
    /// # Errors
    /// [`LinkError::MotionFailed`] when the motion generator gives up, [`LinkError::Forgotten`] when the server has
    /// forgotten it.
    pub(crate) fn move_to_pose_step(&mut self, state: &mut MotionState) -> Result<MotionStatus, LinkError> {
        let reply = self.call(STEP, vec![state.0.clone()]).map_err(LinkError::of_motion_step)?;
        let code = reply.integer(0)?;
        state.0 = reply.into_map(1)?;
        match code {
            MOTION_RUNNING => Ok(MotionStatus::Running),
            MOTION_DONE => Ok(MotionStatus::Done),
            MOTION_STOPPED => Ok(MotionStatus::Stopped),
            code => Err(LinkError::MotionFailed { call: STEP.to_owned(), code }),
        }
    }

    /// Frees what the server keeps for the motion.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn move_to_pose_cleanup(&mut self, state: MotionState) -> Result<(), LinkError> {
        self.call(CLEANUP, vec![state.0]).map(drop)
    }

    fn motion_call(&mut self, func: &str, motion: &PoseMotion, options: &CallOptions) -> Result<Returned, LinkError> {
        motion.limits.validate(4)?;
        self.call_with(func, vec![motion.to_value()], options)
    }
}
