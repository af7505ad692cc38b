//! Which arm it is, as files say it.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::{Arm, ArmError, DhRow};

/// Twists between the joints of a UR arm, radians.
const UR_ALPHA: [f64; 6] = [FRAC_PI_2, 0.0, 0.0, FRAC_PI_2, -FRAC_PI_2, 0.0];

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
            Self::Dh(rows) => Arm::new(rows.iter().map(|&row| DhRow::from(row)).collect()),
        }
    }
}

impl ArmKind {
    fn arm(self) -> Result<Arm, ArmError> {
        let quarter_back = Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -FRAC_PI_2),
        );
        match self {
            // Universal Robots, "DH parameters for calculations of kinematics and dynamics", UR5.
            Self::Ur5 => Arm::new(ur_rows([0.089_159, 0.109_15, 0.094_65, 0.0823], [-0.425, -0.392_25], [0.0; 6])),
            // Fitted to the model without residual.
            Self::Ur5Coppeliasim => {
                let zero = [0.0, -FRAC_PI_2, 0.0, -FRAC_PI_2, 0.0, 0.0];
                let rows = ur_rows([0.074_55, 0.11, 0.094_75, 0.074_95], [-0.4251, -0.392_15], zero);
                Ok(Arm::new(rows)?.mounted(quarter_back, quarter_back))
            }
        }
    }
}

/// The rows of a UR arm from its d₁ d₄ d₅ d₆, its a₂ a₃, and its zero.
fn ur_rows([d1, d4, d5, d6]: [f64; 4], [a2, a3]: [f64; 2], theta_offset_rad: [f64; 6]) -> Vec<DhRow> {
    let (a, d) = ([0.0, a2, a3, 0.0, 0.0, 0.0], [d1, 0.0, 0.0, d4, d5, d6]);
    (0..6).map(|i| DhRow::from([a[i], UR_ALPHA[i], d[i], theta_offset_rad[i]])).collect()
}

impl From<[f64; 4]> for DhRow {
    /// From `[a, alpha, d, theta]`, metres and radians.
    fn from([a_m, alpha_rad, d_m, theta_offset_rad]: [f64; 4]) -> Self {
        Self { a_m, alpha_rad, d_m, theta_offset_rad }
    }
}
