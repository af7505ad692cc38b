//! A joint that is not where it was sent.

use handeye_arm::JointKind;

use crate::error::LinkError;

pub(super) fn joint_elsewhere(index: usize, kind: JointKind, at: f64, goal: f64) -> LinkError {
    LinkError::JointElsewhere { joint: index + 1, at: kind.quantity(at), goal: kind.quantity(goal) }
}
