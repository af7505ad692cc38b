//! The space that a configuration of the arm occupies, with the links as capsules, and the distance of the arm from
//! itself.

use nalgebra::{Isometry3, Point3};

use super::capsule::Capsule;
use super::carried::Carried;
use handeye_arm::links::{self, LinkCapsule};
use handeye_arm::{self as arm, ArmFrames, JointKind, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};

/// Offset of the upper arm from the plane through the shoulder, along the shoulder axis.
const UPPER_ARM_BESIDE_M: f64 = 0.136;
/// The same for the forearm.
const FOREARM_BESIDE_M: f64 = 0.016;
/// Gap that the arm keeps from itself.
pub(super) const SELF_CLEARANCE_M: f64 = 0.01;
const TOOL_RADIUS_M: f64 = 0.03;
/// An upper bound of the distance of the body of a link from its axes, metres.
const BESIDE_AXES_M: f64 = 0.22;

/// Largest joint movement, radians; a metre of a prismatic joint counts as much as a radian.
pub fn travel(from: &[f64], to: &[f64]) -> f64 {
    from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The bodies of the links of an arm around its axes.
#[derive(Debug, Clone, PartialEq)]
pub enum ArmBody {
    /// Those of the UR5, whose tubes are offset from its axes.
    Ur5,
    /// Straight from joint to joint, see [`links`].
    Links(Vec<LinkCapsule>),
}

impl ArmBody {
    /// The body of an arm of which only the chain is known.
    pub fn of(chain: &arm::Arm) -> Self {
        Self::Links(links::capsules(chain))
    }
}

/// The arm with what it carries, for collision checks.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    /// Its chain, from the arm frame to the connection, with the ranges of its joints.
    pub chain: arm::Arm,
    /// The bodies of its links.
    pub body: ArmBody,
    /// Pose of the arm frame in the world.
    pub world_from_arm: Isometry3<f64>,
    /// Pose of the tip in the connection.
    pub connection_from_tip: Isometry3<f64>,
    /// What is mounted on its tip: the camera, or the board.
    pub carried: Vec<Carried>,
}

/// The space that a configuration of the arm occupies.
pub(super) struct Filled {
    /// All parts that can touch something else, in the base.
    pub moving: Vec<Capsule>,
    /// Distance of the arm from itself and from what it carries, metres; infinite where a collision is impossible.
    pub itself_m: f64,
    /// Tip and camera, in the base.
    pub watched: Vec<Point3<f64>>,
    /// The links, in the base, except the last one, which holds what is on the tip.
    pub inner: Vec<Capsule>,
}

/// Capsules of the UR5 in the order from base to tool.
struct Ur5Body {
    column: Capsule,
    upper_arm: Capsule,
    forearm: Capsule,
    wrist: [Capsule; 3],
    hand: Hand,
}

/// Tool, and what is mounted on it.
struct Hand {
    tool: Capsule,
    /// What is carried, each with whether it is wide.
    carried: Vec<(Capsule, bool)>,
}

impl Arm {
    /// The joint values nearest to `seed` that put the tip there, within the ranges of the joints.
    pub fn reach(&self, base_from_tip: &Pose<Base, Tip>, seed: &[f64]) -> Option<JointValues> {
        let found = self.chain.inverse(&self.arm_from_connection(base_from_tip), seed).ok()?;
        JointValues::try_from(&found[..]).ok()
    }

    /// Pose of the tip with these joint values; `None` for values that are not those of the arm.
    pub fn tip(&self, joints: &[f64]) -> Option<Pose<Base, Tip>> {
        let arm_from_connection = *self.chain.forward(joints).ok()?.isometry();
        Some(Pose::from_isometry(self.world_from_arm * arm_from_connection * self.connection_from_tip))
    }

    fn arm_from_connection(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Tip> {
        let world_from_connection = base_from_tip.isometry() * self.connection_from_tip.inverse();
        Pose::from_isometry(self.world_from_arm.inverse() * world_from_connection)
    }

    /// Its joints in a view with the tip there, as
    /// [`View::tip_from_joints`](handeye_geometry::targets::observation::View::tip_from_joints), where it gets there from `seed`;
    /// empty where it does not.
    pub(crate) fn tip_from_joints(&self, base_from_tip: &Pose<Base, Tip>, seed: &[f64]) -> Vec<Isometry3<f64>> {
        let joints = self.chain.inverse_nearby(&self.arm_from_connection(base_from_tip), seed);
        let Some(joints) = joints else { return Vec::new() };
        let arm_from_tip = Pose::from_isometry(self.world_from_arm.inverse() * base_from_tip.isometry());
        self.chain.tip_from_joints(&arm_from_tip, &joints).unwrap_or_default()
    }

    /// The space that it occupies with these joint values; `None` for values that are not those of the arm.
    pub(super) fn filled(&self, joints: &[f64]) -> Option<Filled> {
        let frames = self.chain.frames(joints).ok()?;
        let arm_from_connection = frames.base_from_flange * self.chain.flange_from_tip;
        let (moving, itself_m, inner) = match &self.body {
            ArmBody::Ur5 => {
                let body = self.ur5(&frames, &arm_from_connection);
                (body.moving(), body.distance_from_itself_m(), body.inner())
            }
            ArmBody::Links(capsules) => {
                let arm_from_links: Vec<Isometry3<f64>> = links::arm_from_links(&frames).collect();
                let links = capsules.iter().map(|link| {
                    let at = arm_from_links.get(link.link)?;
                    let capsule = Capsule { from: link.from, to: link.to, radius_m: link.radius_m };
                    Some((link.link, capsule.moved(at)))
                });
                let hand = self.hand(&arm_from_connection);
                let body = LinksBody { links: links.collect::<Option<_>>()?, hand };
                (body.moving(), body.distance_from_itself_m(), body.inner())
            }
        };
        let world_from_tip = self.world_from_arm * arm_from_connection * self.connection_from_tip;
        let cameras = self.carried.iter().filter_map(Carried::watched).map(|camera| world_from_tip * camera);
        let in_base = |capsules: &[Capsule]| capsules.iter().map(|c| c.moved(&self.world_from_arm)).collect();
        Some(Filled {
            moving: in_base(&moving),
            inner: in_base(&inner),
            itself_m,
            watched: std::iter::once(Point3::from(world_from_tip.translation.vector)).chain(cameras).collect(),
        })
    }

    /// An upper bound of the path length of any point of the arm and of what it carries on the straight path in joint
    /// space, metres.
    pub(super) fn longest_way_m(&self, from: &[f64], to: &[f64]) -> f64 {
        let Ok(frames) = self.chain.frames(from) else { return f64::INFINITY };
        let origin = |pose: &Isometry3<f64>| Point3::from(pose.translation.vector);
        let connection = origin(&(frames.base_from_flange * self.chain.flange_from_tip));
        let places: Vec<Point3<f64>> = frames.base_from_joint.iter().map(origin).chain([connection]).collect();
        let carried_m = self.carried.iter().map(Carried::reach_m).fold(TOOL_RADIUS_M, f64::max);
        let shifts_m: f64 = (self.chain.joints().iter().zip(from.iter().zip(to)))
            .filter(|(joint, _)| joint.kind == JointKind::Prismatic)
            .map(|(_, (from, to))| (to - from).abs())
            .sum();
        let mut beyond_m = self.connection_from_tip.translation.vector.norm() + carried_m + BESIDE_AXES_M + shifts_m;
        let mut way_m = 0.0;
        for (index, joint) in self.chain.joints().iter().enumerate().rev() {
            beyond_m += (places[index + 1] - places[index]).norm();
            let (Some(from), Some(to)) = (from.get(index), to.get(index)) else { return f64::INFINITY };
            way_m += (to - from).abs() * if joint.kind == JointKind::Prismatic { 1.0 } else { beyond_m };
        }
        way_m
    }

    fn hand(&self, arm_from_connection: &Isometry3<f64>) -> Hand {
        let connection = Point3::from(arm_from_connection.translation.vector);
        let arm_from_tip = arm_from_connection * self.connection_from_tip;
        let tip = Point3::from(arm_from_tip.translation.vector);
        let carried = self.carried.iter().flat_map(|carried| {
            carried.capsules().iter().map(|capsule| (capsule.moved(&arm_from_tip), carried.is_wide()))
        });
        Hand { tool: Capsule { from: connection, to: tip, radius_m: TOOL_RADIUS_M }, carried: carried.collect() }
    }

    fn ur5(&self, frames: &ArmFrames, arm_from_connection: &Isometry3<f64>) -> Ur5Body {
        let joint = &frames.base_from_joint;
        let on_axis = |i: usize, along_m: f64| joint[i] * Point3::new(0.0, 0.0, along_m);
        let connection = Point3::from(arm_from_connection.translation.vector);
        let wrist_1 = joint[3].inverse() * joint[4] * Point3::origin();
        let capsule = |from, to, radius_m| Capsule { from, to, radius_m };
        Ur5Body {
            column: capsule(Point3::origin(), Point3::new(0.0, 0.0, 0.09), 0.075),
            upper_arm: capsule(on_axis(1, UPPER_ARM_BESIDE_M), joint[2] * beside(UPPER_ARM_BESIDE_M), 0.06),
            forearm: capsule(on_axis(2, FOREARM_BESIDE_M), joint[3] * beside(FOREARM_BESIDE_M), 0.05),
            wrist: [
                capsule(on_axis(3, FOREARM_BESIDE_M), joint[3] * wrist_1, 0.04),
                capsule(on_axis(4, 0.0), on_axis(5, 0.0), 0.04),
                capsule(on_axis(5, 0.0), connection, 0.04),
            ],
            hand: self.hand(arm_from_connection),
        }
    }
}

fn beside(distance_m: f64) -> Point3<f64> {
    Point3::new(0.0, 0.0, distance_m)
}

impl Hand {
    fn all(&self) -> impl Iterator<Item = Capsule> {
        std::iter::once(self.tool).chain(self.carried.iter().map(|(capsule, _)| *capsule))
    }
}

/// Links in their order, each with the number of joints that carry it, and what is on the last one.
struct LinksBody {
    links: Vec<(usize, Capsule)>,
    hand: Hand,
}

impl LinksBody {
    /// The links, except those that are fixed to the ground.
    fn moving(&self) -> Vec<Capsule> {
        self.links.iter().filter(|(link, _)| *link > 0).map(|(_, capsule)| *capsule).chain(self.hand.all()).collect()
    }

    fn inner(&self) -> Vec<Capsule> {
        let last = self.links.iter().map(|(link, _)| *link).max();
        self.links.iter().filter(|(link, _)| Some(*link) != last).map(|(_, capsule)| *capsule).collect()
    }

    /// Two links with no more between them than their own thickness touch by design, and so do those that share a joint,
    /// and what is on the last link with that link: where it reaches back along the whole of it, also with the one before.
    fn distance_from_itself_m(&self) -> f64 {
        let links: Vec<Capsule> = self.links.iter().map(|(_, capsule)| *capsule).collect();
        // What is between two links, by adding up from the base.
        let mut before_m = vec![0.0];
        for link in &links {
            before_m.push(before_m[before_m.len() - 1] + link.length_m());
        }
        let mut least_m = f64::INFINITY;
        let mut pair = |i: usize, other: &Capsule, gap_m: f64| {
            if gap_m > links[i].radius_m + other.radius_m + SELF_CLEARANCE_M {
                least_m = least_m.min(links[i].distance_to(other));
            }
        };
        for i in 0..links.len() {
            for (j, other) in links.iter().enumerate().skip(i + 2) {
                pair(i, other, before_m[j] - before_m[i + 1]);
            }
        }
        if let Some((last, inner)) = links.split_last() {
            let wrist = Capsule { from: last.from, to: last.from, radius_m: 0.0 };
            for other in self.hand.all() {
                let from_wrist_m = wrist.distance_to(&other) + other.radius_m;
                for i in 0..inner.len() {
                    pair(i, &other, before_m[inner.len()] - before_m[i + 1] + from_wrist_m);
                }
            }
        }
        least_m
    }
}

impl Ur5Body {
    fn inner(&self) -> Vec<Capsule> {
        let [wrist_1, wrist_2, _holds] = self.wrist;
        vec![self.column, self.upper_arm, self.forearm, wrist_1, wrist_2]
    }

    fn moving(&self) -> Vec<Capsule> {
        [self.upper_arm, self.forearm].into_iter().chain(self.wrist).chain(self.hand.all()).collect()
    }

    /// Neighbours are left out: they touch by design.
    fn distance_from_itself_m(&self) -> f64 {
        let [wrist_1, wrist_2, wrist_3] = &self.wrist;
        let far = [wrist_2, wrist_3].into_iter().copied().chain(self.hand.all());
        let far = far.flat_map(|end| [end.distance_to(&self.column), end.distance_to(&self.upper_arm)]);
        let near = std::iter::once(*wrist_3).chain(self.hand.all()).map(|end| end.distance_to(&self.forearm));
        let wide = self.hand.carried.iter().filter(|(_, is_wide)| *is_wide);
        let wide = wide.map(|(capsule, _)| capsule.distance_to(wrist_1));
        far.chain(near).chain(wide).fold(self.forearm.distance_to(&self.column), f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Obstacle, Surroundings};
    use handeye_arm::ArmKind;

    #[test]
    fn a_folded_arm_touches_itself_and_a_stretched_one_does_not() {
        let arm = Arm {
            chain: ArmKind::Ur5Coppeliasim.arm(),
            body: ArmBody::Ur5,
            world_from_arm: Isometry3::identity(),
            connection_from_tip: Isometry3::translation(0.0, 0.0, 0.017),
            carried: vec![Carried::camera(&Isometry3::translation(0.05, 0.0, 0.0))],
        };
        assert!(arm.is_free(&[0.0; 6], &Surroundings::default(), 0.02));
        // Elbow bent by 170° brings the hand to the shoulder.
        assert!(!arm.is_free(&[0.0, 0.0, 170_f64.to_radians(), 0.0, 0.0, 0.0], &Surroundings::default(), 0.02));
    }

    #[test]
    fn an_arm_that_lies_on_the_table_is_not_free() {
        let arm = Arm {
            chain: ArmKind::Ur5Coppeliasim.arm(),
            body: ArmBody::Ur5,
            world_from_arm: Isometry3::translation(0.0, 0.0, 0.025),
            connection_from_tip: Isometry3::identity(),
            carried: vec![Carried::camera(&Isometry3::translation(0.05, 0.0, 0.0))],
        };
        let table = Obstacle::new("table", Isometry3::translation(0.0, 0.0, -0.05), [5.0, 5.0, 0.1]);
        let around = Surroundings::of(vec![table]);
        let lifted = |deg: f64| [0.0, deg.to_radians(), 0.0, 0.0, 0.0, 0.0];
        assert!(arm.is_free(&lifted(60.0), &around, 0.02));
        assert!(!arm.is_free(&lifted(95.0), &around, 0.02));
    }
}
