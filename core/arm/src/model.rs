//! Which arm it is, as stated in files.

use serde::{Deserialize, Serialize};

use super::{Arm, ArmError, DhRow};

/// An arm as named in a session: `{"kind": "ur5"}`, `{"dh": [[a, alpha, d, theta], …]}` or `{"chain": {…}}`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArmModel {
    /// One that is built in.
    Kind(ArmKind),
    /// Denavit–Hartenberg rows in the standard convention: `[a, alpha, d, theta]`, where theta is added to the joint
    /// angle; metres and radians.
    Dh(Vec<[f64; 4]>),
    /// One that was read from a URDF file or from a cell.
    Chain(Box<Arm>),
}

/// An arm that is built in. Those of Universal Robots are as in their manufacturer's table, with the joint angles that
/// the controller shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArmKind {
    /// The UR3 (CB3).
    Ur3,
    /// The UR5 (CB3).
    Ur5,
    /// The UR10 (CB3).
    Ur10,
    /// The UR3e.
    Ur3e,
    /// The UR5e.
    Ur5e,
    /// The UR10e.
    Ur10e,
    /// The UR16e.
    Ur16e,
    /// The UR5 of CoppeliaSim and of the built-in cell. Its zero is the arm straight up, and its links differ from the
    /// manufacturer's by up to 1 mm, the last one by 7 mm. The base is the object `/UR5`, the flange its `connection`.
    Ur5Coppeliasim,
}

impl ArmKind {
    /// All of them.
    pub const ALL: [Self; 8] =
        [Self::Ur3, Self::Ur5, Self::Ur10, Self::Ur3e, Self::Ur5e, Self::Ur10e, Self::Ur16e, Self::Ur5Coppeliasim];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ur3 => "ur3",
            Self::Ur5 => "ur5",
            Self::Ur10 => "ur10",
            Self::Ur3e => "ur3e",
            Self::Ur5e => "ur5e",
            Self::Ur10e => "ur10e",
            Self::Ur16e => "ur16e",
            Self::Ur5Coppeliasim => "ur5_coppeliasim",
        }
    }
}

impl ArmModel {
    /// The arm; where it is mounted and its tool are found by `handeye_estimate::placement::place`.
    ///
    /// # Errors
    /// [`ArmError`] for rows that are not valid for an arm.
    pub fn arm(&self) -> Result<Arm, ArmError> {
        match self {
            Self::Kind(kind) => Ok(kind.arm()),
            Self::Dh(rows) => {
                let rows: Vec<_> = rows.iter().map(|&row| DhRow::new(row)).collect();
                Arm::from_dh(&rows)
            }
            Self::Chain(arm) => Ok(Arm::clone(arm)),
        }
    }
}
