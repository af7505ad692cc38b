//! What an arm would come too close to, at a configuration and along a path.

use nalgebra::Point3;

use super::capsule::Capsule;
use super::clearance::{Arm, Filled, SELF_CLEARANCE_M};
use super::surroundings::{Obstacle, Surroundings};
use super::travel;
use handeye_wording::Text;
use handeye_wording::text;

/// Between two checked configurations of a path nothing comes closer than allowed by more than half of this, metres.
const PATH_GAP_M: f64 = 0.01;
/// Parts of a path over which the speed of the tip is checked: with 48 it was more than 1 % too fast between two of them on one
/// move in 200.
const SPEED_SAMPLES: usize = 320;

/// Tolerance with which the start configuration of a motion is allowed, metres: rounding.
const ROUNDING_M: f64 = 1e-9;

/// What is too close.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum Contact {
    /// An obstacle.
    #[error("the arm, or what it carries, would come too near to {name:?}: go another way")]
    Box {
        /// Its name in the file of the surroundings.
        name: String,
    },
    /// The arm itself, or what is mounted on its tip.
    #[error("the arm would touch itself, or what it carries: go another way")]
    Itself,
    /// The end of the work volume.
    #[error("tip or camera would leave the work volume: go another way, or make the volume larger")]
    Volume,
    /// Values that are not those of its joints.
    #[error("these are not values of the arm's joints")]
    NoConfiguration,
}

impl Contact {
    /// What is at the place of the arm, in words that ask a person to move it away.
    pub fn here(&self) -> Text {
        match self {
            Self::Box { name } => text!("too near to “{name}”", name = name),
            Self::Itself => text!("too near to itself or to what it carries"),
            Self::Volume => text!("outside of the work volume with its tip or camera"),
            Self::NoConfiguration => text!("at values that are not those of its joints"),
        }
    }
}

/// Smallest allowed distance from each thing, metres.
#[derive(Debug)]
struct Allowed {
    itself: f64,
    volume: f64,
    /// The distance from each obstacle, in their order.
    boxes: Vec<f64>,
}

/// An arm and its surroundings, with the allowed distance from each thing: the clearance or, where it begins closer than
/// that, the distance at the start. So it can always move away from what it touches.
#[derive(Debug)]
pub struct Guard<'a> {
    arm: &'a Arm,
    around: &'a Surroundings,
    allowed: Allowed,
}

impl Allowed {
    fn all(around: &Surroundings, clearance_m: f64) -> Self {
        Self { itself: SELF_CLEARANCE_M, volume: 0.0, boxes: vec![clearance_m; around.obstacles.len()] }
    }
}

impl<'a> Guard<'a> {
    /// The guard of a motion that begins at these joint values, with this clearance, metres.
    pub fn from(arm: &'a Arm, around: &'a Surroundings, joints: &[f64], clearance_m: f64) -> Self {
        let mut allowed = Allowed::all(around, clearance_m);
        if let Some(filled) = arm.filled(joints) {
            allowed.itself = allowed.itself.min(filled.itself_m);
            allowed.volume = allowed.volume.min(filled.depth_m(around));
            for (allowed_m, obstacle) in allowed.boxes.iter_mut().zip(&around.obstacles) {
                *allowed_m = allowed_m.min(filled.distance_m(obstacle, *allowed_m));
            }
        }
        Self { arm, around, allowed }
    }

    /// The guard of a plan, which has to keep the whole clearance everywhere.
    pub fn strict(arm: &'a Arm, around: &'a Surroundings, clearance_m: f64) -> Self {
        Self { arm, around, allowed: Allowed::all(around, clearance_m) }
    }

    pub(super) fn arm(&self) -> &'a Arm {
        self.arm
    }

    /// The surroundings.
    pub fn surroundings(&self) -> &Surroundings {
        self.around
    }

    /// What the arm is too close to with these joint values.
    pub fn contact(&self, joints: &[f64]) -> Option<Contact> {
        self.room(joints, 0.0).err()
    }

    /// What the arm comes too close to on the straight path in joint space, its ends excluded. Checked along its whole
    /// length, in steps that are shorter the closer something is.
    pub fn contact_on_path(&self, from: &[f64], to: &[f64]) -> Option<Contact> {
        let longest_m = self.arm.longest_way_m(from, to);
        if !longest_m.is_finite() {
            return Some(Contact::NoConfiguration);
        }
        let at = |part: f64| -> Vec<f64> { from.iter().zip(to).map(|(from, to)| from + part * (to - from)).collect() };
        // One shortest step from its beginning.
        let mut part = PATH_GAP_M / longest_m.max(PATH_GAP_M);
        while part < 1.0 {
            match self.room(&at(part), f64::INFINITY) {
                Ok(room_m) => part += room_m.max(PATH_GAP_M) / longest_m.max(PATH_GAP_M),
                Err(contact) => return Some(contact),
            }
        }
        None
    }

    /// What is nearest to the arm with these joint values, and how much closer it may come to that, metres: less than 0 where it
    /// is too close. Only things with less than `within_m` left are searched for; `None` where there are none.
    pub fn nearest(&self, joints: &[f64], within_m: f64) -> Option<(f64, Contact)> {
        let Some(filled) = self.arm.filled(joints) else { return Some((f64::NEG_INFINITY, Contact::NoConfiguration)) };
        let mut least_m = within_m;
        let mut next = None;
        let mut look = |room_m: f64, at: Nearby| {
            if room_m < least_m {
                (least_m, next) = (room_m, Some(at));
            }
            least_m
        };
        look(filled.itself_m - self.allowed.itself, Nearby::Itself);
        let mut room_m = look(filled.depth_m(self.around) - self.allowed.volume, Nearby::Volume);
        for (index, (obstacle, allowed_m)) in self.around.obstacles.iter().zip(&self.allowed.boxes).enumerate() {
            let distance_m = filled.distance_m(obstacle, allowed_m + room_m.max(0.0));
            room_m = look(distance_m - allowed_m, Nearby::Box(index));
        }
        let contact = match next? {
            Nearby::Itself => Contact::Itself,
            Nearby::Volume => Contact::Volume,
            Nearby::Box(index) => Contact::Box { name: self.around.obstacles[index].name.clone() },
        };
        Some((least_m, contact))
    }

    /// How much closer the arm may come to what is nearest, metres, at most `up_to_m`; or what is too close.
    fn room(&self, joints: &[f64], up_to_m: f64) -> Result<f64, Contact> {
        match self.nearest(joints, up_to_m) {
            Some((room_m, contact)) if room_m < -ROUNDING_M => Err(contact),
            Some((room_m, _)) => Ok(room_m),
            None => Ok(up_to_m),
        }
    }
}

/// The candidates for the nearest thing.
#[derive(Clone, Copy)]
enum Nearby {
    Itself,
    Volume,
    /// A box, by its place among the obstacles.
    Box(usize),
}

impl Filled {
    /// How far tip and camera are inside the work volume, metres.
    fn depth_m(&self, around: &Surroundings) -> f64 {
        let Some(volume) = &around.volume else { return f64::INFINITY };
        self.watched.iter().map(|point: &Point3<f64>| volume.depth_m(point)).fold(f64::INFINITY, f64::min)
    }

    /// Distance of the arm from a box, metres, where that is less than `below_m`; otherwise any value that is not.
    fn distance_m(&self, obstacle: &Obstacle, below_m: f64) -> f64 {
        self.moving.iter().fold(f64::INFINITY, |least: f64, capsule: &Capsule| {
            if capsule.at_least_from_box(obstacle) >= least.min(below_m) {
                return least;
            }
            least.min(capsule.distance_to_box(obstacle))
        })
    }
}

impl Arm {
    /// Whether the arm, its tool and what it carries keep their distance from all obstacles and from the arm itself, in the
    /// work volume; values that are not those of its joints are never free.
    pub fn is_free(&self, joints: &[f64], around: &Surroundings, clearance_m: f64) -> bool {
        self.contact(joints, around, clearance_m).is_none()
    }

    /// What keeps [`Self::is_free`] from being true.
    pub fn contact(&self, joints: &[f64], around: &Surroundings, clearance_m: f64) -> Option<Contact> {
        Guard::strict(self, around, clearance_m).contact(joints)
    }

    /// Whether the straight path in joint space between two configurations touches nothing; its ends are not checked.
    pub(crate) fn path_is_free(&self, from: &[f64], to: &[f64], around: &Surroundings, clearance_m: f64) -> bool {
        Guard::strict(self, around, clearance_m).contact_on_path(from, to).is_none()
    }

    /// Largest speed of the joint with the longest motion on the straight path in joint space, rad/s, that keeps the limits of
    /// joints and tip; `wanted_rad_s` where they allow that. A prismatic joint counts like a revolute one.
    pub fn joint_speed(&self, from: &[f64], to: &[f64], around: &Surroundings, wanted_rad_s: f64) -> f64 {
        let speed_rad_s = around.limits.joint(wanted_rad_s);
        let Some(tip_m_s) = around.limits.tip_m_s else { return speed_rad_s };
        let tip = |part: f64| {
            let joints: Vec<f64> = from.iter().zip(to).map(|(from, to)| from + part * (to - from)).collect();
            self.tip(&joints).map(|tip| tip.translation())
        };
        let per_part = 1.0 / SPEED_SAMPLES as f64;
        let fastest_m = (0..SPEED_SAMPLES)
            .filter_map(|k| Some((tip((k as f64 + 1.0) * per_part)? - tip(k as f64 * per_part)?).norm() / per_part))
            .fold(0.0, f64::max);
        if fastest_m > 0.0 { speed_rad_s.min(tip_m_s * travel(from, to) / fastest_m) } else { speed_rad_s }
    }
}

#[cfg(test)]
#[path = "contact_tests.rs"]
mod tests;
