//! Arms that are given as Denavit–Hartenberg rows.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{Arm, ArmError, Joint, JointKind, JointRange, LONGEST_LINK_M, MAX_JOINTS};

/// One revolute joint and the link behind it, in the standard convention of Denavit and Hartenberg.
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
    /// A row from `[a, alpha, d, theta]`, metres and radians.
    pub(crate) const fn new([a_m, alpha_rad, d_m, theta_offset_rad]: [f64; 4]) -> Self {
        Self { a_m, alpha_rad, d_m, theta_offset_rad }
    }

    /// The transform after the turn of the joint: the shift along its axis, the common normal and the twist about that.
    fn link(&self) -> Isometry3<f64> {
        let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.alpha_rad);
        Isometry3::from_parts(Translation3::new(self.a_m, 0.0, self.d_m), twist)
    }

    /// The turn that is added to the joint angle.
    fn zero(&self) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.theta_offset_rad);
        Isometry3::from_parts(Translation3::identity(), turn)
    }

    /// The first number that is not valid for an arm, with its name.
    fn defect(&self) -> Option<(&'static str, f64)> {
        let lengths = [("a", self.a_m), ("d", self.d_m)].map(|(name, value)| (name, value, LONGEST_LINK_M));
        let angles = [("alpha", self.alpha_rad), ("theta", self.theta_offset_rad)]
            .map(|(name, value)| (name, value, std::f64::consts::TAU));
        // NaN is in no range.
        let bad = lengths.into_iter().chain(angles).find(|&(_, value, most)| !(-most..=most).contains(&value));
        bad.map(|(name, value, _)| (name, value))
    }
}

impl Arm {
    /// An arm of revolute joints by its rows, from the base to the tip. Its first row begins in the base, its tip is the
    /// end of its last row, and its joints, `q1`, `q2`, …, have no limits.
    ///
    /// `first_from_flange = Π_j Rz(q_j + theta_offset_j) · Tz(d_j) · Tx(a_j) · Rx(alpha_j)`
    ///
    /// # Errors
    /// [`ArmError::JointCount`] and [`ArmError::BadRow`].
    pub fn from_dh(rows: &[DhRow]) -> Result<Self, ArmError> {
        if rows.is_empty() || rows.len() > MAX_JOINTS {
            return Err(ArmError::JointCount { got: rows.len() });
        }
        let mut previous_from_row = Isometry3::identity();
        let mut joints = Vec::with_capacity(rows.len());
        for (i, row) in rows.iter().enumerate() {
            if let Some((name, value)) = row.defect() {
                return Err(ArmError::BadRow { joint: i + 1, name, value });
            }
            joints.push(Joint {
                name: format!("q{}", i + 1),
                kind: JointKind::Revolute,
                previous_from_joint: previous_from_row * row.zero(),
                axis: Vector3::z_axis(),
                range: JointRange::ENDLESS,
            });
            previous_from_row = row.link();
        }
        Self::new(joints, previous_from_row)
    }
}
