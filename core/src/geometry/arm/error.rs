//! Why joint angles are of no use.

use super::MAX_JOINTS;
use crate::estimate::handeye::HandEyeError;

/// Why an arm, or joint angles with it, cannot be computed with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ArmError {
    /// No joints, or more than any arm has.
    #[error("an arm of {got} joints: it must have 1 to {MAX_JOINTS}, one row [a, alpha, d, theta] for each")]
    JointCount {
        /// Joints given.
        got: usize,
    },
    /// A number of a row that no arm has.
    #[error("{name} of joint {joint} is {value}: lengths are in metres, angles in radians, at most one turn")]
    BadRow {
        /// The joint, counted from 1.
        joint: usize,
        /// Which number.
        name: &'static str,
        /// What it is.
        value: f64,
    },
    /// Angles for another number of joints.
    #[error("{got} joint angles for an arm of {need} joints")]
    WrongCount {
        /// Angles given.
        got: usize,
        /// Joints of the arm.
        need: usize,
    },
    /// NaN or infinite.
    #[error("the angle of joint {joint} is not finite")]
    NotFinite {
        /// The joint, counted from 1.
        joint: usize,
    },
    /// The poses do not tell where the arm stands and what its tool is.
    #[error("where the arm stands and where its tip is cannot be told from these poses: {0}")]
    NotPlaced(#[from] HandEyeError),
    /// Angles and poses are not of one arm.
    #[error(
        "the joint angles do not belong to the poses: {off} of {views} views are off by more than {limit_mm} mm or \
         {limit_deg}°, most of all view {view}, by {distance_mm:.1} mm and {angle_deg:.2}°; check the order, unit, sign \
         and zero of the joint angles, the convention of the poses, and which arm it is"
    )]
    Foreign {
        /// The view that is off most, counted from 1.
        view: usize,
        /// Distance between its reported tip and the one that its angles give, millimetres.
        distance_mm: f64,
        /// Angle between them, degrees.
        angle_deg: f64,
        /// How many views are off by more than is allowed.
        off: usize,
        /// All views.
        views: usize,
        /// Distance that is allowed, millimetres.
        limit_mm: f64,
        /// Angle that is allowed, degrees.
        limit_deg: f64,
    },
}
