//! The arms that are built in: numbers that their manufacturer publishes, and the model of a simulator.
//!
//! Rows: Universal Robots, "DH parameters for calculations of kinematics and dynamics" (support article 45257). Ranges and
//! speeds: the manufacturer's technical data sheets of the CB3 and the e-series; every joint turns one revolution either
//! way, and the last one of the smallest arms without limits.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{Arm, ArmKind, DhRow, JointRange};

/// Rows of an arm of Universal Robots from the numbers that its manufacturer publishes, metres.
const fn ur([d1, a2, a3, d4, d5, d6]: [f64; 6]) -> [DhRow; 6] {
    [
        DhRow::new([0.0, FRAC_PI_2, d1, 0.0]),
        DhRow::new([a2, 0.0, 0.0, 0.0]),
        DhRow::new([a3, 0.0, 0.0, 0.0]),
        DhRow::new([0.0, FRAC_PI_2, d4, 0.0]),
        DhRow::new([0.0, -FRAC_PI_2, d5, 0.0]),
        DhRow::new([0.0, 0.0, d6, 0.0]),
    ]
}

/// CoppeliaSim's UR5, fitted to its model without residual.
const UR5_COPPELIASIM: [DhRow; 6] = [
    DhRow::new([0.0, FRAC_PI_2, 0.074_55, 0.0]),
    DhRow::new([-0.4251, 0.0, 0.0, -FRAC_PI_2]),
    DhRow::new([-0.392_15, 0.0, 0.0, 0.0]),
    DhRow::new([0.0, FRAC_PI_2, 0.11, -FRAC_PI_2]),
    DhRow::new([0.0, -FRAC_PI_2, 0.094_75, 0.0]),
    DhRow::new([0.0, 0.0, 0.074_95, 0.0]),
];

impl ArmKind {
    /// Its rows in the standard convention, from the base to the flange.
    pub fn rows(self) -> [DhRow; 6] {
        match self {
            Self::Ur3 => ur([0.1519, -0.243_65, -0.213_25, 0.112_35, 0.085_35, 0.0819]),
            Self::Ur5 => ur([0.089_159, -0.425, -0.392_25, 0.109_15, 0.094_65, 0.0823]),
            Self::Ur10 => ur([0.1273, -0.612, -0.5723, 0.163_941, 0.1157, 0.0922]),
            Self::Ur3e => ur([0.151_85, -0.243_55, -0.2132, 0.131_05, 0.085_35, 0.0921]),
            Self::Ur5e => ur([0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996]),
            Self::Ur10e => ur([0.1807, -0.6127, -0.571_55, 0.174_15, 0.119_85, 0.116_55]),
            Self::Ur16e => ur([0.1807, -0.4784, -0.36, 0.174_15, 0.119_85, 0.116_55]),
            Self::Ur5Coppeliasim => UR5_COPPELIASIM,
        }
    }

    /// Range and largest speed of each joint.
    pub fn ranges(self) -> [JointRange; 6] {
        let speeds_deg = match self {
            Self::Ur3 | Self::Ur3e => [180.0, 180.0, 180.0, 360.0, 360.0, 360.0],
            Self::Ur5 | Self::Ur5e => [180.0; 6],
            // The values stored in the joints of the model.
            Self::Ur5Coppeliasim => [90.0; 6],
            Self::Ur10 | Self::Ur10e | Self::Ur16e => [120.0, 120.0, 180.0, 180.0, 180.0, 180.0],
        };
        let mut ranges = speeds_deg.map(|deg| JointRange { min: -TAU, max: TAU, speed: deg * PI / 180.0 });
        if matches!(self, Self::Ur3 | Self::Ur3e) {
            (ranges[5].min, ranges[5].max) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        ranges
    }

    /// The arm with its ranges. The UR5 of CoppeliaSim has the base frame of its model; any other the frame of its first
    /// row, with the tip at the end of its last one.
    pub fn arm(self) -> Arm {
        let arm = Arm::from_dh(&self.rows()).and_then(|arm| arm.with_ranges(&self.ranges()));
        let arm = arm.expect("built-in numbers are those of an arm; a test makes each");
        match self {
            Self::Ur5Coppeliasim => arm.mounted(coppeliasim_turn(), coppeliasim_turn()),
            _ => arm,
        }
    }
}

/// Turn about z between the frame of CoppeliaSim's model and its first row, and between its last row and its connection.
fn coppeliasim_turn() -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -FRAC_PI_2))
}
