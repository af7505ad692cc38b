//! A path around obstacles: through configurations each of which is reached straight in joint space from the one before.
//!
//! Two trees of free configurations grow towards one another from both ends. Reference: Kuffner and LaValle 2000, "RRT-Connect: an
//! efficient approach to single-query path planning". The path found is then shortened, because random paths are long.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::clearance::travel;
use super::contact::Guard;
use handeye_arm::{JointRange, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;

/// Longest leg of a tree [rad, m of a prismatic joint]: some of them make the turn of a joint.
const STEP: f64 = 0.4;
/// Random configurations that are grown towards. A path around one obstacle takes tens; what takes more is found sooner by a
/// person.
const MOST_DRAWS: usize = 1500;
/// Largest distance of a joint from the values at both ends [rad, m]: half a turn leads to any side of an arm.
const ASIDE: f64 = std::f64::consts::PI;
/// Random configurations from which a pose is solved: an arm of six joints has up to eight solutions.
const MOST_SEEDS: usize = 24;
/// Solutions nearer to one another are the same [rad, m].
const SAME: f64 = 0.05;
/// Solutions to which a path is searched, the nearest first.
const MOST_ENDS: usize = 3;

#[derive(Debug)]
struct Tree {
    nodes: Vec<(JointValues, usize)>,
}

impl Tree {
    fn new(root: JointValues) -> Self {
        Self { nodes: vec![(root, 0)] }
    }

    /// Grows from its nearest node straight towards a configuration, as far as that is free; returns the last node, and whether it
    /// reached the configuration.
    fn grow(&mut self, guard: &Guard<'_>, towards: &JointValues) -> Option<(usize, bool)> {
        let near = |k: &usize| travel(&self.nodes[*k].0, towards);
        let mut last = (0..self.nodes.len()).min_by(|a, b| near(a).total_cmp(&near(b)))?;
        let mut grown = None;
        loop {
            let from = self.nodes[last].0;
            let left = travel(&from, towards);
            let part = (STEP / left).min(1.0);
            let next = JointValues::from_fn(from.len(), |i| from[i] + part * (towards[i] - from[i]));
            if left > 0.0 && (guard.contact(&next).is_some() || guard.contact_on_path(&from, &next).is_some()) {
                return grown.map(|last| (last, false));
            }
            self.nodes.push((next, last));
            last = self.nodes.len() - 1;
            if part >= 1.0 || left <= 0.0 {
                return Some((last, true));
            }
            grown = Some(last);
        }
    }

    /// The path from a node back to its root.
    fn back(&self, mut node: usize) -> Vec<JointValues> {
        let mut way = vec![self.nodes[node].0];
        while node != 0 {
            node = self.nodes[node].1;
            way.push(self.nodes[node].0);
        }
        way
    }
}

impl Guard<'_> {
    /// The configurations to go through after `from`, the last one `to`, straight in joint space from each to the next; `None`
    /// where no path is found. The same arguments give the same path.
    pub fn detour(
        &self,
        from: &JointValues,
        to: &JointValues,
        seed: u64,
        cancel: &CancelToken,
    ) -> Option<Vec<JointValues>> {
        if from.len() != to.len() || self.contact(to).is_some() {
            return None;
        }
        if self.contact_on_path(from, to).is_none() {
            return Some(vec![*to]);
        }
        let between = ends(from, to, &self.arm().chain.ranges());
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (mut ours, mut theirs, mut is_turned) = (Tree::new(*from), Tree::new(*to), false);
        for _ in 0..MOST_DRAWS {
            if cancel.is_cancelled() {
                return None;
            }
            let drawn = JointValues::from_fn(from.len(), |i| {
                let [low, high] = between[i];
                low + (high - low) * rng.random::<f64>()
            });
            if let Some((node, _)) = ours.grow(self, &drawn) {
                let reached = ours.nodes[node].0;
                if let Some((met, true)) = theirs.grow(self, &reached) {
                    let (mut way, rest) = (ours.back(node), theirs.back(met));
                    way.reverse();
                    way.extend(rest.into_iter().skip(1));
                    if is_turned {
                        way.reverse();
                    }
                    return Some(self.shortened(&way));
                }
            }
            std::mem::swap(&mut ours, &mut theirs);
            is_turned = !is_turned;
        }
        None
    }

    /// The same to a pose of the tip, in any configuration of the arm.
    pub fn detour_to(
        &self,
        from: &JointValues,
        base_from_tip: &Pose<Base, Tip>,
        seed: u64,
        cancel: &CancelToken,
    ) -> Option<Vec<JointValues>> {
        let ranges = self.arm().chain.ranges();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let around = ends(from, from, &ranges);
        let mut found: Vec<JointValues> = Vec::new();
        for number in 0..MOST_SEEDS {
            let drawn = JointValues::from_fn(from.len(), |i| {
                let [low, high] = around[i];
                low + (high - low) * rng.random::<f64>()
            });
            let start = if number == 0 { *from } else { drawn };
            let solved = self.arm().reach(base_from_tip, &start);
            found.extend(solved.filter(|joints| found.iter().all(|other| travel(other, joints) > SAME)));
        }
        found.retain(|joints| self.contact(joints).is_none());
        found.sort_by(|a, b| travel(from, a).total_cmp(&travel(from, b)));
        found.iter().take(MOST_ENDS).find_map(|to| self.detour(from, to, seed, cancel))
    }

    /// The path shortened: from each configuration straight to the last one with a free path; without the first.
    fn shortened(&self, way: &[JointValues]) -> Vec<JointValues> {
        let (mut short, mut at) = (Vec::new(), 0);
        while at + 1 < way.len() {
            let free = |&next: &usize| next == at + 1 || self.contact_on_path(&way[at], &way[next]).is_none();
            at = (at + 1..way.len()).rev().find(free).unwrap_or(at + 1);
            short.push(way[at]);
        }
        short
    }
}

/// The range of values in which each joint is searched.
fn ends(from: &JointValues, to: &JointValues, ranges: &[JointRange]) -> Vec<[f64; 2]> {
    let of_joint = |(i, range): (usize, &JointRange)| {
        let [low, high] = [from[i].min(to[i]) - ASIDE, from[i].max(to[i]) + ASIDE];
        [low.max(range.min), high.min(range.max)]
    };
    ranges.iter().take(from.len().min(to.len())).enumerate().map(of_joint).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::{Arm, ArmBody, Carried, Obstacle, Surroundings};
    use handeye_arm::ArmKind;

    const CLEARANCE_M: f64 = 0.01;

    fn arm() -> Arm {
        let chain = ArmKind::Ur5e.arm();
        Arm {
            body: ArmBody::of(&chain),
            chain,
            world_from_arm: Isometry3::identity(),
            connection_from_tip: Isometry3::identity(),
            carried: vec![Carried::camera(&Isometry3::identity())],
        }
    }

    fn turned(by_rad: f64) -> JointValues {
        JointValues::from([std::f64::consts::PI + by_rad, -1.6, 1.9, -1.9, -1.57, 0.0])
    }

    /// A post where the hand swings through.
    fn post(arm: &Arm) -> Surroundings {
        let at = arm.tip(&turned(0.5)).expect("its joints").translation();
        Surroundings::of(vec![Obstacle::new("post", Isometry3::from(at), [0.04, 0.04, 0.3])])
    }

    fn is_free(guard: &Guard<'_>, from: &JointValues, way: &[JointValues]) -> bool {
        let mut before = *from;
        way.iter().all(|next| {
            let free = guard.contact(next).is_none() && guard.contact_on_path(&before, next).is_none();
            before = *next;
            free
        })
    }

    #[test]
    fn a_way_around_a_post_is_found_and_every_leg_of_it_is_free() {
        let arm = arm();
        let around = post(&arm);
        let (from, to) = (turned(0.0), turned(1.0));
        let guard = Guard::from(&arm, &around, &from, CLEARANCE_M);
        assert!(guard.contact_on_path(&from, &to).is_some(), "the straight way leads through it");
        let cancel = CancelToken::default();
        let way = guard.detour(&from, &to, 1, &cancel).expect("there is room above");
        assert!(way.len() > 1 && way.last() == Some(&to) && is_free(&guard, &from, &way), "{way:?}");
        assert_eq!(guard.detour(&from, &to, 1, &cancel), Some(way), "the same question has the same answer");

        let pose = arm.tip(&to).expect("its joints");
        let way = guard.detour_to(&from, &pose, 1, &cancel).expect("the same place");
        let there = arm.tip(way.last().expect("a goal")).expect("its joints");
        let (off_m, off_rad) = there.distance_to(&pose);
        assert!(off_m < 1e-6 && off_rad < 1e-6 && is_free(&guard, &from, &way), "{off_m} m, {off_rad} rad");
    }

    #[test]
    fn what_is_free_is_gone_straight_and_what_is_filled_is_not_gone_to() {
        let arm = arm();
        let around = post(&arm);
        let from = turned(0.0);
        let guard = Guard::from(&arm, &around, &from, CLEARANCE_M);
        let cancel = CancelToken::default();
        assert_eq!(guard.detour(&from, &turned(-1.0), 1, &cancel), Some(vec![turned(-1.0)]));
        assert_eq!(guard.detour(&from, &turned(0.5), 1, &cancel), None);
        let far = Pose::from_isometry(Isometry3::translation(3.0, 0.0, 0.3));
        assert_eq!(guard.detour_to(&from, &far, 1, &cancel), None);
        cancel.cancel();
        assert_eq!(guard.detour(&from, &turned(1.0), 1, &cancel), None);
    }
}
