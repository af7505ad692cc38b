//! Whether a configuration of the arm touches itself or something else, with the links as capsules.

use nalgebra::{Isometry3, Point3, Vector3};

use super::links::{self, LinkCapsule};
use crate::geometry::arm::{self, ArmFrames, JointValues};
use crate::geometry::frames::{Base, Pose, Tip};

/// How far the upper arm runs beside the plane through the shoulder, along the shoulder axis.
const UPPER_ARM_BESIDE_M: f64 = 0.136;
/// The same for the forearm.
const FOREARM_BESIDE_M: f64 = 0.016;
/// Distance of two points that are checked along a capsule.
const SAMPLE_M: f64 = 0.03;
/// Gap that the arm keeps from itself.
const SELF_CLEARANCE_M: f64 = 0.01;

/// Largest joint step between two checks of a path: a tool 1 m away moves by 5 cm, half the size of a link.
const PATH_STEP_RAD: f64 = 0.05;

/// Largest joint movement, radians; a metre of a prismatic joint counts as much as a radian.
pub fn travel(from: &[f64], to: &[f64]) -> f64 {
    from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// How the links of an arm fill the room around its axes.
#[derive(Debug, Clone, PartialEq)]
pub enum ArmBody {
    /// As those of the UR5, whose tubes run beside its axes.
    Ur5,
    /// Straight from joint to joint, see [`links`].
    Links(Vec<LinkCapsule>),
}

impl ArmBody {
    /// That of an arm of which only the chain is known.
    pub fn of(chain: &arm::Arm) -> Self {
        Self::Links(links::capsules(chain))
    }
}

/// The arm with a camera on its tip, as far as collisions go.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    /// Its chain, from the arm frame to the connection, with the ranges of its joints.
    pub chain: arm::Arm,
    /// What hangs on it.
    pub body: ArmBody,
    /// Pose of the arm frame in the world.
    pub world_from_arm: Isometry3<f64>,
    /// Pose of the tip in the connection.
    pub connection_from_tip: Isometry3<f64>,
    /// Pose of the camera in the tip.
    pub tip_from_camera: Isometry3<f64>,
}

/// A box that the arm must not touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstacle {
    /// Pose of its centre in the world.
    pub world_from_centre: Isometry3<f64>,
    /// Lengths of its edges, metres.
    pub size_m: [f64; 3],
}

/// All points within a radius of a line segment.
#[derive(Debug, Clone, Copy)]
struct Capsule {
    from: Point3<f64>,
    to: Point3<f64>,
    radius_m: f64,
}

/// What a configuration of the arm fills, in the arm frame.
struct Filled {
    /// All that can come to touch something else.
    moving: Vec<Capsule>,
    touches_itself: bool,
}

/// Capsules of the UR5 in the order from base to tool.
struct Ur5Body {
    column: Capsule,
    upper_arm: Capsule,
    forearm: Capsule,
    wrist: [Capsule; 3],
    tool: Capsule,
    camera: Capsule,
}

impl Arm {
    /// Whether the arm, its tool and its camera keep their distance from the obstacles, and from the arm itself; values
    /// that are not those of its joints are nowhere free.
    pub fn is_free(&self, joints: &[f64], obstacles: &[Obstacle], clearance_m: f64) -> bool {
        let Some(Filled { moving, touches_itself }) = self.filled(joints) else { return false };
        if touches_itself {
            return false;
        }
        obstacles.iter().all(|obstacle| {
            let centre_from_arm = obstacle.world_from_centre.inverse() * self.world_from_arm;
            moving.iter().all(|capsule| capsule.distance_to_box(&centre_from_arm, &obstacle.size_m) >= clearance_m)
        })
    }

    /// Whether the straight path in joint space between two configurations touches nothing; its ends are not looked at.
    pub fn path_is_free(&self, from: &[f64], to: &[f64], obstacles: &[Obstacle], clearance_m: f64) -> bool {
        let steps = (travel(from, to) / PATH_STEP_RAD).ceil().max(1.0) as usize;
        (1..steps).all(|step| {
            let part = step as f64 / steps as f64;
            let joints: Vec<f64> = from.iter().zip(to).map(|(from, to)| from + part * (to - from)).collect();
            self.is_free(&joints, obstacles, clearance_m)
        })
    }

    /// The joint values nearest to `seed` that put the tip there, within the ranges of the joints.
    pub fn reach(&self, base_from_tip: &Pose<Base, Tip>, seed: &[f64]) -> Option<JointValues> {
        let arm_from_connection =
            self.world_from_arm.inverse() * base_from_tip.isometry() * self.connection_from_tip.inverse();
        let found = self.chain.inverse(&Pose::from_isometry(arm_from_connection), seed).ok()?;
        JointValues::try_from(&found[..]).ok()
    }

    /// Where the tip is with these joint values; `None` for values that are not those of the arm.
    pub fn tip(&self, joints: &[f64]) -> Option<Pose<Base, Tip>> {
        let arm_from_connection = *self.chain.forward(joints).ok()?.isometry();
        Some(Pose::from_isometry(self.world_from_arm * arm_from_connection * self.connection_from_tip))
    }

    fn filled(&self, joints: &[f64]) -> Option<Filled> {
        let frames = self.chain.frames(joints).ok()?;
        let arm_from_connection = frames.base_from_flange * self.chain.flange_from_tip;
        Some(match &self.body {
            ArmBody::Ur5 => {
                let body = self.ur5(&frames, &arm_from_connection);
                Filled { moving: body.moving().to_vec(), touches_itself: body.touches_itself() }
            }
            ArmBody::Links(capsules) => {
                let arm_from_links: Vec<Isometry3<f64>> = links::arm_from_links(&frames).collect();
                let links = capsules.iter().map(|link| {
                    let at = arm_from_links.get(link.link)?;
                    let capsule = Capsule { from: at * link.from, to: at * link.to, radius_m: link.radius_m };
                    Some((link.link, capsule))
                });
                let hand = self.hand(&arm_from_connection);
                let body = LinksBody { links: links.collect::<Option<_>>()?, hand };
                Filled { moving: body.moving(), touches_itself: body.touches_itself() }
            }
        })
    }

    /// Tool and camera.
    fn hand(&self, arm_from_connection: &Isometry3<f64>) -> [Capsule; 2] {
        let connection = Point3::from(arm_from_connection.translation.vector);
        let arm_from_tip = arm_from_connection * self.connection_from_tip;
        let arm_from_camera = arm_from_tip * self.tip_from_camera;
        let capsule = |from, to, radius_m| Capsule { from, to, radius_m };
        [
            capsule(connection, Point3::from(arm_from_tip.translation.vector), 0.03),
            // The lens is at the origin, the housing behind it.
            capsule(
                Point3::from(arm_from_camera.translation.vector),
                arm_from_camera * Point3::new(0.0, 0.0, -0.03),
                0.03,
            ),
        ]
    }

    fn ur5(&self, frames: &ArmFrames, arm_from_connection: &Isometry3<f64>) -> Ur5Body {
        let joint = &frames.base_from_joint;
        let on_axis = |i: usize, along_m: f64| joint[i] * Point3::new(0.0, 0.0, along_m);
        let connection = Point3::from(arm_from_connection.translation.vector);
        let [tool, camera] = self.hand(arm_from_connection);
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
            tool,
            camera,
        }
    }
}

fn beside(distance_m: f64) -> Point3<f64> {
    Point3::new(0.0, 0.0, distance_m)
}

/// Links in their order, each with the number of joints that carry it, and what is on the last one.
struct LinksBody {
    links: Vec<(usize, Capsule)>,
    hand: [Capsule; 2],
}

impl LinksBody {
    /// What stands on the ground does not move.
    fn moving(&self) -> Vec<Capsule> {
        self.links.iter().filter(|(link, _)| *link > 0).map(|(_, capsule)| *capsule).chain(self.hand).collect()
    }

    /// Two that have no more between them than their own thickness touch by design, and so do those that share a joint.
    fn touches_itself(&self) -> bool {
        let all: Vec<Capsule> = self.links.iter().map(|(_, capsule)| *capsule).chain(self.hand).collect();
        let last_link = self.links.len().saturating_sub(1);
        (0..all.len()).any(|i| {
            (i + 2..all.len()).any(|j| {
                // Tool and camera both sit on the end of the last link.
                let between = &all[i + 1..=last_link.min(j - 1).max(i)];
                let gap_m: f64 = between.iter().map(|capsule| (capsule.to - capsule.from).norm()).sum();
                let thickness_m = all[i].radius_m + all[j].radius_m + SELF_CLEARANCE_M;
                i < last_link && gap_m > thickness_m && all[i].distance_to(&all[j]) < SELF_CLEARANCE_M
            })
        })
    }
}

impl Ur5Body {
    fn moving(&self) -> [Capsule; 7] {
        let [a, b, c] = self.wrist;
        [self.upper_arm, self.forearm, a, b, c, self.tool, self.camera]
    }

    /// Neighbours are left out: they touch by design.
    fn touches_itself(&self) -> bool {
        let [_, wrist_2, wrist_3] = &self.wrist;
        let ends = [wrist_2, wrist_3, &self.tool, &self.camera];
        let near = |a: &Capsule, b: &Capsule| a.distance_to(b) < SELF_CLEARANCE_M;
        near(&self.forearm, &self.column)
            || ends.iter().any(|end| near(end, &self.column) || near(end, &self.upper_arm))
            || [wrist_3, &self.tool, &self.camera].iter().any(|end| near(end, &self.forearm))
    }
}

impl Capsule {
    fn distance_to(&self, other: &Self) -> f64 {
        segment_distance([self.from, self.to], [other.from, other.to]) - self.radius_m - other.radius_m
    }

    /// At most half a sample too large.
    fn distance_to_box(&self, centre_from_arm: &Isometry3<f64>, size_m: &[f64; 3]) -> f64 {
        let (from, to) = (centre_from_arm * self.from, centre_from_arm * self.to);
        let steps = ((to - from).norm() / SAMPLE_M).ceil().max(1.0);
        let half = Vector3::from(*size_m) * 0.5;
        let nearest = (0..=steps as usize)
            .map(|step| {
                let point = from + (to - from) * (step as f64 / steps);
                (point.coords.abs() - half).map(|v| v.max(0.0)).norm()
            })
            .fold(f64::INFINITY, f64::min);
        nearest - self.radius_m
    }
}

/// Shortest distance of two line segments.
///
/// Reference: Ericson 2005, "Real-time collision detection", section 5.1.9.
fn segment_distance(first: [Point3<f64>; 2], second: [Point3<f64>; 2]) -> f64 {
    let d1 = first[1] - first[0];
    let d2 = second[1] - second[0];
    let r = first[0] - second[0];
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    // A segment of no length is a point: its parameter is of no consequence.
    let clamp = |numerator: f64, denominator: f64| {
        if denominator > 1e-12 { (numerator / denominator).clamp(0.0, 1.0) } else { 0.0 }
    };
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let mut s = clamp(b * f - c * e, a * e - b * b);
    let mut t = clamp(b * s + f, e);
    s = clamp(b * t - c, a);
    t = clamp(b * s + f, e);
    ((first[0] + d1 * s) - (second[0] + d2 * t)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::arm::ArmKind;

    #[test]
    fn distances_of_segments_agree_with_a_dense_search() {
        let p = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
        let cases = [
            [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.5, 1.0, -1.0), p(0.5, 1.0, 1.0)],
            [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(2.0, 1.0, 0.0), p(3.0, 1.0, 0.0)],
            [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.2, 0.3, 0.0), p(0.8, 0.3, 0.0)],
            [p(0.0, 0.0, 0.0), p(0.0, 0.0, 0.0), p(0.2, 0.3, 0.0), p(0.8, -0.3, 0.4)],
            [p(0.1, 0.2, 0.3), p(-0.4, 0.5, 0.9), p(0.7, -0.6, 0.2), p(0.3, 0.8, -0.5)],
        ];
        for [a, b, c, d] in cases {
            let mut dense = f64::INFINITY;
            for i in 0..=400 {
                for j in 0..=400 {
                    let first = a + (b - a) * (f64::from(i) / 400.0);
                    let second = c + (d - c) * (f64::from(j) / 400.0);
                    dense = dense.min((first - second).norm());
                }
            }
            let exact = segment_distance([a, b], [c, d]);
            // The grid misses the nearest points by at most half its pitch on each segment.
            assert!(exact <= dense + 1e-12 && exact > dense - 0.004, "{exact} is not {dense}");
        }
    }

    #[test]
    fn a_folded_arm_touches_itself_and_a_stretched_one_does_not() {
        let arm = Arm {
            chain: ArmKind::Ur5Coppeliasim.arm(),
            body: ArmBody::Ur5,
            world_from_arm: Isometry3::identity(),
            connection_from_tip: Isometry3::translation(0.0, 0.0, 0.017),
            tip_from_camera: Isometry3::translation(0.05, 0.0, 0.0),
        };
        assert!(arm.is_free(&[0.0; 6], &[], 0.02));
        // Elbow bent by 170° brings the hand to the shoulder.
        assert!(!arm.is_free(&[0.0, 0.0, 170_f64.to_radians(), 0.0, 0.0, 0.0], &[], 0.02));
    }

    #[test]
    fn an_arm_that_lies_on_the_table_is_not_free() {
        let arm = Arm {
            chain: ArmKind::Ur5Coppeliasim.arm(),
            body: ArmBody::Ur5,
            world_from_arm: Isometry3::translation(0.0, 0.0, 0.025),
            connection_from_tip: Isometry3::identity(),
            tip_from_camera: Isometry3::translation(0.05, 0.0, 0.0),
        };
        let table = Obstacle { world_from_centre: Isometry3::translation(0.0, 0.0, -0.05), size_m: [5.0, 5.0, 0.1] };
        let lifted = |deg: f64| [0.0, deg.to_radians(), 0.0, 0.0, 0.0, 0.0];
        assert!(arm.is_free(&lifted(60.0), &[table], 0.02));
        assert!(!arm.is_free(&lifted(95.0), &[table], 0.02));
    }
}
