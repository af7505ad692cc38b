//! Which arm it is, as files say it.

use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use super::{Arm, ArmError, DhRow, ur5};

/// Universal Robots, "DH parameters for calculations of kinematics and dynamics", UR5.
const UR5: [DhRow; 6] = [
    DhRow::new([0.0, FRAC_PI_2, 0.089_159, 0.0]),
    DhRow::new([-0.425, 0.0, 0.0, 0.0]),
    DhRow::new([-0.392_25, 0.0, 0.0, 0.0]),
    DhRow::new([0.0, FRAC_PI_2, 0.109_15, 0.0]),
    DhRow::new([0.0, -FRAC_PI_2, 0.094_65, 0.0]),
    DhRow::new([0.0, 0.0, 0.0823, 0.0]),
];

/// An arm as a data set or a session names it: `{"kind": "ur5"}` or `{"dh": [[a, alpha, d, theta], …]}`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArmModel {
    /// One that is built in.
    Kind(ArmKind),
    /// Rows of Denavit and Hartenberg in the standard convention: `[a, alpha, d, theta]`, where theta is added to the
    /// joint angle; metres and radians.
    Dh(Vec<[f64; 4]>),
}

/// An arm that is built in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArmKind {
    /// The UR5 (CB3) by its manufacturer's table, with the joint angles that its controller shows.
    Ur5,
    /// The UR5 of CoppeliaSim and of the built-in cell. Its zero is the arm straight up, and its links differ from the
    /// manufacturer's by up to 1 mm, the last one by 7 mm. The base is the object `/UR5`, the flange its `connection`.
    Ur5Coppeliasim,
}

impl ArmKind {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Ur5, Self::Ur5Coppeliasim];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ur5 => "ur5",
            Self::Ur5Coppeliasim => "ur5_coppeliasim",
        }
    }
}

impl ArmModel {
    /// The arm; where it stands and its tool are for [`super::place`] to find.
    ///
    /// # Errors
    /// [`ArmError`] for rows that no arm has.
    pub fn arm(&self) -> Result<Arm, ArmError> {
        match self {
            Self::Kind(kind) => kind.arm(),
            Self::Dh(rows) => Arm::new(rows.iter().map(|&row| DhRow::new(row)).collect()),
        }
    }
}

impl ArmKind {
    fn arm(self) -> Result<Arm, ArmError> {
        match self {
            Self::Ur5 => Arm::new(UR5.to_vec()),
            Self::Ur5Coppeliasim => Ok(Arm::new(ur5::ROWS.to_vec())?.mounted(ur5::end_turn(), ur5::end_turn())),
        }
    }
}
