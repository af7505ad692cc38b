//! Images of a robot that moves, and its poses as they come.

use std::sync::Arc;

use super::contents::Bag;
use crate::conventions::Direction;
use crate::formats::tree;
use crate::recording::{Known, Motion, Role};
use handeye_estimate::handeye::subset;

/// Transforms of one chain that are farther apart in time than this are not interpolated.
const GAP_NS: i64 = 250_000_000;
/// Most images of a motion that are used, and how many of them are consecutive: angles over a third of a second determine
/// the time offset, and views from everywhere the rest.
const MOST: usize = 400;
const NEIGHBOURS: usize = 300;
/// No two of them are nearer in time than this.
const APART_NS: i64 = 50_000_000;
/// Fewer images do not determine an offset.
const LEAST: usize = 60;

/// The poses of every frame that may be the tip, and of every topic of poses, in motion.
pub(super) fn motions(bag: &Bag, file: &str) -> Vec<Motion> {
    let mut out = Vec::new();
    for tip in bag.frames.tips() {
        let root = bag.frames.root_of(&tip);
        let at = |stamp: i64| Some((stamp, bag.frames.root_from_in_motion(&tip, stamp, GAP_NS)?));
        let why = format!("the tree of frames: {tip} in {root}");
        out.push(Motion {
            name: format!("{file}:tf:{root}->{tip}"),
            role: Role::Robot,
            direction: Some(Known::by(why, Direction::Forward)),
            poses: Arc::new(bag.frames.stamps_of(&tip).into_iter().filter_map(at).collect()),
        });
    }
    for (topic, moving) in &bag.poses {
        let mut poses = moving.clone();
        poses.dedup_by_key(|(stamp, _)| *stamp);
        let (name, role) = (format!("{file}:{topic}"), tree::role(topic));
        out.push(Motion { name, role, direction: None, poses: Arc::new(poses) });
    }
    out.retain(|motion| motion.poses.len() >= LEAST);
    out
}

/// The timestamps of the images to use, in order; none where there are too few of them, or no robot at these times.
pub(super) fn chosen(stamps: &[i64], motions: &[Motion]) -> Vec<i64> {
    let mut apart: Vec<i64> = Vec::new();
    for stamp in stamps {
        if apart.last().is_none_or(|last| stamp.saturating_sub(*last) >= APART_NS) {
            apart.push(*stamp);
        }
    }
    if apart.len() < LEAST || motions.iter().all(|motion| motion.role == Role::Target) {
        return Vec::new();
    }
    if apart.len() <= MOST {
        return apart;
    }
    let start = (apart.len() - NEIGHBOURS) / 2;
    let mut chosen: Vec<i64> = apart[start..start + NEIGHBOURS].to_vec();
    chosen.extend(subset::spread(apart.len(), MOST - NEIGHBOURS).into_iter().map(|i| apart[i]));
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}
