//! Gross hypotheses: poses inverted or in another unit of length or of angles, quaternion order, camera elsewhere, images and poses out of step.
//!
//! Each is a change of the reported poses. Under each the closed forms are solved anew, and the distance between where
//! the chain puts the board and where the camera saw it is compared: it is measured on the camera's side, in millimetres,
//! so it means the same under all of them.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion};

use super::agreement::{Agreement, agreement, pairs_of};
use super::pairing::{self, Pairing};
use super::views::SessionViews;
use crate::diagnose::findings::FindingCode;
use crate::handeye::{HandEyeError, subset};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::Work;

/// Views that are looked at: enough for any gross fault.
const MOST_VIEWS: usize = 24;
/// Least views: with three any hypothesis fits half of them.
pub(super) const NEED: usize = 4;
/// A misfit below this part of the board's distance is no gross fault: arms that are off by 3 mm half a metre away stay below.
const SOUND: f64 = 0.01;
/// A hypothesis that explains the poses leaves less than this part of the board's distance, which is ten times what such arms
/// leave.
const EXPLAINED: f64 = 0.05;
/// And so many times less than the poses as they are. By the three together no gross fault was accused in 3,000 healthy
/// simulated sessions, and those that were injected are found (`docs/studies/diagnosis.md`).
pub(super) const TIMES: f64 = 3.0;
/// Hypotheses within this factor of the best count as equal; the simplest of them is taken. Two that are the same equations
/// differ by rounding.
const TIE: f64 = 1.5;

/// How the numbers of a quaternion were mixed up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    /// The file has w x y z and was read as x y z w.
    WFirst,
    /// The file has x y z w and was read as w x y z.
    WLast,
}

/// How the angles of rotations were written that are in radians and were read as degrees. The other way round the table is refused:
/// degrees are soon more than the two turns that a controller reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Angles {
    /// Axis times angle.
    Vector,
    /// Roll, pitch and yaw.
    Rpy,
}

/// Turns of radians that were read as degrees are no larger, radians: three angles of half a turn each.
const LARGEST_OF_DEGREES: f64 = 3.0 * std::f64::consts::PI * std::f64::consts::PI / 180.0;

/// Factors by which lengths of different units differ, besides the thousand: powers of ten, and the millimetres and metres of an inch.
const OTHER_UNITS: [f64; 8] = [0.1, 10.0, 1e-2, 1e2, 25.4, 1.0 / 25.4, 0.0254, 1.0 / 0.0254];

/// A change of the reported poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    inverted: bool,
    order: Option<Order>,
    /// The quaternion was mixed up before the pose was inverted on reading.
    order_in_inverse: bool,
    /// Degrees are radians.
    angles: Option<Angles>,
    /// Factor on all lengths.
    pub unit: f64,
    /// Which row of the table each image belongs to.
    pub pairing: Pairing,
}

impl Change {
    pub const NONE: Self = Self {
        inverted: false,
        order: None,
        order_in_inverse: false,
        angles: None,
        unit: 1.0,
        pairing: Pairing::AsGiven,
    };

    /// Number of things changed.
    fn count(&self) -> usize {
        usize::from(self.inverted)
            + usize::from(self.order.is_some())
            + usize::from(self.angles.is_some())
            + usize::from(self.unit != 1.0)
            + usize::from(self.pairing != Pairing::AsGiven)
    }

    /// What is said of the poses, the gravest first.
    pub fn codes(&self) -> Vec<FindingCode> {
        let mut codes = Vec::new();
        if self.inverted {
            codes.push(FindingCode::InvertedPoses);
        }
        if self.order.is_some() {
            codes.push(FindingCode::WrongQuaternionOrder);
        }
        if self.angles.is_some() {
            codes.push(FindingCode::WrongAngleUnit);
        }
        if self.unit != 1.0 {
            codes.push(FindingCode::WrongLengthUnit);
        }
        if self.pairing != Pairing::AsGiven {
            codes.push(FindingCode::ShiftedPoses);
        }
        codes
    }

    pub fn w_first(&self) -> bool {
        self.order == Some(Order::WFirst)
    }

    fn of_pose(&self, pose: &Pose<Base, Tip>) -> Pose<Base, Tip> {
        let pose = *pose.isometry();
        let written = if self.order_in_inverse { pose.inverse() } else { pose };
        let written = self.order.map_or(written, |order| reordered(&written, order));
        let written = self.angles.map_or(written, |angles| in_radians(&written, angles));
        let mut pose = if self.order_in_inverse { written.inverse() } else { written };
        pose.translation.vector *= self.unit;
        Pose::from_isometry(if self.inverted { pose.inverse() } else { pose })
    }
}

/// Undoes a wrong order of the quaternion's numbers.
fn reordered(pose: &Isometry3<f64>, order: Order) -> Isometry3<f64> {
    let q = pose.rotation.coords;
    // `coords` are x y z w; `Quaternion::new` takes w first.
    let q = match order {
        Order::WFirst => Quaternion::new(q.x, q.y, q.z, q.w),
        Order::WLast => Quaternion::new(q.z, q.w, q.x, q.y),
    };
    Isometry3::from_parts(pose.translation, UnitQuaternion::from_quaternion(q))
}

/// The pose of which the angles were read as degrees and are radians.
fn in_radians(pose: &Isometry3<f64>, angles: Angles) -> Isometry3<f64> {
    let rotation = match angles {
        Angles::Vector => UnitQuaternion::from_scaled_axis(pose.rotation.scaled_axis() * 1f64.to_degrees()),
        Angles::Rpy => {
            let (roll, pitch, yaw) = pose.rotation.euler_angles();
            UnitQuaternion::from_euler_angles(roll.to_degrees(), pitch.to_degrees(), yaw.to_degrees())
        }
    };
    Isometry3::from_parts(pose.translation, rotation)
}

/// Every change that is tried.
fn changes(sight: &SessionViews) -> Vec<Change> {
    let mut all = changes_of_poses();
    let is_small = |view: &super::views::SessionView| view.base_from_tip.rotation().angle() < LARGEST_OF_DEGREES;
    if sight.views.iter().all(is_small) {
        all.extend(changes_of_angles());
    }
    all.extend(Pairing::all(sight).into_iter().map(|pairing| Change { pairing, ..Change::NONE }));
    all.sort_by_key(Change::count);
    all
}

/// Every way in which single poses may have been misread.
fn changes_of_poses() -> Vec<Change> {
    let mut all = Vec::new();
    let orders = [
        (None, false),
        (Some(Order::WFirst), false),
        (Some(Order::WLast), false),
        (Some(Order::WFirst), true),
        (Some(Order::WLast), true),
    ];
    for unit in [1.0, 1e-3, 1e3] {
        for inverted in [false, true] {
            for (order, order_in_inverse) in orders {
                all.push(Change { inverted, order, order_in_inverse, unit, ..Change::NONE });
            }
        }
    }
    all.retain(|c| *c != Change::NONE);
    all.extend(OTHER_UNITS.map(|unit| Change { unit, ..Change::NONE }));
    all
}

/// The ways in which radians may have been read as degrees.
fn changes_of_angles() -> Vec<Change> {
    let mut all = Vec::new();
    for angles in [Angles::Vector, Angles::Rpy] {
        for unit in [1.0, 1e-3, 1e3] {
            for inverted in [false, true] {
                for order_in_inverse in [false, true] {
                    all.push(Change { angles: Some(angles), unit, inverted, order_in_inverse, ..Change::NONE });
                }
            }
        }
    }
    all
}

/// A change and what it leaves.
pub(super) struct Tried {
    pub change: Change,
    pub agreement: Agreement,
}

/// What was tried.
pub(super) struct Gross {
    /// The poses as they are.
    pub as_given: Result<Agreement, HandEyeError>,
    /// The changes, the best first.
    pub tried: Vec<Tried>,
    /// Whether the first of them explains the data and the poses as they are do not.
    pub accused: bool,
    /// Views looked at.
    pub views: usize,
}

/// Tries everything. `None` when it was cancelled.
pub(super) fn gross(sight: &SessionViews, work: &Work<'_>) -> Option<Gross> {
    let as_given = solve(sight, &Change::NONE, true);
    let given_m = as_given.as_ref().map_or(f64::INFINITY, |a| a.median_m);
    let sound = given_m < SOUND * sight.distance_m;
    let mut tried = Vec::new();
    for change in changes(sight) {
        if work.is_cancelled() {
            return None;
        }
        if let Ok(agreement) = solve(sight, &change, !sound) {
            tried.push(Tried { change, agreement });
        }
    }
    tried.sort_by(|a, b| a.agreement.median_m.total_cmp(&b.agreement.median_m));
    if let Some(best_m) = tried.first().map(|t| t.agreement.median_m) {
        let near = tried.iter().take_while(|t| t.agreement.median_m <= TIE * best_m).count();
        tried[..near].sort_by_key(|t| t.change.count());
    }
    let views = sight.views.len();
    let explains = |so_m: f64, given_m: f64| so_m < EXPLAINED * sight.distance_m && TIMES * so_m < given_m;
    let mut accused = views >= NEED && !sound && tried.first().is_some_and(|t| explains(t.agreement.median_m, given_m));
    // Half of the views may be in step and the other half not: the median says nothing of the rest.
    if !accused && let Some(stepped) = stepped(sight, as_given.as_ref().ok()) {
        tried.insert(0, stepped);
        accused = true;
    }
    Some(Gross { as_given, tried, accused, views })
}

/// A step in the pairing of images and poses that explains what the poses as they are leave; `None` when there is none.
fn stepped(sight: &SessionViews, as_given: Option<&Agreement>) -> Option<Tried> {
    let wrong_m = SOUND * sight.distance_m;
    let given = as_given.map(|agreement| &agreement.solution);
    if pairing::wrong(sight, Pairing::AsGiven, given, wrong_m).len() < pairing::LEAST_BESIDE {
        return None;
    }
    let change = Change { pairing: pairing::best_step(sight)?, ..Change::NONE };
    let agreement = solve(sight, &change, true).ok()?;
    let explained = pairing::explains(sight, change.pairing, given, &agreement.solution, wrong_m);
    explained.then_some(Tried { change, agreement })
}

/// The views with a changed robot pose, and what they agree on.
fn solve(sight: &SessionViews, change: &Change, thorough: bool) -> Result<Agreement, HandEyeError> {
    let count = sight.views.len();
    let pose_of = |i: usize| Some(change.of_pose(&change.pairing.pose_of(sight, i)?));
    let all: Vec<Pose<Base, Tip>> = (0..count).map(|i| pose_of(i).unwrap_or_else(Pose::identity)).collect();
    let pairs = pairs_of(sight, &all);
    let most = if *change == Change::NONE { usize::MAX } else { MOST_VIEWS };
    let chosen: Vec<_> = subset::spread(count, most).into_iter().filter(|i| pose_of(*i).is_some()).collect();
    let chosen: Vec<_> = chosen.into_iter().map(|i| pairs[i]).collect();
    agreement(&sight.outer, &chosen, thorough)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use handeye_geometry::se3;

    #[test]
    fn a_mixed_up_quaternion_is_put_right_in_both_orders() {
        let truth = se3::exp(&Vector6::new(0.3, -0.2, 0.5, 0.7, -0.4, 0.2));
        let q = truth.rotation.coords;
        let read_w_first = Quaternion::new(q.z, q.w, q.x, q.y);
        let read_w_last = Quaternion::new(q.x, q.y, q.z, q.w);
        for (order, read) in [(Order::WFirst, read_w_first), (Order::WLast, read_w_last)] {
            let wrong = Isometry3::from_parts(truth.translation, UnitQuaternion::from_quaternion(read));
            assert!(reordered(&wrong, order).rotation.angle_to(&truth.rotation) < 1e-12, "{order:?}");
        }
    }

    #[test]
    fn the_changes_are_all_different() {
        let all = changes_of_poses();
        assert_eq!(all.len(), 29 + OTHER_UNITS.len());
        for (i, change) in all.iter().enumerate() {
            assert!(!all[..i].contains(change), "{change:?}");
        }
    }
}
