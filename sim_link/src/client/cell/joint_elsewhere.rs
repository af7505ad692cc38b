//! A joint that is not where it was sent.

use crate::client::error::LinkError;

pub(super) fn joint_elsewhere(index: usize, at_rad: f64, goal_rad: f64) -> LinkError {
    let (at_deg, goal_deg) = (at_rad.to_degrees(), goal_rad.to_degrees());
    LinkError::JointElsewhere { joint: index + 1, at_deg, goal_deg }
}
