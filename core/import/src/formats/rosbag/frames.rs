//! The tree of frames of a bag.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use super::contents::{MOST_MESSAGES, Timed, between, nearest};

/// Frames of the largest robots, many times over; and most of them that may be the tip.
const MOST_FRAMES: usize = 10_000;
const MOST_TIPS: usize = 8;

/// A frame in its parent.
struct Link {
    parent: String,
    is_static: bool,
    parent_from_frame: Timed<Isometry3<f64>>,
}

/// Frames by their name.
#[derive(Default)]
pub(super) struct Frames(BTreeMap<String, Link>);

impl Frames {
    pub fn add(&mut self, parent: &str, child: &str, is_static: bool, stamp: i64, parent_from_child: Isometry3<f64>) {
        let (parent, child) = (parent.trim_start_matches('/'), child.trim_start_matches('/'));
        if self.0.len() >= MOST_FRAMES && !self.0.contains_key(child) {
            return;
        }
        let new = || Link { parent: parent.to_owned(), is_static, parent_from_frame: Vec::new() };
        let frame = self.0.entry(child.to_owned()).or_insert_with(new);
        parent.clone_into(&mut frame.parent);
        if frame.parent_from_frame.len() < MOST_MESSAGES {
            frame.parent_from_frame.push((stamp, parent_from_child));
        }
    }

    pub fn sort(&mut self) {
        for frame in self.0.values_mut() {
            frame.parent_from_frame.sort_by_key(|(stamp, _)| *stamp);
        }
    }

    /// The poses in its parent of every frame that is not stated to be static.
    pub fn moving(&self) -> impl Iterator<Item = &Timed<Isometry3<f64>>> {
        self.0.values().filter(|frame| !frame.is_static).map(|frame| &frame.parent_from_frame)
    }

    /// A frame and its ancestors, up to the root; they end where frames form a cycle.
    fn upwards<'a>(&'a self, name: &'a str) -> impl Iterator<Item = (&'a str, &'a Link)> {
        let of = |name: &'a str| self.0.get(name).map(|frame| (name, frame));
        std::iter::successors(of(name), move |(_, frame)| of(&frame.parent)).take(self.0.len() + 1)
    }

    pub fn root_of(&self, name: &str) -> String {
        self.upwards(name).last().map_or(name, |(_, frame)| frame.parent.as_str()).to_owned()
    }

    /// Pose of a frame in the root, by the transforms nearest in time; `None` where one is not near enough, and in a
    /// cycle.
    pub fn root_from(&self, name: &str, stamp: i64, within_ns: i64) -> Option<Isometry3<f64>> {
        self.composed(name, |poses| nearest(poses, stamp, within_ns).copied())
    }

    /// As [`root_from`](Self::root_from), for a moving frame: interpolated between the transforms before and after.
    pub fn root_from_in_motion(&self, name: &str, stamp: i64, within_ns: i64) -> Option<Isometry3<f64>> {
        self.composed(name, |poses| interpolated(poses, stamp, within_ns))
    }

    fn composed(
        &self,
        name: &str,
        of: impl Fn(&Timed<Isometry3<f64>>) -> Option<Isometry3<f64>>,
    ) -> Option<Isometry3<f64>> {
        let mut pose = Isometry3::identity();
        for (count, (_, frame)) in self.upwards(name).enumerate() {
            // More frames than there are: a circle.
            if count == self.0.len() {
                return None;
            }
            let own = if frame.is_static {
                frame.parent_from_frame.last().map(|(_, pose)| *pose)
            } else {
                of(&frame.parent_from_frame)
            };
            pose = own? * pose;
        }
        Some(pose)
    }

    /// Times at which a moving frame is known: the timestamps of the one among it and its ancestors that has most.
    pub fn stamps_of(&self, name: &str) -> Vec<i64> {
        let moving =
            self.upwards(name).filter(|(_, frame)| !frame.is_static).map(|(_, frame)| &frame.parent_from_frame);
        let most = moving.max_by_key(|poses| poses.len());
        let mut stamps: Vec<i64> = most.into_iter().flatten().map(|(stamp, _)| *stamp).collect();
        stamps.dedup();
        stamps
    }

    fn moves(&self, name: &str) -> bool {
        self.upwards(name).any(|(_, frame)| {
            let poses = &frame.parent_from_frame;
            !frame.is_static && poses.iter().any(|(_, pose)| *pose != poses[0].1)
        })
    }

    /// Frames that may be the tip: those that are called so, and the last that moves in its parent.
    pub fn tips(&self) -> Vec<String> {
        const NAMES: [&str; 9] = ["tool", "flange", "tcp", "ee", "tip", "hand", "gripper", "effector", "wrist_3"];
        let is_called = |name: &str| {
            let name = name.to_lowercase();
            NAMES.iter().any(|tip| name.split(['_', '/', '-']).any(|w| w.starts_with(tip)) || name.contains("wrist_3"))
        };
        let is_last = |name: &str| {
            let below = self.0.values().any(|frame| frame.parent == name && !frame.is_static);
            self.0.get(name).is_some_and(|frame| !frame.is_static) && !below
        };
        let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<String> {
            self.0.keys().filter(|name| self.moves(name) && wanted(name)).take(MOST_TIPS).cloned().collect()
        };
        let called = of(&is_called);
        if called.is_empty() { of(&is_last) } else { called }
    }
}

fn interpolated(poses: &[(i64, Isometry3<f64>)], stamp: i64, within_ns: i64) -> Option<Isometry3<f64>> {
    let near = between(poses, stamp.saturating_sub(within_ns), stamp.saturating_add(within_ns));
    let next = near.partition_point(|(other, _)| *other < stamp);
    let (after_ns, after) = near.get(next)?;
    if *after_ns == stamp {
        return Some(*after);
    }
    let (before_ns, before) = near.get(next.checked_sub(1)?)?;
    let part = (stamp - before_ns) as f64 / (after_ns - before_ns) as f64;
    before.try_lerp_slerp(after, part, 1e-9)
}
