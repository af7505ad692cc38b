//! The tree of frames, as tf's messages build it.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Isometry3;

use crate::drivers::interpolate::{Samples, between};

/// Most frames of a tree; more are not taken.
const MOST_FRAMES: usize = 2000;
/// Frames of a chain are no more than this, so that a loop ends.
const LONGEST_CHAIN: usize = 200;

#[derive(Debug)]
struct Link {
    parent: String,
    is_static: bool,
    parent_from_child: Samples<Isometry3<f64>>,
}

/// Which frame hangs on which, and where.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// By the name of the child.
    links: BTreeMap<String, Link>,
}

/// Why there is no pose of one frame in another.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum NoChain {
    /// No message has named it.
    #[error("tf has no frame {0:?}")]
    NoFrame(String),
    /// They hang on different roots.
    #[error("tf has no chain from {base:?} to {tip:?}: one hangs on {root_of_base:?}, the other on {root_of_tip:?}")]
    Apart {
        /// Asked for.
        base: String,
        /// Asked for.
        tip: String,
        /// Where its chain begins.
        root_of_base: String,
        /// Where its chain begins.
        root_of_tip: String,
    },
    /// There is a chain, and no instant at which all of it is known.
    #[error("the transforms between {base:?} and {tip:?} have no instant in common")]
    NoInstant {
        /// Asked for.
        base: String,
        /// Asked for.
        tip: String,
    },
}

impl Tree {
    /// Takes a transform. False when there is no room for it.
    pub fn insert(&mut self, parent: &str, child: &str, stamp_s: f64, pose: Isometry3<f64>, is_static: bool) -> bool {
        let (parent, child) = (name(parent), name(child));
        if !self.links.contains_key(child) && self.links.len() >= MOST_FRAMES {
            return false;
        }
        let new = || Link { parent: parent.to_owned(), is_static, parent_from_child: Samples::default() };
        let link = self.links.entry(child.to_owned()).or_insert_with(new);
        if link.parent != parent || link.is_static != is_static {
            *link = new();
        }
        if is_static {
            link.parent_from_child.clear();
        }
        link.parent_from_child.push(stamp_s, pose);
        true
    }

    /// All frames with the one that they hang on, one a line, roots first.
    pub fn describe(&self) -> String {
        const MOST: usize = 60;
        let mut children: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (child, link) in &self.links {
            children.entry(&link.parent).or_default().push(child);
        }
        let roots = children.keys().filter(|parent| !self.links.contains_key(**parent));
        let mut lines = Vec::new();
        let mut rest: VecDeque<(&str, usize)> = roots.map(|root| (*root, 0)).collect();
        while let Some((frame, depth)) = rest.pop_front() {
            if lines.len() == MOST {
                lines.push(format!("and {} more", self.links.len().saturating_sub(MOST)));
                break;
            }
            lines.push(format!("{}{frame}", "  ".repeat(depth)));
            if depth < LONGEST_CHAIN {
                for child in children.get(frame).into_iter().flatten().rev() {
                    rest.push_front((*child, depth + 1));
                }
            }
        }
        lines.join("\n")
    }

    /// The newest instant at which the whole chain is known, and `base_from_tip` then. The instant is `None` where
    /// nothing of the chain moves.
    ///
    /// # Errors
    /// [`NoChain`]
    pub fn newest(&self, base: &str, tip: &str) -> Result<(Option<f64>, Isometry3<f64>), NoChain> {
        self.newest_until(base, tip, f64::INFINITY)
    }

    /// As [`Self::newest`], not after an instant.
    pub fn newest_until(&self, base: &str, tip: &str, limit_s: f64) -> Result<(Option<f64>, Isometry3<f64>), NoChain> {
        let (base, tip) = (name(base), name(tip));
        let (of_base, of_tip) = (self.to_root(base)?, self.to_root(tip)?);
        let root = |chain: &[&str]| chain.last().copied().unwrap_or_default().to_owned();
        let shared = of_tip.iter().find_map(|frame| of_base.iter().position(|other| other == frame));
        let Some(shared) = shared else {
            let (root_of_base, root_of_tip) = (root(&of_base), root(&of_tip));
            return Err(NoChain::Apart { base: base.into(), tip: tip.into(), root_of_base, root_of_tip });
        };
        let ancestor = of_base[shared];
        let up = &of_base[..shared];
        let down: Vec<_> = of_tip.iter().copied().take_while(|frame| *frame != ancestor).collect();
        let moving =
            || up.iter().chain(&down).filter_map(|frame| self.links.get(*frame)).filter(|link| !link.is_static);
        let latest = moving().filter_map(|link| link.parent_from_child.last_s()).reduce(f64::min);
        let instant = latest.map(|latest| latest.min(limit_s));
        let product = |frames: &[&str]| {
            frames.iter().try_fold(Isometry3::identity(), |child_from_tip, frame| {
                let link = self.links.get(*frame)?;
                let pose = if link.is_static {
                    link.parent_from_child.last().copied()
                } else {
                    link.parent_from_child.at(instant?, between)
                };
                Some(pose? * child_from_tip)
            })
        };
        let (Some(ancestor_from_base), Some(ancestor_from_tip)) = (product(up), product(&down)) else {
            return Err(NoChain::NoInstant { base: base.into(), tip: tip.into() });
        };
        Ok((instant, ancestor_from_base.inverse() * ancestor_from_tip))
    }

    /// The frame, what it hangs on, and so on.
    fn to_root<'a>(&'a self, frame: &'a str) -> Result<Vec<&'a str>, NoChain> {
        if !self.links.contains_key(frame) && !self.links.values().any(|link| link.parent == frame) {
            return Err(NoChain::NoFrame(frame.to_owned()));
        }
        let mut chain = vec![frame];
        let mut last = frame;
        while let Some(link) = self.links.get(last) {
            if chain.len() == LONGEST_CHAIN {
                break;
            }
            last = &link.parent;
            chain.push(last);
        }
        Ok(chain)
    }
}

/// ROS 1 wrote some names with a slash in front.
fn name(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    use super::*;

    fn at(x: f64, turn_deg: f64) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::z() * turn_deg.to_radians());
        Isometry3::from_parts(Translation3::new(x, 0.0, 0.0), rotation)
    }

    fn tree() -> Tree {
        let mut tree = Tree::default();
        tree.insert("/world", "base_link", 0.0, at(5.0, 90.0), true);
        tree.insert("base_link", "link_1", 10.0, at(1.0, 0.0), false);
        tree.insert("base_link", "link_1", 10.2, at(1.0, 20.0), false);
        tree.insert("link_1", "tool0", 10.1, at(0.5, 0.0), false);
        tree.insert("world", "camera", 0.0, at(0.0, 0.0), true);
        tree
    }

    #[test]
    fn the_pose_is_of_the_newest_instant_at_which_every_link_is_known() {
        let (instant, pose) = tree().newest("base_link", "tool0").expect("a chain");
        assert!((instant.expect("it moves") - 10.1).abs() < 1e-12);
        let expected = at(1.0, 10.0) * at(0.5, 0.0);
        assert!((pose.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-12);
    }

    #[test]
    fn a_chain_may_lead_up_and_down_and_may_stand_still() {
        let tree = tree();
        let (instant, pose) = tree.newest("camera", "base_link").expect("a chain");
        assert_eq!(instant, None);
        assert!((pose.to_homogeneous() - at(5.0, 90.0).to_homogeneous()).amax() < 1e-12);
        let (_, inverse) = tree.newest("base_link", "camera").expect("a chain");
        assert!(((inverse * pose).to_homogeneous() - Isometry3::<f64>::identity().to_homogeneous()).amax() < 1e-12);
    }

    #[test]
    fn what_is_missing_is_named() {
        let mut tree = tree();
        assert_eq!(tree.newest("base", "tool0"), Err(NoChain::NoFrame("base".into())));
        tree.insert("map", "odom", 1.0, at(0.0, 0.0), true);
        assert_eq!(
            tree.newest("tool0", "odom").expect_err("apart").to_string(),
            "tf has no chain from \"tool0\" to \"odom\": one hangs on \"world\", the other on \"map\""
        );
        assert_eq!(tree.describe(), "map\n  odom\nworld\n  base_link\n    link_1\n      tool0\n  camera");
    }

    #[test]
    fn a_loop_of_frames_ends() {
        let mut tree = Tree::default();
        tree.insert("a", "b", 1.0, at(0.0, 0.0), false);
        tree.insert("b", "a", 1.0, at(0.0, 0.0), false);
        drop(tree.newest("a", "b"));
        assert!(tree.newest("a", "c").is_err());
        tree.describe();
    }

    #[test]
    fn ten_thousand_frames_are_not_all_kept() {
        let mut tree = Tree::default();
        let taken = (0..10_000).filter(|i| tree.insert("world", &format!("f{i}"), 0.0, at(0.0, 0.0), true)).count();
        assert_eq!(taken, MOST_FRAMES);
    }
}
