//! Gross hypotheses: poses inverted or in another unit of length or of angles, quaternion order, camera elsewhere, images and
//! poses out of step.
//!
//! Each is a change of the reported poses, tried by the engine of [`hypotheses`](crate::diagnose::hypotheses).

use super::pairing::Pairing;
use super::views::{SessionView, SessionViews};
use crate::diagnose::findings::FindingCode;
use crate::diagnose::hypotheses::agreement::Agreement;
use crate::diagnose::hypotheses::conventions::{AngleUnit, Direction, Euler, LengthUnit, Reading, RotationForm};
use crate::diagnose::hypotheses::{
    self, CLEAR, EXPLAINED, Hypothesis, Score, Search, SeenTarget, Verdict, ranked, sort_by_misfit, steps,
};
use crate::handeye::{HandEyeError, PosePair};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::Work;

/// Most views that are used: enough for any gross fault.
const MOST_VIEWS: usize = 24;
/// Hypotheses within this factor of the best count as equal; the simplest of them is taken.
const TIE: f64 = 1.5;

/// What the numbers of rotations were read as, and what they are.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Misread {
    stated: Reading,
    meant: Reading,
    /// Which way the file has its poses: inverse ones were inverted on reading.
    written: Direction,
}

const fn misread([stated, meant]: [(RotationForm, AngleUnit); 2]) -> Misread {
    const fn reading((rotation, angle): (RotationForm, AngleUnit)) -> Reading {
        Reading { length: LengthUnit::Metre, angle, rotation }
    }
    Misread { stated: reading(stated), meant: reading(meant), written: Direction::Forward }
}

const XYZW: (RotationForm, AngleUnit) = (RotationForm::Xyzw, AngleUnit::Radian);
const WXYZ: (RotationForm, AngleUnit) = (RotationForm::Wxyz, AngleUnit::Radian);
/// The order of quaternions.
const ORDERS: [Misread; 2] = [misread([XYZW, WXYZ]), misread([WXYZ, XYZW])];

/// Rotation vectors, and roll, pitch and yaw, in radians that were read as degrees. The reverse case is refused on reading:
/// degrees soon exceed the two turns that a controller reports.
const ANGLES: [Misread; 2] = [radians(RotationForm::Vector), radians(RotationForm::Euler(Euler::RPY))];

const fn radians(form: RotationForm) -> Misread {
    misread([(form, AngleUnit::Degree), (form, AngleUnit::Radian)])
}

/// Turns of radians that were read as degrees are no larger, radians: three angles of half a turn each.
const LARGEST_OF_DEGREES: f64 = 3.0 * std::f64::consts::PI * std::f64::consts::PI / 180.0;

/// Factors by which lengths of different units differ, other than a thousand: powers of ten, and the millimetres and metres of an
/// inch.
const OTHER_UNITS: [f64; 8] = [0.1, 10.0, 1e-2, 1e2, 25.4, 1.0 / 25.4, 0.0254, 1.0 / 0.0254];

/// A change of the reported poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    direction: Direction,
    misread: Option<Misread>,
    /// Factor on all lengths.
    pub unit: f64,
    /// Which row of the table each image belongs to.
    pub pairing: Pairing,
}

impl Change {
    pub const NONE: Self = Self { direction: Direction::Forward, misread: None, unit: 1.0, pairing: Pairing::AsGiven };

    /// What is wrong with the poses, the gravest first: one code for each thing changed.
    pub fn codes(&self) -> Vec<FindingCode> {
        let of_rotations = |misread: Misread| {
            let is_angles = misread.meant.rotation.has_angles();
            if is_angles { FindingCode::WrongAngleUnit } else { FindingCode::WrongQuaternionOrder }
        };
        let inverted = (self.direction == Direction::Inverse).then_some(FindingCode::InvertedPoses);
        let unit = (self.unit != 1.0).then_some(FindingCode::WrongLengthUnit);
        let shifted = (self.pairing != Pairing::AsGiven).then_some(FindingCode::ShiftedPoses);
        [inverted, self.misread.map(of_rotations), unit, shifted].into_iter().flatten().collect()
    }

    pub fn w_first(&self) -> bool {
        self.misread.is_some_and(|misread| misread.meant.rotation == RotationForm::Wxyz)
    }

    fn of_pose(&self, pose: &Pose<Base, Tip>) -> Option<Pose<Base, Tip>> {
        let mut pose = *pose.isometry();
        if let Some(Misread { stated, meant, written }) = &self.misread {
            pose = written.of(&meant.transform(&stated.numbers(&written.of(&pose))?)?);
        }
        pose.translation.vector *= self.unit;
        Some(Pose::from_isometry(self.direction.of(&pose)))
    }
}

/// Every change that is tried, those of one thing first.
fn changes(sight: &SessionViews) -> Vec<Change> {
    let is_small = |view: &SessionView| view.base_from_tip.rotation().angle() < LARGEST_OF_DEGREES;
    let mut all = changes_of_poses(sight.views.iter().all(is_small));
    all.extend(Pairing::all(sight).into_iter().map(|pairing| Change { pairing, ..Change::NONE }));
    all.sort_by_key(|change| change.codes().len());
    all
}

/// Every way in which single poses may have been misread, with radians as degrees where those are small.
fn changes_of_poses(with_angles: bool) -> Vec<Change> {
    let angles = ANGLES.into_iter().filter(|_| with_angles);
    let both = |misread| Direction::ALL.map(|written| Some(Misread { written, ..misread }));
    let misreads: Vec<_> = std::iter::once(None).chain(ORDERS.into_iter().chain(angles).flat_map(both)).collect();
    let mut all: Vec<Change> = OTHER_UNITS.map(|unit| Change { unit, ..Change::NONE }).into();
    for unit in [1.0, 1e-3, 1e3] {
        for direction in Direction::ALL {
            all.extend(misreads.iter().map(|misread| Change { direction, misread: *misread, unit, ..Change::NONE }));
        }
    }
    all.retain(|change| *change != Change::NONE);
    all
}

/// The views under a change.
struct Changed<'a> {
    sight: &'a SessionViews,
    change: Change,
    /// The row of each view.
    rows: Vec<Option<usize>>,
}

impl<'a> Changed<'a> {
    fn new(sight: &'a SessionViews, change: Change) -> Self {
        Self { sight, change, rows: change.pairing.rows(sight) }
    }
}

impl Hypothesis for Changed<'_> {
    fn target(&self) -> &SeenTarget {
        &self.sight.target
    }

    fn views(&self) -> usize {
        self.rows.len()
    }

    fn pair(&self, view: usize) -> Option<PosePair> {
        let base_from_tip = self.change.of_pose(&self.sight.table[self.rows[view]?].base_from_tip?)?;
        Some(PosePair {
            anchor_from_mount: self.sight.mode.anchor_from_mount(&base_from_tip),
            camera_from_target: Pose::from_isometry(self.sight.views[view].camera_from_target),
        })
    }
}

/// A change and what it leaves.
pub(super) struct Tried {
    pub change: Change,
    pub agreement: Agreement,
}

/// What was tried.
pub(super) struct Gross {
    /// The poses as given.
    pub as_given: Result<Agreement, HandEyeError>,
    /// The changes, the best first.
    pub tried: Vec<Tried>,
    /// Whether the first of them explains the data while the poses as given do not.
    pub accused: bool,
    /// Number of views used.
    pub views: usize,
}

/// Tries everything. `None` when it was cancelled.
pub(super) fn gross(sight: &SessionViews, work: &Work<'_>) -> Option<Gross> {
    let (views, distance_m) = (sight.views.len(), sight.target.distance_m);
    let as_given = Changed::new(sight, Change::NONE).solve(usize::MAX, true);
    let given = as_given.as_ref().map_or(f64::INFINITY, |agreement| agreement.median_m / distance_m);
    let changes = changes(sight);
    let search =
        Search { most_views: MOST_VIEWS, most_robust: usize::MAX, unlike_rad: &|_index| 0.0, as_stated: Some(given) };
    let found = ranked(changes.len(), |index| Some(Changed::new(sight, changes[index])), &search, work);
    if work.is_cancelled() {
        return None;
    }
    let of = |it: hypotheses::Ranked| Some(Tried { change: changes[it.index], agreement: it.agreement? });
    let mut tried: Vec<Tried> = found.into_iter().filter_map(of).collect();
    let misfit = |tried: &Tried| tried.agreement.median_m / distance_m;
    sort_by_misfit(&mut tried, TIE, misfit, |tried| tried.change.codes().len());
    // The stated conventions are kept until they are ruled out.
    let score = |misfit: f64, explains: bool| Score { misfit, views, explains };
    let mut accused = given >= CLEAR
        && tried.first().map(misfit).is_some_and(|best| {
            hypotheses::verdict(&[score(best, best < EXPLAINED), score(given, true)]) == Verdict::Decided
        });
    // Half of the views may be in step and the other half not: the median shows nothing about the rest.
    if !accused && let Some(stepped) = stepped(sight, as_given.as_ref().ok()) {
        tried.insert(0, stepped);
        accused = true;
    }
    Some(Gross { as_given, tried, accused, views })
}

/// A step in the pairing of images and poses that explains what the poses as given do not; `None` when there is none.
fn stepped(sight: &SessionViews, as_given: Option<&Agreement>) -> Option<Tried> {
    let wrong_m = CLEAR * sight.target.distance_m;
    let paired = |pairing: Pairing| Changed::new(sight, Change { pairing, ..Change::NONE });
    let stated = paired(Pairing::AsGiven);
    let given = as_given.map(|agreement| &agreement.solution);
    if steps::wrong(&stated, given, wrong_m).len() < steps::LEAST_BESIDE {
        return None;
    }
    let step = steps::best_step(|by| paired(Pairing::Shifted(by)))?;
    let stepped = paired(Pairing::Stepped(step));
    let agreement = stepped.solve(MOST_VIEWS, true).ok()?;
    let explained = steps::explains(step, (&stated, given), (&stepped, &agreement.solution), wrong_m);
    explained.then_some(Tried { change: stepped.change, agreement })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector6};

    use super::*;
    use crate::diagnose::hypotheses::steps::Step;
    use crate::handeye::Mode;
    use crate::handeye::closed_form::ClosedFormSolution;
    use handeye_geometry::se3;
    use handeye_simulate::links::Links;
    use handeye_simulate::session::{Setup, links, observed};

    #[test]
    fn a_mixed_up_quaternion_is_put_right_in_both_orders() {
        let truth = se3::exp(&Vector6::new(0.3, -0.2, 0.5, 0.7, -0.4, 0.2));
        let q = truth.rotation.coords;
        let read_w_first = Quaternion::new(q.z, q.w, q.x, q.y);
        let read_w_last = Quaternion::new(q.x, q.y, q.z, q.w);
        for (misread, read) in ORDERS.into_iter().zip([read_w_first, read_w_last]) {
            let wrong = Isometry3::from_parts(truth.translation, UnitQuaternion::from_quaternion(read));
            let change = Change { misread: Some(misread), ..Change::NONE };
            let right = change.of_pose(&Pose::from_isometry(wrong)).expect("a pose");
            assert!(right.rotation().angle_to(&truth.rotation) < 1e-12, "{misread:?}");
        }
    }

    #[test]
    fn the_changes_are_all_different() {
        let all = changes_of_poses(true);
        assert_eq!(all.len(), changes_of_poses(false).len() + 24);
        for (i, change) in all.iter().enumerate() {
            assert!(!all[..i].contains(change), "{change:?}");
        }
    }

    /// A step explains the views that it repairs, not others that its solution happens to suit better.
    #[test]
    fn a_step_is_believed_by_the_views_that_it_pairs_anew() {
        let healthy = SessionViews::new(&observed(&Setup::new(Mode::EyeInHand, 14, 71)), None).expect("views");
        let Links { mount_from_camera, anchor_from_target, .. } = links(Mode::EyeInHand);
        let right = ClosedFormSolution { mount_from_camera, anchor_from_target };
        let off = Vector6::new(0.02, 0.0, 0.0, 0.0, 0.0, 0.0);
        let poor = ClosedFormSolution { mount_from_camera: mount_from_camera.perturbed(&off), anchor_from_target };
        let wrong_m = 0.01 * healthy.target.distance_m;
        let explains = |sight: &SessionViews, step: Step| {
            let [stated, stepped] = [Pairing::AsGiven, Pairing::Stepped(step)]
                .map(|pairing| Changed::new(sight, Change { pairing, ..Change::NONE }));
            let wrong = [(&stated, &poor), (&stepped, &right)].map(|(h, by)| steps::wrong(h, Some(by), wrong_m));
            (wrong, steps::explains(step, (&stated, Some(&poor)), (&stepped, &right), wrong_m))
        };
        let ([as_stated, stepped], explained) = explains(&healthy, Step { from: 11, before: 0, after: -2 });
        assert_eq!((as_stated.len(), stepped), (14, vec![11, 12, 13]));
        assert!(!explained, "all it does is give the last views up");

        // The last views have poses of two rows further, which the step undoes.
        let mut shifted = observed(&Setup::new(Mode::EyeInHand, 14, 71));
        let poses: Vec<_> = shifted.views.iter().map(|view| view.base_from_tip).collect();
        for (view, pose) in shifted.views[9..14].iter_mut().zip(&poses[7..12]) {
            view.base_from_tip = *pose;
        }
        let shifted = SessionViews::new(&shifted, None).expect("views");
        assert!(explains(&shifted, Step { from: 7, before: 0, after: 2 }).1);
    }
}
