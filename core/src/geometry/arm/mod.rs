//! Serial arms: where the tip is for some joint angles, and how it moves with each of them.
//!
//! # Model
//! Standard Denavit–Hartenberg rows, all joints revolute. With the joint angles `q_j`,
//!
//! `base_from_tip = base_from_first · Π_j Rz(q_j + theta_offset_j) · Tz(d_j) · Tx(a_j) · Rx(alpha_j) · flange_from_tip`
//!
//! # Derivatives
//! Joint `j` turns everything behind it about the z axis of its own frame: the direction `z_j` and a point `p_j` of the
//! axis, in the base. A tip at `t` with axes `R` in the base is then perturbed on the right,
//! `base_from_tip · exp(dq_j · [Rᵀ (z_j × (t − p_j)); Rᵀ z_j])`.
//! This needs the axes and where the tip *is*, not what is between flange and tip: with the tip pose that the controller
//! reports, the tool need not be known ([`Arm::tip_by_joint_at`]).
//!
//! What joint offsets do to a calibration, and which of them it can find, is in `docs/maths/joint_offsets.md`.
//!
//! # Reference
//! Denavit & Hartenberg 1955; Siciliano et al. 2009, "Robotics: modelling, planning and control", §2.8.2 (rows) and
//! §3.1.3 (geometric Jacobian).

mod error;
mod model;
mod placement;
pub mod ur5;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::geometry::frames::{Base, Pose, Tip};

pub use error::ArmError;
pub use model::{ArmKind, ArmModel};
pub use placement::{DISTANCE_LIMIT_M, JointView, Placement, ROTATION_LIMIT_RAD, TipByJoint, place, place_checked};

/// Most joints of an arm: twice those of a usual one.
pub const MAX_JOINTS: usize = 12;
/// Longest link in metres: longer than any arm that is made, and shorter than a millimetre taken for a metre.
const LONGEST_LINK_M: f64 = 10.0;

/// One joint and the link behind it, in the standard convention of Denavit and Hartenberg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DhRow {
    /// Length of the common normal, metres.
    pub a_m: f64,
    /// Twist about the common normal, radians.
    pub alpha_rad: f64,
    /// Offset along the joint axis, metres.
    pub d_m: f64,
    /// What is added to the joint angle, radians.
    pub theta_offset_rad: f64,
}

impl DhRow {
    /// From `[a, alpha, d, theta]`, metres and radians.
    pub const fn new([a_m, alpha_rad, d_m, theta_offset_rad]: [f64; 4]) -> Self {
        Self { a_m, alpha_rad, d_m, theta_offset_rad }
    }

    /// The transform of the joint turned by `joint_rad`.
    fn transform(&self, joint_rad: f64) -> Isometry3<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), joint_rad + self.theta_offset_rad) * self.link()
    }

    /// What follows the turn of the joint: the shift along its axis, the common normal and the twist about that.
    fn link(&self) -> Isometry3<f64> {
        let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.alpha_rad);
        Isometry3::from_parts(Translation3::new(self.a_m, 0.0, self.d_m), twist)
    }
}

/// A serial arm of revolute joints: its rows, where it stands, and where its tip is.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    rows: Vec<DhRow>,
    /// Where the first joint is in the base.
    pub base_from_first: Isometry3<f64>,
    /// Where the tip is behind the last joint.
    pub flange_from_tip: Isometry3<f64>,
}

impl Arm {
    /// An arm that stands in the base, with the tip at the end of its last row.
    ///
    /// # Errors
    /// [`ArmError::JointCount`] and [`ArmError::BadRow`].
    pub fn new(rows: Vec<DhRow>) -> Result<Self, ArmError> {
        if rows.is_empty() || rows.len() > MAX_JOINTS {
            return Err(ArmError::JointCount { got: rows.len() });
        }
        for (i, row) in rows.iter().enumerate() {
            let lengths = [("a", row.a_m), ("d", row.d_m)].map(|(name, value)| (name, value, LONGEST_LINK_M));
            let angles = [("alpha", row.alpha_rad), ("theta", row.theta_offset_rad)]
                .map(|(name, value)| (name, value, std::f64::consts::TAU));
            // NaN is in no range.
            let is_bad = |&&(_, value, most): &&(&str, f64, f64)| !(-most..=most).contains(&value);
            if let Some(&(name, value, _)) = lengths.iter().chain(&angles).find(is_bad) {
                return Err(ArmError::BadRow { joint: i + 1, name, value });
            }
        }
        Ok(Self { rows, base_from_first: Isometry3::identity(), flange_from_tip: Isometry3::identity() })
    }

    /// The same arm, standing elsewhere and with another tool.
    #[must_use]
    pub fn mounted(self, base_from_first: Isometry3<f64>, flange_from_tip: Isometry3<f64>) -> Self {
        Self { base_from_first, flange_from_tip, ..self }
    }

    /// Its rows, from the base to the tip.
    pub fn rows(&self) -> &[DhRow] {
        &self.rows
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.rows.len()
    }

    /// Where the tip is with these joint angles, radians.
    ///
    /// # Errors
    /// [`ArmError::WrongCount`] and [`ArmError::NotFinite`].
    pub fn forward(&self, joints_rad: &[f64]) -> Result<Pose<Base, Tip>, ArmError> {
        let (_, base_from_flange) = self.axes(joints_rad)?;
        Ok(Pose::from_isometry(base_from_flange * self.flange_from_tip))
    }

    /// How the tip moves with each joint: entry `j` is the twist `[t; r]` in metres and radians per radian with which
    /// joint `j` perturbs `base_from_tip` on the right, at the tip pose of [`Self::forward`].
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn tip_by_joint(&self, joints_rad: &[f64]) -> Result<Vec<Vector6<f64>>, ArmError> {
        let (axes, base_from_flange) = self.axes(joints_rad)?;
        Ok(twists(&axes, &(base_from_flange * self.flange_from_tip)))
    }

    /// As [`Self::tip_by_joint`], at the tip pose that the controller reports. Of the arm, `flange_from_tip` does not
    /// matter and `base_from_first` does; [`place`] finds it.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn tip_by_joint_at(
        &self,
        base_from_tip: &Pose<Base, Tip>,
        joints_rad: &[f64],
    ) -> Result<Vec<Vector6<f64>>, ArmError> {
        let (axes, _) = self.axes(joints_rad)?;
        Ok(twists(&axes, base_from_tip.isometry()))
    }

    /// The frame of every joint in the base, z along its axis, and the end of the last row.
    fn axes(&self, joints_rad: &[f64]) -> Result<(Vec<Isometry3<f64>>, Isometry3<f64>), ArmError> {
        if joints_rad.len() != self.rows.len() {
            return Err(ArmError::WrongCount { got: joints_rad.len(), need: self.rows.len() });
        }
        if let Some(i) = joints_rad.iter().position(|q| !q.is_finite()) {
            return Err(ArmError::NotFinite { joint: i + 1 });
        }
        let mut axes = Vec::with_capacity(self.rows.len());
        let mut end = self.base_from_first;
        for (row, &joint_rad) in self.rows.iter().zip(joints_rad) {
            axes.push(end);
            end *= row.transform(joint_rad);
        }
        Ok((axes, end))
    }
}

fn twists(base_from_axes: &[Isometry3<f64>], base_from_tip: &Isometry3<f64>) -> Vec<Vector6<f64>> {
    let tip_from_base = base_from_tip.rotation.inverse();
    let twist = |axis: &Isometry3<f64>| {
        let direction = axis.rotation * Vector3::z();
        let arm = base_from_tip.translation.vector - axis.translation.vector;
        let (t, r) = (tip_from_base * direction.cross(&arm), tip_from_base * direction);
        Vector6::new(t.x, t.y, t.z, r.x, r.y, r.z)
    };
    base_from_axes.iter().map(twist).collect()
}

#[cfg(test)]
mod tests;
