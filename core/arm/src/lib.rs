//! Serial arms: the tip pose for joint values, its derivatives by them, and the values that put it at a pose.
//!
//! # Model
//! A chain of revolute and prismatic joints. Joint `j` is at a fixed transform `P_j` behind the one before it and moves
//! what is behind it along or about its axis, `M_j(q_j)`:
//!
//! `base_from_tip = base_from_first · Π_j P_j · M_j(q_j) · last_from_flange · flange_from_tip`
//!
//! There is one such type, [`Arm`], for all sources of the numbers: Denavit–Hartenberg rows ([`Arm::from_dh`]), a robot
//! that is built in ([`ArmKind`]), a URDF file ([`urdf::Urdf`]).
//!
//! # Derivatives
//! Let `z_j` be the direction of the axis of joint `j` and `p_j` a point of it, in the base, and the tip be at `t` with axes
//! `R`. The tip pose is then perturbed on the right, `base_from_tip · exp(dq_j · ξ_j)`, by a
//!
//! - revolute joint with `ξ_j = [Rᵀ (z_j × (t − p_j)); Rᵀ z_j]`,
//! - prismatic joint with `ξ_j = [Rᵀ z_j; 0]`.
//!
//! This needs the axes and the pose of the tip, not the transform between flange and tip: with the tip pose that the
//! controller reports, the tool need not be known ([`Arm::tip_from_joints`]).
//!
//! The effect of errors of an arm on a calibration, and which of them it can find, is in `docs/maths/arm_errors.md`; the
//! arms that are built in, and the sources of their numbers, in `docs/reference/arms.md`.
//!
//! # Reference
//! Denavit & Hartenberg 1955; Siciliano et al. 2009, "Robotics: modelling, planning and control", §2.8.2 (rows) and
//! §3.1.3 (geometric Jacobian).
//!
//! # Example
//! ```
//! use handeye_arm::ArmKind;
//!
//! let arm = ArmKind::Ur5.arm();
//! let joints = [0.1, -1.2, 1.4, -1.8, -1.6, 0.2];
//! let base_from_tip = arm.forward(&joints)?;
//! let found = arm.inverse(&base_from_tip, &joints)?;
//! assert!(found.iter().zip(joints).all(|(a, b)| (a - b).abs() < 1e-9));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Depends on `handeye_geometry`; never on an estimator.

#![warn(missing_docs)]

mod built_in;
mod dh;
mod error;
mod inverse;
mod joint;
pub mod links;
mod model;
mod quantity;
mod record;
#[cfg(feature = "testing")]
pub mod testing;
pub mod urdf;
mod values;

use nalgebra::{Isometry3, Matrix6xX, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use handeye_geometry::frames::{Base, Pose, Tip};

pub use dh::DhRow;
pub use error::{ArmError, JointDefect};
pub use inverse::{DlsOptions, IkError, Obstacle};
pub use joint::{Joint, JointKind, JointRange};
pub use model::{ArmKind, ArmModel};
pub use quantity::JointQuantity;
pub use values::JointValues;

/// Most joints of an arm: twice those of a usual one.
pub const MAX_JOINTS: usize = 12;
/// Longest link in metres: longer than any real arm, and shorter than a millimetre taken for a metre.
const LONGEST_LINK_M: f64 = 10.0;

/// A serial arm: its joints, its place, and its tip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "record::ArmRecord", try_from = "record::ArmRecord")]
pub struct Arm {
    joints: Vec<Joint>,
    /// The end of the chain in the frame that the last joint carries.
    last_from_flange: Isometry3<f64>,
    /// Its closed form, where it has one; follows from the two above.
    ur: Option<inverse::UrGeometry>,
    /// Where the first joint's fixed transform begins, in the base.
    pub base_from_first: Isometry3<f64>,
    /// Pose of the tip in the flange.
    pub flange_from_tip: Isometry3<f64>,
}

/// Poses of every part of an arm for one configuration, in the base.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmFrames {
    /// Frame of each joint at rest, before its own motion: a point of its axis is the origin.
    pub base_from_joint: Vec<Isometry3<f64>>,
    /// Frame that each joint carries.
    pub base_from_link: Vec<Isometry3<f64>>,
    /// The end of the chain.
    pub base_from_flange: Isometry3<f64>,
}

impl Arm {
    /// An arm mounted in the base, with the tip at its flange.
    ///
    /// # Errors
    /// [`ArmError::JointCount`] and [`ArmError::BadJoint`].
    pub fn new(joints: Vec<Joint>, last_from_flange: Isometry3<f64>) -> Result<Self, ArmError> {
        if joints.is_empty() || joints.len() > MAX_JOINTS {
            return Err(ArmError::JointCount { got: joints.len() });
        }
        let last = joints.len() - 1;
        for (i, joint) in joints.iter().enumerate() {
            let bad = |defect| ArmError::BadJoint { joint: i + 1, name: joint.name.clone(), defect };
            if let Some(defect) = defect_of(&joint.previous_from_joint) {
                return Err(bad(defect));
            }
            // A normalised zero vector is NaN.
            if !joint.axis.iter().all(|v| v.is_finite()) {
                return Err(bad(JointDefect::Axis));
            }
            if !joint.range.is_sound() {
                let JointRange { min, max, speed } = joint.range;
                return Err(bad(JointDefect::Range { min, max, speed }));
            }
            if i == last
                && let Some(defect) = defect_of(&last_from_flange)
            {
                return Err(bad(defect));
            }
        }
        let (base_from_first, flange_from_tip) = (Isometry3::identity(), Isometry3::identity());
        let arm = Self { joints, last_from_flange, ur: None, base_from_first, flange_from_tip };
        let ur = inverse::UrGeometry::of(&arm);
        Ok(Self { ur, ..arm })
    }

    /// The same arm, mounted elsewhere and with another tool.
    #[must_use]
    pub fn mounted(self, base_from_first: Isometry3<f64>, flange_from_tip: Isometry3<f64>) -> Self {
        Self { base_from_first, flange_from_tip, ..self }
    }

    /// The same arm with other ranges of its joints, from the base to the tip.
    ///
    /// # Errors
    /// [`ArmError::WrongCount`], and [`ArmError::BadJoint`] for a range without room.
    pub fn with_ranges(mut self, ranges: &[JointRange]) -> Result<Self, ArmError> {
        if ranges.len() != self.joints.len() {
            return Err(ArmError::WrongCount { got: ranges.len(), need: self.joints.len() });
        }
        for (i, (joint, range)) in self.joints.iter_mut().zip(ranges).enumerate() {
            if !range.is_sound() {
                let defect = JointDefect::Range { min: range.min, max: range.max, speed: range.speed };
                return Err(ArmError::BadJoint { joint: i + 1, name: joint.name.clone(), defect });
            }
            joint.range = *range;
        }
        Ok(self)
    }

    /// The same arm with its joints displaced: entry `j` is the displacement of joint `j` in its frame at rest with z along
    /// the axis, as in [`Self::tip_from_joints`]. The axes do not change in that frame.
    ///
    /// # Errors
    /// [`ArmError::WrongCount`], and [`ArmError::BadJoint`] for a place that is not valid for a joint.
    pub fn displaced(&self, joint_from_moved: &[Isometry3<f64>]) -> Result<Self, ArmError> {
        if joint_from_moved.len() != self.joints.len() {
            return Err(ArmError::WrongCount { got: joint_from_moved.len(), need: self.joints.len() });
        }
        let mut joints = self.joints.clone();
        for (joint, moved) in joints.iter_mut().zip(joint_from_moved) {
            let joint_from_axis = joint.joint_from_axis();
            joint.previous_from_joint = joint.previous_from_joint * joint_from_axis * moved * joint_from_axis.inverse();
        }
        let arm = Self::new(joints, self.last_from_flange)?;
        Ok(arm.mounted(self.base_from_first, self.flange_from_tip))
    }

    /// The end of the chain in the frame that the last joint carries.
    pub fn last_from_flange(&self) -> &Isometry3<f64> {
        &self.last_from_flange
    }

    /// The ranges of all joints, from the base to the tip.
    pub fn ranges(&self) -> Vec<JointRange> {
        self.joints.iter().map(|joint| joint.range).collect()
    }

    /// Its joints, from the base to the tip.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// The first joint, counted from 0, whose value is out of its range or NaN; a joint without a value counts as out of
    /// its range.
    pub fn first_violation(&self, joints: &[f64]) -> Option<usize> {
        (0..self.joints.len()).find(|&i| joints.get(i).is_none_or(|&value| !self.joints[i].range.contains(value)))
    }

    /// Pose of the tip with these joint values, radians and metres.
    ///
    /// # Errors
    /// [`ArmError::WrongCount`] and [`ArmError::NotFinite`].
    pub fn forward(&self, joints: &[f64]) -> Result<Pose<Base, Tip>, ArmError> {
        self.check(joints)?;
        let base_from_flange = self.walk(joints, |_, _, _| ());
        Ok(Pose::from_isometry(base_from_flange * self.flange_from_tip))
    }

    /// Poses of every joint and every link.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn frames(&self, joints: &[f64]) -> Result<ArmFrames, ArmError> {
        self.check(joints)?;
        let mut base_from_joint = Vec::with_capacity(joints.len());
        let mut base_from_link = Vec::with_capacity(joints.len());
        let base_from_flange = self.walk(joints, |_, at_rest, link| {
            base_from_joint.push(*at_rest);
            base_from_link.push(*link);
        });
        Ok(ArmFrames { base_from_joint, base_from_link, base_from_flange })
    }

    /// Geometric Jacobian: velocity (rows 0 to 2, m/s) and angular velocity (rows 3 to 5, rad/s) of the tip per velocity
    /// of each joint (rad/s or m/s), in the axes of the base. [`Self::tip_by_joint`] has the same in the axes of the tip.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn jacobian(&self, joints: &[f64]) -> Result<Matrix6xX<f64>, ArmError> {
        self.check(joints)?;
        let (axes, base_from_flange) = self.axes(joints);
        let base_from_tip = base_from_flange * self.flange_from_tip;
        let columns: Vec<_> = axes.iter().map(|axis| axis.velocity(&base_from_tip.translation.vector)).collect();
        Ok(Matrix6xX::from_columns(&columns))
    }

    /// Derivative of the tip pose by each joint: entry `j` is the twist `[t; r]` in metres and radians per radian, or per
    /// metre, with which joint `j` perturbs `base_from_tip` on the right, at the tip pose of [`Self::forward`].
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn tip_by_joint(&self, joints: &[f64]) -> Result<Vec<Vector6<f64>>, ArmError> {
        self.check(joints)?;
        let (axes, base_from_flange) = self.axes(joints);
        Ok(twists(&axes, &(base_from_flange * self.flange_from_tip)))
    }

    /// The joints at rest in the frame of the tip, as in [`View::tip_from_joints`]: for each a frame about whose z axis it
    /// turns. The tip pose is the one that the controller reports: `flange_from_tip` of the arm does not matter,
    /// `base_from_first` does; `handeye_estimate::placement` finds it.
    ///
    /// [`View::tip_from_joints`]: handeye_geometry::targets::observation::View::tip_from_joints
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn tip_from_joints(
        &self,
        base_from_tip: &Pose<Base, Tip>,
        joints: &[f64],
    ) -> Result<Vec<Isometry3<f64>>, ArmError> {
        self.check(joints)?;
        let tip_from_base = base_from_tip.isometry().inverse();
        let mut frames = Vec::with_capacity(joints.len());
        self.walk(joints, |i, base_from_joint, _| {
            frames.push(tip_from_base * base_from_joint * self.joints[i].joint_from_axis());
        });
        Ok(frames)
    }

    fn check(&self, joints: &[f64]) -> Result<(), ArmError> {
        if joints.len() != self.joints.len() {
            return Err(ArmError::WrongCount { got: joints.len(), need: self.joints.len() });
        }
        match joints.iter().position(|q| !q.is_finite()) {
            Some(i) => Err(ArmError::NotFinite { joint: i + 1 }),
            None => Ok(()),
        }
    }

    /// Visits the joints along the chain: the number of a joint, its frame at rest and the frame that it carries. Returns
    /// the flange. All in the base; there must be a value for every joint.
    fn walk(&self, joints: &[f64], mut visit: impl FnMut(usize, &Isometry3<f64>, &Isometry3<f64>)) -> Isometry3<f64> {
        let mut base_from_link = self.base_from_first;
        for (i, (joint, &value)) in self.joints.iter().zip(joints).enumerate() {
            let base_from_joint = base_from_link * joint.previous_from_joint;
            base_from_link = base_from_joint * joint.motion(value);
            visit(i, &base_from_joint, &base_from_link);
        }
        base_from_link * self.last_from_flange
    }

    /// The axis of every joint, and the flange, in the base.
    fn axes(&self, joints: &[f64]) -> (Vec<Axis>, Isometry3<f64>) {
        let mut axes = Vec::with_capacity(joints.len());
        let base_from_flange = self.walk(joints, |i, at_rest, _| axes.push(Axis::of(&self.joints[i], at_rest)));
        (axes, base_from_flange)
    }
}

/// Why a transform is not a valid place on an arm.
fn defect_of(transform: &Isometry3<f64>) -> Option<JointDefect> {
    let is_finite = transform.translation.vector.iter().chain(transform.rotation.coords.iter()).all(|v| v.is_finite());
    if !is_finite {
        return Some(JointDefect::NotFinite);
    }
    let length_m = transform.translation.vector.norm();
    (length_m > LONGEST_LINK_M).then_some(JointDefect::TooLong { length_m })
}

/// The axis of a joint in the base.
#[derive(Debug, Clone, Copy)]
struct Axis {
    kind: JointKind,
    direction: Vector3<f64>,
    point: Vector3<f64>,
}

impl Axis {
    fn of(joint: &Joint, base_from_joint: &Isometry3<f64>) -> Self {
        Self {
            kind: joint.kind,
            direction: base_from_joint.rotation * joint.axis.into_inner(),
            point: base_from_joint.translation.vector,
        }
    }

    /// Velocity and angular velocity of a tip per velocity of the joint, in the axes of the base.
    fn velocity(&self, tip_in_base: &Vector3<f64>) -> Vector6<f64> {
        let (v, w) = match self.kind {
            JointKind::Revolute => (self.direction.cross(&(tip_in_base - self.point)), self.direction),
            JointKind::Prismatic => (self.direction, Vector3::zeros()),
        };
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    }
}

fn twists(axes: &[Axis], base_from_tip: &Isometry3<f64>) -> Vec<Vector6<f64>> {
    let tip_from_base = base_from_tip.rotation.inverse();
    let twist = |axis: &Axis| {
        let velocity = axis.velocity(&base_from_tip.translation.vector);
        let t = tip_from_base * velocity.fixed_rows::<3>(0).into_owned();
        let r = tip_from_base * velocity.fixed_rows::<3>(3).into_owned();
        Vector6::new(t.x, t.y, t.z, r.x, r.y, r.z)
    };
    axes.iter().map(twist).collect()
}

#[cfg(test)]
mod tests;
#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod ur5_tests;
