//! Kinematics of the UR5 as CoppeliaSim models it.
//!
//! Lengths in metres, angles in radians. The *arm* frame is the `/UR5` object, 14.65 mm above the mounting plane; the
//! *connection* is the force sensor at the end of the arm, where a tool or a `Tip` dummy is attached. At all joints
//! zero the arm stands straight up, tool towards −x of the arm.
//!
//! The geometry is that of the model, fitted to it without residual; it is **not** the table that the manufacturer
//! publishes, from which the connection differs by 7 mm on average, mostly in the last link.

mod forward;
mod inverse;
mod iterative;

pub use forward::{ArmPose, forward, jacobian, jacobian_at};
pub use inverse::{IkError, Obstacle, inverse_all, inverse_nearest};
pub use iterative::{DlsOptions, damped_least_squares, towards};

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::DhRow;

/// Number of joints.
pub const JOINTS: usize = 6;

/// Values of the six joints from the base to the wrist, radians, as `sim.getJointPosition` gives them.
pub type JointAngles = [f64; JOINTS];

/// Range of every joint in radians, both ends allowed.
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
    /// Rounding that a value may exceed its limit by: a joint driven to its stop is not outside.
    const SLACK_RAD: f64 = 1e-9;

    /// Whether every joint is in its range.
    pub fn contains(&self, joints: &JointAngles) -> bool {
        self.first_violation(joints).is_none()
    }

    /// The first joint, counted from 0, that is out of its range or not a number.
    pub fn first_violation(&self, joints: &JointAngles) -> Option<usize> {
        (0..JOINTS).find(|&i| !self.allows(i, joints[i]))
    }

    /// The nearest configuration within the limits.
    #[must_use]
    pub fn clamp(&self, joints: &JointAngles) -> JointAngles {
        std::array::from_fn(|i| joints[i].max(self.min_rad[i]).min(self.max_rad[i]))
    }

    fn allows(&self, joint: usize, value: f64) -> bool {
        value >= self.min_rad[joint] - Self::SLACK_RAD && value <= self.max_rad[joint] + Self::SLACK_RAD
    }
}

/// The arm in Denavit and Hartenberg's convention: `[a, alpha, d, theta]`, fitted to the model without residual.
pub(super) const ROWS: [DhRow; JOINTS] = [
    DhRow::new([0.0, FRAC_PI_2, 0.074_55, 0.0]),
    DhRow::new([-0.4251, 0.0, 0.0, -FRAC_PI_2]),
    DhRow::new([-0.392_15, 0.0, 0.0, 0.0]),
    DhRow::new([0.0, FRAC_PI_2, 0.11, -FRAC_PI_2]),
    DhRow::new([0.0, -FRAC_PI_2, 0.094_75, 0.0]),
    DhRow::new([0.0, 0.0, 0.074_95, 0.0]),
];
/// Turn about z between the arm frame and the convention's base, and between its flange and the connection.
const END_TURN: f64 = -FRAC_PI_2;

/// A turn about z.
fn turn_z(angle: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle))
}

/// That turn as a motion.
pub(super) fn end_turn() -> Isometry3<f64> {
    turn_z(END_TURN)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
