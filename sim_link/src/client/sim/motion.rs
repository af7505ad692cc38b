//! Motions along time-optimal profiles, whole or step by step.

use ciborium::Value;
use handeye_core::frames::{Base, Pose, Tip};

use super::{ObjectHandle, Sim};
use crate::client::constants::{MOTION_DONE, MOTION_RUNNING, MOTION_STOPPED};
use crate::client::convert::seven_from_pose;
use crate::client::error::LinkError;
use crate::client::options::CallOptions;
use crate::client::protocol::ProtocolVersion;
use crate::wire;

/// The version that has motions with a map of parameters.
const NEEDS: &str = "CoppeliaSim 4.7 or newer";

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
    pub fn validate(&self, count: usize) -> Result<(), LinkError> {
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

/// A motion of joints to a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct JointMotion {
    /// The joints.
    pub joints: Vec<ObjectHandle>,
    /// Where each goes (rad).
    pub target_rad: Vec<f64>,
    /// Limits per joint.
    pub limits: MotionLimits,
}

impl JointMotion {
    fn to_value(&self) -> Value {
        let [vel, accel, jerk] = self.limits.entries();
        let joints = wire::integers(self.joints.iter().map(|joint| joint.0));
        let target = wire::floats(self.target_rad.iter().copied());
        wire::map([("joints", joints), ("targetPos", target), vel, accel, jerk])
    }
}

/// A motion of a tip to a pose of the world, by inverse kinematics.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseMotion {
    /// The dummy at the end of the kinematic chain.
    pub tip: ObjectHandle,
    /// The dummy that the tip follows; it is moved.
    pub target: ObjectHandle,
    /// Where the tip goes, in the world.
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
    /// At rest before its goal, because somebody stopped it.
    Stopped,
}

/// The two kinds of motions of the API.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Config,
    Pose,
}

impl Kind {
    fn name(self, part: &str) -> String {
        match self {
            Self::Config => format!("sim.moveToConfig{part}"),
            Self::Pose => format!("sim.moveToPose{part}"),
        }
    }
}

impl Sim {
    /// Moves joints to a configuration; returns when the motion generator is there. Joints with a dynamic controller
    /// may still follow.
    ///
    /// # Errors
    /// [`LinkError::Unsupported`] before CoppeliaSim 4.7.
    pub fn move_to_config(&mut self, motion: &JointMotion, options: &CallOptions) -> Result<(), LinkError> {
        motion.limits.validate(motion.joints.len())?;
        self.motion_call(&Kind::Config.name(""), motion.to_value(), options).map(drop)
    }

    /// Prepares [`Sim::move_to_config`] to be done step by step.
    ///
    /// # Errors
    /// [`LinkError::Unsupported`] before CoppeliaSim 4.7.
    pub fn move_to_config_init(&mut self, motion: &JointMotion) -> Result<MotionState, LinkError> {
        motion.limits.validate(motion.joints.len())?;
        self.motion_init(Kind::Config, motion.to_value())
    }

    /// Commands the next point of the motion; it takes effect with the next pass, see [`Sim::step`].
    ///
    /// # Errors
    /// [`LinkError::MotionFailed`] when the motion generator gives up, [`LinkError::MotionForgotten`] when the server has
    /// forgotten it.
    pub fn move_to_config_step(&mut self, state: &mut MotionState) -> Result<MotionStatus, LinkError> {
        self.motion_step(Kind::Config, state)
    }

    /// Frees what the server keeps for the motion.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn move_to_config_cleanup(&mut self, state: MotionState) -> Result<(), LinkError> {
        self.call(&Kind::Config.name("_cleanup"), vec![state.0]).map(drop)
    }

    /// Moves a tip to a pose of the world. The simulator does not say when its inverse kinematics fails: compare the
    /// tip with the goal afterwards.
    ///
    /// # Errors
    /// [`LinkError::Unsupported`] before CoppeliaSim 4.7.
    pub fn move_to_pose(&mut self, motion: &PoseMotion, options: &CallOptions) -> Result<(), LinkError> {
        motion.limits.validate(4)?;
        self.motion_call(&Kind::Pose.name(""), motion.to_value(), options).map(drop)
    }

    /// Prepares [`Sim::move_to_pose`] to be done step by step.
    ///
    /// # Errors
    /// [`LinkError::Unsupported`] before CoppeliaSim 4.7.
    pub fn move_to_pose_init(&mut self, motion: &PoseMotion) -> Result<MotionState, LinkError> {
        motion.limits.validate(4)?;
        self.motion_init(Kind::Pose, motion.to_value())
    }

    /// As [`Sim::move_to_config_step`].
    ///
    /// # Errors
    /// As [`Sim::move_to_config_step`].
    pub fn move_to_pose_step(&mut self, state: &mut MotionState) -> Result<MotionStatus, LinkError> {
        self.motion_step(Kind::Pose, state)
    }

    /// As [`Sim::move_to_config_cleanup`].
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn move_to_pose_cleanup(&mut self, state: MotionState) -> Result<(), LinkError> {
        self.call(&Kind::Pose.name("_cleanup"), vec![state.0]).map(drop)
    }

    fn motion_init(&mut self, kind: Kind, params: Value) -> Result<MotionState, LinkError> {
        let reply = self.motion_call(&kind.name("_init"), params, &CallOptions::default())?;
        reply.into_map(0).map(MotionState)
    }

    fn motion_step(&mut self, kind: Kind, state: &mut MotionState) -> Result<MotionStatus, LinkError> {
        let call = kind.name("_step");
        let reply = self.call(&call, vec![state.0.clone()]).map_err(LinkError::of_motion_step)?;
        let code = reply.integer(0)?;
        state.0 = reply.into_map(1)?;
        match code {
            MOTION_RUNNING => Ok(MotionStatus::Running),
            MOTION_DONE => Ok(MotionStatus::Done),
            MOTION_STOPPED => Ok(MotionStatus::Stopped),
            code => Err(LinkError::MotionFailed { call, code }),
        }
    }

    /// In version 1 of the protocol motions were part of the vendor's clients, not of the server.
    fn motion_call(
        &mut self,
        func: &str,
        params: Value,
        options: &CallOptions,
    ) -> Result<crate::client::Returned, LinkError> {
        let unsupported = || LinkError::Unsupported { call: func.to_owned(), needs: NEEDS };
        if self.connection.version() == Some(ProtocolVersion::V1) {
            return Err(unsupported());
        }
        self.call_with(func, vec![params], options)
            .map_err(|error| if error.is_unknown_function() { unsupported() } else { error })
    }
}
