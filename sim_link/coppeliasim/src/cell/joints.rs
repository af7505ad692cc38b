//! The joints of the arm: how they move, how far, and how they are compared.
//!
//! Angles and lengths are limited and compared by one equivalence, [`RAD_PER_M`], so that each limit is one number. A
//! joint that turns is compared exactly as if there were no others.

use handeye_arm::{JointKind, JointRange, JointValues};

use super::CellObjects;
use crate::constants;
use crate::error::LinkError;
use crate::sim::{ObjectHandle, Sim};

/// Radians of a revolute joint that count as one metre of a prismatic one: where revolute joints may be as fast as those of
/// the stock UR5 model, 90°/s, a prismatic one may do 0.5 m/s. That is twice the fastest jog of the tip, so it does not
/// limit it, and usual for linear axes under arms of this size.
pub const RAD_PER_M: f64 = std::f64::consts::PI;

/// A joint that is driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellJoint {
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Range in the simulator; endless for a cyclic joint. Its speed is not known.
    pub range: JointRange,
}

impl CellJoint {
    /// Reads it; `None` when it neither turns about one axis nor shifts along one.
    pub(super) fn read(sim: &mut Sim, joint: ObjectHandle) -> Result<Option<Self>, LinkError> {
        let kind = match sim.get_joint_type(joint)? {
            constants::JOINT_REVOLUTE => JointKind::Revolute,
            constants::JOINT_PRISMATIC => JointKind::Prismatic,
            _ => return Ok(None),
        };
        let interval = sim.get_joint_interval(joint)?;
        let range = if interval.cyclic {
            JointRange::ENDLESS
        } else {
            JointRange { min: interval.min, max: interval.max, speed: f64::INFINITY }
        };
        Ok(Some(Self { kind, range }))
    }
}

/// A difference or a speed of a joint in radians, or in as many as a length counts for.
pub(super) fn in_rad(kind: JointKind, value: f64) -> f64 {
    match kind {
        JointKind::Revolute => value,
        JointKind::Prismatic => value * RAD_PER_M,
    }
}

/// Converts radians to the unit of any joint.
pub(super) fn of_rad(kind: JointKind, rad: f64) -> f64 {
    match kind {
        JointKind::Revolute => rad,
        JointKind::Prismatic => rad / RAD_PER_M,
    }
}

/// How far apart two values of a joint are \[rad\]: of angles the short way round, as a cyclic joint wraps around.
pub(super) fn difference_rad(kind: JointKind, a: f64, b: f64) -> f64 {
    if kind == JointKind::Prismatic {
        return in_rad(kind, a - b).abs();
    }
    let turn = std::f64::consts::TAU;
    let rest = (a - b).rem_euclid(turn);
    rest.min(turn - rest)
}

/// The joint that moves most between two configurations, counted from 0, and by how much \[rad\].
pub(super) fn largest_change(kinds: impl Iterator<Item = JointKind>, from: &[f64], to: &[f64]) -> (usize, f64) {
    kinds
        .zip(from.iter().zip(to))
        .map(|(kind, (from, to))| in_rad(kind, to - from).abs())
        .enumerate()
        .fold((0, 0.0), |most, next| if next.1 > most.1 { next } else { most })
}

/// Reads where the joints are.
pub(super) fn read_joint_values(sim: &mut Sim, objects: &CellObjects) -> Result<JointValues, LinkError> {
    let mut values = JointValues::zeros(objects.joints.len());
    for (value, &joint) in values.iter_mut().zip(&objects.joints) {
        *value = sim.get_joint_position(joint)?;
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rail_is_compared_by_its_length_and_an_angle_the_short_way_round() {
        assert!(difference_rad(JointKind::Revolute, 3.1, -3.1) < 0.1);
        assert!(difference_rad(JointKind::Prismatic, 3.1, -3.1) > 6.2);
        let kinds = [JointKind::Revolute, JointKind::Prismatic];
        let (joint, by_rad) = largest_change(kinds.into_iter(), &[0.0, 0.0], &[0.2, -0.1]);
        assert_eq!((joint, by_rad), (1, 0.1 * RAD_PER_M));
        assert_eq!(of_rad(kinds[1], in_rad(kinds[1], 0.3)), 0.3);
    }
}
