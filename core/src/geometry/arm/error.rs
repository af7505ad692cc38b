//! Why an arm, or joint values of it, are of no use.

use super::MAX_JOINTS;
use crate::estimate::handeye::HandEyeError;

/// What is wrong with a joint.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, crate::wording::Said)]
#[non_exhaustive]
pub enum JointDefect {
    /// NaN or infinite.
    #[error("where it sits has a number that is not finite")]
    NotFinite,
    /// Farther from the one before it than in any arm.
    #[error("it is {length_m} m from its neighbour; lengths are in metres")]
    TooLong {
        /// Distance, metres.
        length_m: f64,
    },
    /// No direction.
    #[error("its axis has no direction")]
    Axis,
    /// No room to move.
    #[error("it goes from {min} to {max} at {speed} a second; it needs a range with room, and a speed above zero")]
    Range {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
        /// Largest speed.
        speed: f64,
    },
}

/// Why an arm, or joint values with it, cannot be computed with.
#[derive(Debug, Clone, PartialEq, thiserror::Error, crate::wording::Said)]
#[non_exhaustive]
pub enum ArmError {
    /// No joints, or more than any arm has.
    #[error("an arm of {got} joints: it must have 1 to {MAX_JOINTS}")]
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
    /// A joint that no arm has.
    #[error("joint {joint} ({name}): {defect}")]
    BadJoint {
        /// The joint, counted from 1.
        joint: usize,
        /// What it is called.
        name: String,
        /// What is wrong with it.
        defect: JointDefect,
    },
    /// Values for another number of joints.
    #[error("{got} joint values for an arm of {need} joints")]
    WrongCount {
        /// Values given.
        got: usize,
        /// Joints of the arm.
        need: usize,
    },
    /// NaN or infinite.
    #[error("the value of joint {joint} is not finite")]
    NotFinite {
        /// The joint, counted from 1.
        joint: usize,
    },
    /// An offset of a length, for which an estimate of joint offsets has no place.
    #[error(
        "joint {joint} ({name}) is prismatic, and joint offsets are estimated of revolute joints alone: calibrate without \
         the joint values of this arm"
    )]
    PrismaticOffset {
        /// The joint, counted from 1.
        joint: usize,
        /// What it is called.
        name: String,
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
