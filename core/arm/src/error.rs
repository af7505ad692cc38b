//! Why an arm, or joint values of it, are not usable.

use super::MAX_JOINTS;

/// What is wrong with a joint.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum JointDefect {
    /// NaN or infinite.
    #[error("where it sits has a number that is not finite")]
    NotFinite,
    /// Farther from the previous joint than in any arm.
    #[error("it is {length_m} m from its neighbour; lengths are in metres")]
    TooLong {
        /// Distance, metres.
        length_m: f64,
    },
    /// An axis without a direction.
    #[error("its axis has no direction")]
    Axis,
    /// A range without room to move.
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

/// Why an arm, or joint values with it, are not usable.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum ArmError {
    /// No joints, or more than any arm has.
    #[error("an arm of {got} joints: it must have 1 to {MAX_JOINTS}")]
    JointCount {
        /// Joints given.
        got: usize,
    },
    /// A number of a row that is not valid for an arm.
    #[error("{name} of joint {joint} is {value}: lengths are in metres, angles in radians, at most one turn")]
    BadRow {
        /// The joint, counted from 1.
        joint: usize,
        /// Name of the number.
        name: &'static str,
        /// The number as given: metres or radians.
        value: f64,
    },
    /// A joint that is not valid for an arm.
    #[error("joint {joint} ({name}): {defect}")]
    BadJoint {
        /// The joint, counted from 1.
        joint: usize,
        /// Its name.
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
}
