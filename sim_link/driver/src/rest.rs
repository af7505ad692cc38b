//! Whether an arm is at rest, by its states only: a controller that reports `done` may have been commanded by another program in
//! the meantime, or mean that it has read the command.

use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Pose, Tip};

/// How long an arm at rest has not moved \[s\]: two states at the lowest rate of the protocol.
pub const REST_S: f64 = 0.2;
/// Largest difference of joints [rad, m] and tip [m, rad] of an arm at rest from state to state: noise of encoders.
const REST: f64 = 5e-4;

/// An arm at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// When \[s\].
    pub stamp_s: f64,
    /// The joints, where they are known.
    pub joints: Option<JointValues>,
    /// The pose of the TCP.
    pub base_from_tip: Pose<Base, Tip>,
}

/// How an arm moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Moved {
    /// The joint that moved most.
    Joint {
        /// Counted from 0 at the base.
        index: usize,
        /// Start [rad, or m].
        from: f64,
        /// End.
        to: f64,
    },
    /// The tip, for an arm whose joints are not known.
    Tip {
        /// How far \[m\].
        distance_m: f64,
        /// Rotation \[rad\].
        angle_rad: f64,
    },
}

/// Watches an arm from state to state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RestWatch {
    first: Option<Place>,
    /// Since when it has not moved.
    since: Option<Place>,
    newest: Option<Place>,
}

impl RestWatch {
    /// Takes in a state; returns whether the arm has been at rest for [`REST_S`].
    pub fn take(&mut self, place: Place) -> bool {
        self.first.get_or_insert(place);
        self.newest = Some(place);
        let since = match self.since {
            Some(since) if !differs(&since, &place) => since,
            _ => *self.since.insert(place),
        };
        place.stamp_s - since.stamp_s >= REST_S
    }

    /// The arm is known to move: it was not at rest before this.
    pub(crate) fn restart(&mut self) {
        self.since = None;
    }

    /// Whether the newest state is where the one before it was; `None` before the second.
    pub fn is_still(&self) -> Option<bool> {
        let (first, since, newest) = (self.first?, self.since?, self.newest?);
        (newest.stamp_s > first.stamp_s).then_some(newest.stamp_s > since.stamp_s)
    }

    /// The newest state.
    pub fn newest(&self) -> Option<&Place> {
        self.newest.as_ref()
    }

    /// From the first state to the newest.
    pub fn moved(&self) -> Option<Moved> {
        let (from, to) = (self.first?, self.newest?);
        if let (Some(a), Some(b)) = (from.joints, to.joints)
            && a.len() == b.len()
            && !a.is_empty()
        {
            let index = (0..a.len()).max_by(|&i, &j| (a[i] - b[i]).abs().total_cmp(&(a[j] - b[j]).abs()))?;
            return Some(Moved::Joint { index, from: a[index], to: b[index] });
        }
        let (distance_m, angle_rad) = from.base_from_tip.distance_to(&to.base_from_tip);
        Some(Moved::Tip { distance_m, angle_rad })
    }
}

/// Compares the joints, or the tip where they are not known.
fn differs(a: &Place, b: &Place) -> bool {
    match (&a.joints, &b.joints) {
        (Some(a), Some(b)) if !a.is_empty() => a.len() != b.len() || a.iter().zip(b).any(|(a, b)| (a - b).abs() > REST),
        _ => {
            let (distance_m, angle_rad) = a.base_from_tip.distance_to(&b.base_from_tip);
            distance_m > REST || angle_rad > REST
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(stamp_s: f64, joint: f64) -> Place {
        Place { stamp_s, joints: Some([0.0, joint].into()), base_from_tip: Pose::identity() }
    }

    #[test]
    fn an_arm_that_stands_has_not_moved_for_a_while_and_one_that_creeps_does_not_stand() {
        let mut watch = RestWatch::default();
        assert!(!watch.take(place(0.0, 0.5)) && watch.is_still().is_none(), "one state says nothing");
        assert!(!watch.take(place(0.1, 0.6)) && watch.is_still() == Some(false));
        assert!(!watch.take(place(0.2, 0.6)) && watch.is_still() == Some(true));
        assert!(watch.take(place(0.31, 0.6)));
        assert_eq!(watch.moved(), Some(Moved::Joint { index: 1, from: 0.5, to: 0.6 }));
        // A thousandth a state is a twentieth of a radian a second.
        let mut watch = RestWatch::default();
        assert!((0..500).all(|i| !watch.take(place(0.02 * f64::from(i), 1e-3 * f64::from(i)))));
    }
}
