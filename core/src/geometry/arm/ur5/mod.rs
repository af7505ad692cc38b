//! The UR5 as CoppeliaSim models it, with its joints counted by the type: six values in, six out, and nothing to check.
//!
//! Lengths in metres, angles in radians. The *arm* frame is the `/UR5` object, 14.65 mm above the mounting plane; the
//! *connection* is the force sensor at the end of the arm, where a tool or a `Tip` dummy is attached. At all joints
//! zero the arm stands straight up, tool towards −x of the arm.
//!
//! The geometry is that of the model, fitted to it without residual; it is **not** the table that the manufacturer
//! publishes, from which the connection differs by 7 mm on average, mostly in the last link.
//!
//! Everything is computed by the [`Arm`] of [`ArmKind::Ur5Coppeliasim`]: arm frame and
//! connection are its base and its tip.

use std::sync::LazyLock;

use nalgebra::Isometry3;

use super::{Arm, ArmKind, JointRange};

pub use super::inverse::{DlsOptions, IkError, Obstacle};

/// Number of joints.
pub const JOINTS: usize = 6;

/// Values of the six joints from the base to the wrist, radians, as `sim.getJointPosition` gives them.
pub type JointAngles = [f64; JOINTS];

/// Range of every joint in radians, both ends allowed: what a scene says of its arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Smallest values.
    pub min_rad: JointAngles,
    /// Largest values.
    pub max_rad: JointAngles,
}

impl Default for JointLimits {
    /// One turn either way for every joint, as the stock model has it.
    fn default() -> Self {
        Self { min_rad: [-std::f64::consts::TAU; JOINTS], max_rad: [std::f64::consts::TAU; JOINTS] }
    }
}

impl JointLimits {
    /// Whether every joint is in its range.
    pub fn contains(&self, joints: &JointAngles) -> bool {
        self.first_violation(joints).is_none()
    }

    /// The first joint, counted from 0, that is out of its range or not a number.
    pub fn first_violation(&self, joints: &JointAngles) -> Option<usize> {
        let ranges = self.ranges();
        (0..JOINTS).find(|&i| !ranges[i].contains(joints[i]))
    }

    /// The nearest configuration within the limits.
    #[must_use]
    pub fn clamp(&self, joints: &JointAngles) -> JointAngles {
        let ranges = self.ranges();
        std::array::from_fn(|i| ranges[i].clamp(joints[i]))
    }

    /// The same, joint by joint.
    pub fn ranges(&self) -> [JointRange; JOINTS] {
        std::array::from_fn(|i| JointRange { min: self.min_rad[i], max: self.max_rad[i], speed: f64::INFINITY })
    }
}

/// Where every part of the arm is for one configuration, in the arm frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmPose {
    /// Fixed frame of each joint, before the joint's own rotation: origin on its axis, z along it.
    pub arm_from_joint: [Isometry3<f64>; JOINTS],
    /// Frame that each joint carries: its fixed frame turned about z by the joint value.
    pub arm_from_link: [Isometry3<f64>; JOINTS],
    /// The attachment point behind the last joint.
    pub arm_from_connection: Isometry3<f64>,
}

static ARM: LazyLock<Arm> = LazyLock::new(|| ArmKind::Ur5Coppeliasim.arm());

/// Poses of joints, links and connection for the given joint values in radians.
///
/// # Frames and units
/// Everything is in the arm frame, metres. With all joints at zero the connection is at (−0.18495, 0, 0.98655) and
/// its axes are z, y and −x of the arm.
pub fn forward(joints: &JointAngles) -> ArmPose {
    let mut arm_from_joint = [Isometry3::identity(); JOINTS];
    let mut arm_from_link = [Isometry3::identity(); JOINTS];
    let arm_from_flange = ARM.walk(joints, |i, at_rest, link| {
        arm_from_joint[i] = *at_rest;
        arm_from_link[i] = *link;
    });
    ArmPose { arm_from_joint, arm_from_link, arm_from_connection: arm_from_flange * ARM.flange_from_tip }
}

/// [`Arm::configurations`]: all that put the connection at `arm_from_connection`, up to eight.
pub fn inverse_all(arm_from_connection: &Isometry3<f64>) -> Vec<JointAngles> {
    ARM.ur.map(|ur| ur.all(&ARM, arm_from_connection)).unwrap_or_default()
}

/// [`Arm::inverse`] with limits of its own: the configuration within them that is nearest to `seed`. Where joint 6 is free
/// it keeps its value from the seed.
///
/// # Errors
/// [`IkError`] says what is in the way or which joint would leave its range.
pub fn inverse_nearest(
    arm_from_connection: &Isometry3<f64>,
    seed: &JointAngles,
    limits: &JointLimits,
) -> Result<JointAngles, IkError> {
    let ur = ARM.ur.as_ref().expect("the model is an arm of Universal Robots; a test finds its closed form");
    if !seed.iter().all(|q| q.is_finite()) {
        return Err(IkError::NotFinite);
    }
    ur.nearest(&ARM, arm_from_connection, seed, &limits.ranges())
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
