//! Goal and limits of an arm that follows, and how following ends.

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_plan::SpeedLimits;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::error::LinkError;

/// How the arm may move while it follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowLimits {
    /// Speed of the tip [m/s].
    pub speed_m_s: f64,
    /// Acceleration of the tip [m/s²].
    pub acceleration_m_s2: f64,
    /// Angular speed of the tip [rad/s].
    pub turn_rad_s: f64,
    /// Angular acceleration of the tip [rad/s²].
    pub turn_acceleration_rad_s2: f64,
    /// Speed of any joint [rad/s]; one that shifts may have this over [`super::RAD_PER_M`] [m/s].
    pub joint_speed_rad_s: f64,
    /// Acceleration of any joint [rad/s²]; of a prismatic joint [m/s²].
    pub joint_acceleration_rad_s2: f64,
    /// Where the tip may be.
    pub workspace: Workspace,
}

impl Default for FollowLimits {
    /// A tip at most at the reduced speed at which ISO 10218-1 lets people be near an arm, 0.25 m/s, which stops within
    /// 35 mm (1 m/s²), and turns at 1 rad/s, stopping within 8° (4 rad/s²). Joints stay a little below what the model of
    /// the arm allows its own by default, 90°/s and 360°/s².
    fn default() -> Self {
        Self {
            speed_m_s: 0.25,
            acceleration_m_s2: 1.0,
            turn_rad_s: 1.0,
            turn_acceleration_rad_s2: 4.0,
            joint_speed_rad_s: 1.5,
            joint_acceleration_rad_s2: 6.0,
            workspace: Workspace::default(),
        }
    }
}

impl FollowLimits {
    /// No faster than the surroundings allow.
    #[must_use]
    pub(crate) fn within(&self, limits: &SpeedLimits) -> Self {
        Self { speed_m_s: limits.tip(self.speed_m_s), joint_speed_rad_s: limits.joint(self.joint_speed_rad_s), ..*self }
    }

    /// Whether all limits are valid.
    ///
    /// # Errors
    /// [`LinkError::BadMotion`] names what is not positive and finite, or a workspace without room.
    pub(crate) fn validate(&self) -> Result<(), LinkError> {
        let limits = [
            ("the speed of the tip", self.speed_m_s),
            ("the acceleration of the tip", self.acceleration_m_s2),
            ("the angular speed of the tip", self.turn_rad_s),
            ("the angular acceleration of the tip", self.turn_acceleration_rad_s2),
            ("the speed of the joints", self.joint_speed_rad_s),
            ("the acceleration of the joints", self.joint_acceleration_rad_s2),
        ];
        positive(limits)?;
        let Workspace { min, max } = self.workspace;
        for (what, axis) in [("the workspace along x", 0), ("the workspace along y", 1), ("the workspace along z", 2)] {
            let (size, expected) = (max[axis] - min[axis], "finite, its largest coordinate above its smallest");
            if !(size.is_finite() && size > 0.0) {
                return Err(LinkError::BadMotion { what, expected, value: size });
            }
        }
        Ok(())
    }
}

pub(super) fn positive(values: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), LinkError> {
    match values.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        Some((what, value)) => Err(LinkError::BadMotion { what, expected: "positive and finite", value }),
        None => Ok(()),
    }
}

/// A box along the axes of the base in which the tip stays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Workspace {
    /// The corner with the smallest coordinates \[m\].
    pub min: Point3<f64>,
    /// The corner with the largest coordinates \[m\].
    pub max: Point3<f64>,
}

impl Default for Workspace {
    /// What a UR5 reaches from where the public scene has it, at the origin: 1 m to all sides, but not lower than 0.1 m
    /// above the floor, because camera and flange are next to the tip.
    fn default() -> Self {
        Self { min: Point3::new(-1.0, -1.0, 0.1), max: Point3::new(1.0, 1.0, 1.2) }
    }
}

impl Workspace {
    /// Whether a point in base axes \[m\] is in it.
    pub fn contains(&self, in_base: &Vector3<f64>) -> bool {
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&in_base[axis]))
    }
}

/// Where the tip should be at the moment, and how it should move on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowGoal {
    /// Pose of the tip at that time.
    pub base_from_tip: Pose<Base, Tip>,
    /// Velocity of the tip, in base axes [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity of the tip, in base axes [rad/s].
    pub angular_velocity_rad_s: Vector3<f64>,
}

impl FollowGoal {
    /// Where it is some time later, if it moves on like this.
    #[must_use]
    pub fn after(&self, time_s: f64) -> Self {
        let (shift, turn) = (self.velocity_m_s * time_s, self.angular_velocity_rad_s * time_s);
        let base_from_tip = Pose::from_isometry(moved(self.base_from_tip.isometry(), &shift, &turn));
        Self { base_from_tip, ..*self }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.base_from_tip.is_finite()
            && self.velocity_m_s.iter().chain(&self.angular_velocity_rad_s).all(|v| v.is_finite())
    }
}

/// A pose after a shift and a turn in the axes of the base, about its own origin.
pub(super) fn moved(base_from_tip: &Isometry3<f64>, shift: &Vector3<f64>, turn: &Vector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(base_from_tip.translation.vector + shift),
        UnitQuaternion::from_scaled_axis(*turn) * base_from_tip.rotation,
    )
}

/// How following ended; the arm is at rest.
#[derive(Debug, Clone, PartialEq)]
pub enum FollowEnd {
    /// The caller wanted it.
    Released,
    /// A client had the cell stop everything.
    Stopped,
    /// The goal leaves the workspace.
    Workspace,
    /// A joint, counted from 1 at the base, is at its limit.
    JointLimit {
        /// The joint, counted from 1 at the base.
        joint: usize,
    },
    /// The arm is nearly stretched or folded so that some direction needs joints faster than they are.
    Singular,
    /// Something else moves this joint, counted from 1 at the base, or holds it.
    NotFollowing {
        /// The joint, counted from 1 at the base.
        joint: usize,
    },
    /// The tip is not where the kinematics has it; nothing was moved.
    OtherTip,
}
