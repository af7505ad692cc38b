//! One joint of an arm: its place, its kind of motion, and its range.

use std::fmt;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

/// Kind of motion of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// Turns what is behind it about its axis. Its value is an angle in radians.
    Revolute,
    /// Shifts what is behind it along its axis. Its value is a length in metres.
    Prismatic,
}

impl fmt::Display for JointKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
        })
    }
}

/// How far and how fast a joint moves: radians and rad/s for a revolute one, metres and m/s for a prismatic one.
/// Infinite where there is no limit, or none is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointRange {
    /// Smallest value, inclusive.
    pub min: f64,
    /// Largest value, inclusive.
    pub max: f64,
    /// Largest speed either way.
    pub speed: f64,
}

impl JointRange {
    /// A joint without limits.
    pub const ENDLESS: Self = Self { min: f64::NEG_INFINITY, max: f64::INFINITY, speed: f64::INFINITY };

    /// Rounding by which a value may exceed its limit: a joint at its stop is not outside.
    pub(super) const SLACK: f64 = 1e-9;

    /// Whether a value is in the range; NaN is not.
    pub fn contains(&self, value: f64) -> bool {
        value >= self.min - Self::SLACK && value <= self.max + Self::SLACK
    }

    /// The nearest value in the range.
    pub fn clamp(&self, value: f64) -> f64 {
        value.max(self.min).min(self.max)
    }

    /// Whether the range is valid: it has room to move, a speed, and no NaN.
    pub(super) fn is_sound(&self) -> bool {
        // Infinity as the smallest value, or its opposite as the largest, leaves no finite one.
        self.min <= self.max && self.min < f64::INFINITY && self.max > f64::NEG_INFINITY && self.speed > 0.0
    }
}

/// A joint, in the frame that the joint before it carries.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name in its source, for messages.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Frame of the joint at rest, in the frame that the joint before it carries; for the first joint, in the frame in
    /// which the arm is mounted. A point of the axis is its origin.
    pub previous_from_joint: Isometry3<f64>,
    /// Direction of the axis in the frame of the joint.
    pub axis: UnitVector3<f64>,
    /// How far and how fast it moves.
    pub range: JointRange,
}

impl Joint {
    /// The frame that the joint carries, in its frame at rest, at a value in radians or metres.
    pub fn motion(&self, value: f64) -> Isometry3<f64> {
        match self.kind {
            JointKind::Revolute => {
                Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&self.axis, value))
            }
            JointKind::Prismatic => {
                Isometry3::from_parts((self.axis.into_inner() * value).into(), UnitQuaternion::identity())
            }
        }
    }

    /// `joint_from_axis`: the shortest turn that has z along the axis.
    pub fn joint_from_axis(&self) -> UnitQuaternion<f64> {
        let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), &self.axis).unwrap_or_else(half_turn)
    }
}
