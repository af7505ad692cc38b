//! The links of any arm as capsules, for drawing and for collision checks.
//!
//! A chain of joints defines the axes, not the bodies between them. So each link is modelled as a tube from the place of
//! its own joint to that of the next one, or the shortest connection: an arm whose links are offset from its axes, like
//! those of Universal Robots, is thicker and to one side of that. The rail of a prismatic joint is not included.

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::{Arm, ArmFrames, JointKind};

/// Radius of the link at the base and of the one at the tip, metres: those of arms for some kilograms.
const RADII_M: [f64; 2] = [0.06, 0.04];
/// Joints closer together than this \[m\] are one body.
const SHORTEST_M: f64 = 1e-3;

/// A tube with round ends that moves with one link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkCapsule {
    /// Number of joints that carry it.
    pub link: usize,
    /// One end, in the frame of the link, see [`arm_from_links`].
    pub from: Point3<f64>,
    /// The other.
    pub to: Point3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
}

/// The capsules of an arm from its base to its connection; a link between two joints at one place has none.
pub fn capsules(arm: &Arm) -> Vec<LinkCapsule> {
    let count = arm.joint_count();
    let Ok(at_zero) = arm.frames(&vec![0.0; count]) else { return Vec::new() };
    let origin = |pose: &Isometry3<f64>| Point3::from(pose.translation.vector);
    let connection = origin(&(at_zero.base_from_flange * arm.flange_from_tip));
    let joints = at_zero.base_from_joint.iter().map(origin);
    let places: Vec<Point3<f64>> = std::iter::once(Point3::origin()).chain(joints).chain([connection]).collect();
    let links = arm_from_links(&at_zero);
    let first_axis = arm.joints().first().filter(|joint| joint.kind == JointKind::Revolute).map(|joint| {
        let at = &at_zero.base_from_joint[0];
        (Point3::from(at.translation.vector), at.rotation * joint.axis)
    });
    let ends = places.windows(2).zip(links).enumerate();
    ends.filter(|(_, (ends, _))| (ends[1] - ends[0]).norm() > SHORTEST_M)
        .map(|(link, (ends, arm_from_link))| {
            // A tube about the axis of the first joint turns in place: it belongs to the fixed base.
            let link = if link == 1 && first_axis.is_some_and(|axis| ends.iter().all(|end| is_on(end, &axis))) {
                0
            } else {
                link
            };
            let arm_from_link = if link == 0 { Isometry3::identity() } else { arm_from_link };
            let radius_m = RADII_M[0] + (RADII_M[1] - RADII_M[0]) * link as f64 / count as f64;
            let [from, to] = [ends[0], ends[1]].map(|end| arm_from_link.inverse_transform_point(&end));
            LinkCapsule { link, from, to, radius_m }
        })
        .collect()
}

fn is_on(point: &Point3<f64>, (of_axis, direction): &(Point3<f64>, Unit<Vector3<f64>>)) -> bool {
    direction.cross(&(point - of_axis)).norm() < SHORTEST_M
}

/// Poses of the links, counted from the base, which does not move.
pub fn arm_from_links(frames: &ArmFrames) -> impl Iterator<Item = Isometry3<f64>> {
    std::iter::once(Isometry3::identity()).chain(frames.base_from_link.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArmKind;

    #[test]
    fn the_foot_of_an_arm_stands_and_all_else_moves() {
        let capsules = capsules(&ArmKind::Ur5e.arm());
        let foot: Vec<_> = capsules.iter().filter(|capsule| capsule.link == 0).collect();
        assert_eq!(foot.len(), 1, "{capsules:?}");
        assert!(foot[0].from.coords.norm() < 1e-9 && (foot[0].to.z - 0.1625).abs() < 1e-3, "{:?}", foot[0]);
        assert!(capsules.iter().any(|capsule| capsule.link == 2 && (capsule.to - capsule.from).norm() > 0.4));
    }
}
