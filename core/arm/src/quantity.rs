//! A joint value in display units: degrees, or millimetres for a prismatic joint.

use std::fmt;

use super::JointKind;

impl JointKind {
    /// Display units, degrees or millimetres, per radian or metre.
    pub fn shown_per_si(self) -> f64 {
        match self {
            Self::Revolute => 180.0 / std::f64::consts::PI,
            Self::Prismatic => 1e3,
        }
    }

    /// The unit after such a number.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Revolute => "°",
            Self::Prismatic => " mm",
        }
    }

    /// A value, a speed or a difference of values with its unit.
    pub fn quantity(self, value: f64) -> JointQuantity {
        JointQuantity { kind: self, value }
    }
}

/// A value of a joint, or a difference or a speed of one. Written in degrees or millimetres, with two decimals where the
/// format does not give a precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointQuantity {
    /// Whether it turns or slides.
    pub kind: JointKind,
    /// Radians, or metres for a prismatic joint.
    pub value: f64,
}

impl fmt::Display for JointQuantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = self.value * self.kind.shown_per_si();
        write!(f, "{shown:.*}{}", f.precision().unwrap_or(2), self.kind.unit())
    }
}

handeye_wording::plain_values!(JointQuantity);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_said_in_degrees_and_lengths_in_millimetres() {
        let say = |kind: JointKind| format!("{} {:.0}", kind.quantity(0.5), kind.quantity(0.5));
        assert_eq!(say(JointKind::Revolute), "28.65° 29°");
        assert_eq!(say(JointKind::Prismatic), "500.00 mm 500 mm");
    }
}
