//! How images may have been paired with the wrong rows of the pose table.

use super::agreement::{self, Agreement};
use super::views::SessionViews;
use crate::handeye::closed_form::ClosedFormSolution;
use handeye_geometry::frames::{Base, Pose, Tip};

/// Rows by which images and poses may be out of step: one image or pose that is missing or there twice, or two of them.
pub(super) const STEPS: [isize; 4] = [-1, 1, -2, 2];
/// Views on either side of a step at the least: fewer are outliers.
pub(super) const LEAST_BESIDE: usize = 3;
/// Views that a solution of one side of a step rests on at the least.
const LEAST_SOLVED: usize = 4;
/// A misfit beyond this part of the board's distance counts as this much: views that are wrong for other reasons must not
/// decide where a step is.
const CAP: f64 = 0.1;

/// Which row of the table an image belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pairing {
    /// Its own.
    AsGiven,
    /// The one so many rows further.
    Shifted(isize),
    /// The one so many rows further, differently before a view (by its place among those seen) and from it on.
    Stepped { from: usize, before: isize, after: isize },
    /// Images were listed letter by letter (1, 10, 2) and poses by number (1, 2, 10).
    ByNumber,
    /// Images were listed by number and poses letter by letter.
    Alphabetical,
}

impl Pairing {
    /// The pose of a view; `None` where the table has no such row.
    pub fn pose_of(self, sight: &SessionViews, view: usize) -> Option<Pose<Base, Tip>> {
        let row = sight.views[view].row;
        let row = match self {
            Self::AsGiven => row,
            Self::Shifted(by) => row.checked_add_signed(by)?,
            Self::Stepped { from, before, after } => {
                row.checked_add_signed(if view < from { before } else { after })?
            }
            Self::ByNumber => sight.table.get(row)?.rank_by_number,
            Self::Alphabetical => sight.table.get(row)?.rank_by_letters,
        };
        sight.table.get(row)?.base_from_tip
    }

    /// The changes of the whole table.
    pub fn all(sight: &SessionViews) -> Vec<Self> {
        let mut all: Vec<Self> = STEPS.map(Self::Shifted).into();
        let places = |rank: fn(&super::views::TableRow) -> usize| sight.table.iter().map(rank).eq(0..sight.table.len());
        if !places(|row| row.rank_by_number) {
            all.push(Self::ByNumber);
        }
        if !places(|row| row.rank_by_letters) {
            all.push(Self::Alphabetical);
        }
        all
    }
}

/// The views that a solution puts farther than `wrong_m` from where they were seen; all where there is no solution.
pub(super) fn wrong(
    sight: &SessionViews,
    pairing: Pairing,
    solution: Option<&ClosedFormSolution>,
    wrong_m: f64,
) -> Vec<usize> {
    let misfit = |view: usize| match (solution, pairing.pose_of(sight, view)) {
        (Some(solution), Some(pose)) => {
            agreement::misfit_of(sight, solution, &pose, &sight.views[view].camera_from_target)
        }
        _ => f64::INFINITY,
    };
    (0..sight.views.len()).filter(|view| misfit(*view) >= wrong_m).collect()
}

/// Whether a step explains at least two in three of the views that are wrong without it, and its own solution puts at least
/// two, and two in three, of the views that it pairs with another row right with that row and wrong with their own. Without
/// the second a solution that gives up the views after the step, and therefore suits the others better, would count as an
/// explanation. Views beside the step do not count: where poses are missing, as many images there belong to none.
pub(super) fn explains(
    sight: &SessionViews,
    step: Pairing,
    as_given: Option<&ClosedFormSolution>,
    stepped: &ClosedFormSolution,
    wrong_m: f64,
) -> bool {
    let Pairing::Stepped { from, before, after } = step else { return false };
    let gap = (after - before).unsigned_abs();
    let judged = |mut views: Vec<usize>| {
        views.retain(|view| view + gap < from || *view >= from + gap);
        views
    };
    let without = judged(wrong(sight, Pairing::AsGiven, as_given, wrong_m)).len();
    let still_wrong = judged(wrong(sight, step, Some(stepped), wrong_m));
    let own_row_wrong = judged(wrong(sight, Pairing::AsGiven, Some(stepped), wrong_m));
    let moved = |view: &usize| (if *view < from { before } else { after }) != 0;
    let repaired = own_row_wrong.iter().filter(|view| moved(view) && !still_wrong.contains(view)).count();
    // An image of which the table has no pose cannot be repaired.
    let has_row = |view: &usize| step.pose_of(sight, *view).is_some();
    let paired_anew = judged((0..sight.views.len()).collect()).iter().filter(|v| moved(v) && has_row(v)).count();
    without >= 2 && 3 * still_wrong.len() <= without && repaired >= 2 && 3 * repaired >= 2 * paired_anew
}

/// The step that lets most views agree with the solution of one side of the session; `None` when the views are too few.
pub(super) fn best_step(sight: &SessionViews) -> Option<Pairing> {
    let count = sight.views.len();
    let mut best: Option<(f64, Pairing)> = None;
    for (first, solution) in one_sided(sight) {
        let misfit = |by: isize| -> Vec<f64> {
            (0..count).map(|view| misfit_m(sight, &solution, view, by).min(CAP * sight.distance_m)).collect()
        };
        let as_given = misfit(0);
        for by in STEPS {
            let shifted = misfit(by);
            let (before, after) = if first { (&as_given, &shifted) } else { (&shifted, &as_given) };
            let mut cost: f64 = after.iter().sum();
            for from in 1..count {
                cost += before[from - 1] - after[from - 1];
                let inside = (LEAST_BESIDE..=count - LEAST_BESIDE).contains(&from);
                if inside && best.is_none_or(|(least, _)| cost < least) {
                    let (before, after) = if first { (0, by) } else { (by, 0) };
                    best = Some((cost, Pairing::Stepped { from, before, after }));
                }
            }
        }
    }
    best.map(|(_, pairing)| pairing)
}

/// Solutions of the first and of the last views, a half and a third of them, and whether it is the first.
fn one_sided(sight: &SessionViews) -> Vec<(bool, ClosedFormSolution)> {
    let count = sight.views.len();
    let poses: Vec<Pose<Base, Tip>> = sight.views.iter().map(|view| view.base_from_tip).collect();
    let pairs = agreement::pairs_of(sight, &poses);
    let mut solutions = Vec::new();
    for part in [2, 3] {
        let size = count / part;
        if size < LEAST_SOLVED.max(LEAST_BESIDE) {
            continue;
        }
        for (first, side) in [(true, &pairs[..size]), (false, &pairs[count - size..])] {
            let agreed: Option<Agreement> = agreement::agreement(&sight.outer, side, false).ok();
            solutions.extend(agreed.map(|agreed| (first, agreed.solution)));
        }
    }
    solutions
}

/// Misfit of a view with the pose so many rows further, metres; infinite where there is none.
fn misfit_m(sight: &SessionViews, solution: &ClosedFormSolution, view: usize, by: isize) -> f64 {
    let Some(pose) = Pairing::Shifted(by).pose_of(sight, view) else { return f64::INFINITY };
    agreement::misfit_of(sight, solution, &pose, &sight.views[view].camera_from_target)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use crate::handeye::Mode;
    use handeye_simulate::links::Links;
    use handeye_simulate::session::{Setup, links, observed};

    /// A step explains what it repairs, not what the solution beside it happens to suit better.
    #[test]
    fn a_step_is_believed_by_the_views_that_it_pairs_anew() {
        let healthy = SessionViews::new(&observed(&Setup::new(Mode::EyeInHand, 14, 71)), None).expect("views");
        let Links { mount_from_camera, anchor_from_target, .. } = links(Mode::EyeInHand);
        let right = ClosedFormSolution { mount_from_camera, anchor_from_target };
        let off = Vector6::new(0.02, 0.0, 0.0, 0.0, 0.0, 0.0);
        let poor = ClosedFormSolution { mount_from_camera: mount_from_camera.perturbed(&off), anchor_from_target };
        let wrong_m = 0.01 * healthy.distance_m;
        let step = Pairing::Stepped { from: 11, before: 0, after: -2 };
        assert_eq!(wrong(&healthy, Pairing::AsGiven, Some(&poor), wrong_m).len(), 14);
        assert_eq!(wrong(&healthy, step, Some(&right), wrong_m), [11, 12, 13]);
        assert!(!explains(&healthy, step, Some(&poor), &right, wrong_m), "all it does is give the last views up");

        // The last views have poses of two rows further, which the step undoes.
        let mut shifted = observed(&Setup::new(Mode::EyeInHand, 14, 71));
        let poses: Vec<_> = shifted.views.iter().map(|view| view.base_from_tip).collect();
        for (view, pose) in shifted.views[9..14].iter_mut().zip(&poses[7..12]) {
            view.base_from_tip = *pose;
        }
        let shifted = SessionViews::new(&shifted, None).expect("views");
        let step = Pairing::Stepped { from: 7, before: 0, after: 2 };
        assert!(explains(&shifted, step, Some(&poor), &right, wrong_m));
    }
}
