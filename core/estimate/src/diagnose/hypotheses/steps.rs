//! A step in the pairing: an image or a pose is missing from some view on, or is there twice.
//!
//! The median view does not show it, since one side of the session is in step. A solution of that side predicts, for every
//! place of the step, the other side a row or two further.

use super::Hypothesis;
use super::agreement::agreement;
use crate::handeye::PosePair;
use crate::handeye::closed_form::ClosedFormSolution;

/// Rows by which images and poses may be out of step: one image or pose that is missing or there twice, or two of them.
pub(crate) const SHIFTS: [isize; 4] = [-1, 1, -2, 2];
/// Least number of views on either side of a step: fewer are outliers.
pub const LEAST_BESIDE: usize = 3;
/// Least number of views for a solution of one side of a step.
const LEAST_SOLVED: usize = 4;
/// A misfit beyond this part of the target's distance counts as this much: views that are wrong for other reasons must not
/// decide where a step is.
const CAP: f64 = 0.1;

/// Views belong to the row this many further, differently before a view and from it on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// The first view after it.
    pub from: usize,
    /// Rows further before it.
    pub before: isize,
    /// Rows further from it on.
    pub after: isize,
}

impl Step {
    /// How many rows further a view belongs.
    pub(crate) fn further(&self, view: usize) -> isize {
        if view < self.from { self.before } else { self.after }
    }
}

/// The views that a solution puts farther than `wrong_m` from where they were seen; all where there is no solution.
pub fn wrong(h: &impl Hypothesis, solution: Option<&ClosedFormSolution>, wrong_m: f64) -> Vec<usize> {
    let misfit_m = |view: usize| solution.map_or(f64::INFINITY, |solution| h.misfit_m(solution, view));
    (0..h.views()).filter(|view| misfit_m(*view) >= wrong_m).collect()
}

/// Whether a step explains at least two in three of the views that are wrong without it, and its own solution puts at least
/// two, and two in three, of the views that it pairs with another row right with that row and wrong with their own. Without
/// the second a solution that gives up the views after the step, and therefore suits the others better, would count as an
/// explanation. Views next to the step do not count: where poses are missing, as many images there belong to none.
pub fn explains<H: Hypothesis>(
    step: Step,
    (as_stated, solution): (&H, Option<&ClosedFormSolution>),
    (stepped, stepped_solution): (&H, &ClosedFormSolution),
    wrong_m: f64,
) -> bool {
    let Step { from, before, after } = step;
    let gap = (after - before).unsigned_abs();
    let judged = |mut views: Vec<usize>| {
        views.retain(|view| view + gap < from || *view >= from + gap);
        views
    };
    let without = judged(wrong(as_stated, solution, wrong_m)).len();
    let still_wrong = judged(wrong(stepped, Some(stepped_solution), wrong_m));
    let own_row_wrong = judged(wrong(as_stated, Some(stepped_solution), wrong_m));
    let moved = |view: &usize| step.further(*view) != 0;
    let repaired = own_row_wrong.iter().filter(|view| moved(view) && !still_wrong.contains(view)).count();
    // An image for which the table has no pose cannot be repaired.
    let has_row = |view: &usize| stepped.pair(*view).is_some();
    let paired_again = judged((0..stepped.views()).collect()).iter().filter(|v| moved(v) && has_row(v)).count();
    without >= 2 && 3 * still_wrong.len() <= without && repaired >= 2 && 3 * repaired >= 2 * paired_again
}

/// The step that lets most views agree with the solution of one side of the session, by the hypotheses that all views belong
/// this many rows further; `None` when the views are too few.
pub(crate) fn best_step<H: Hypothesis>(shifted: impl Fn(isize) -> H) -> Option<Step> {
    let as_stated = shifted(0);
    let others = SHIFTS.map(|by| (by, shifted(by)));
    let (count, cap_m) = (as_stated.views(), CAP * as_stated.target().distance_m);
    let mut best: Option<(f64, Step)> = None;
    for (first, solution) in one_sided(&as_stated) {
        let misfits = |h: &H| -> Vec<f64> { (0..count).map(|view| h.misfit_m(&solution, view).min(cap_m)).collect() };
        let own = misfits(&as_stated);
        for (by, other) in &others {
            let shifted = misfits(other);
            let (before, after) = if first { (&own, &shifted) } else { (&shifted, &own) };
            let mut cost: f64 = after.iter().sum();
            for from in 1..count {
                cost += before[from - 1] - after[from - 1];
                let inside = (LEAST_BESIDE..=count - LEAST_BESIDE).contains(&from);
                if inside && best.is_none_or(|(least, _)| cost < least) {
                    let (before, after) = if first { (0, *by) } else { (*by, 0) };
                    best = Some((cost, Step { from, before, after }));
                }
            }
        }
    }
    best.map(|(_, step)| step)
}

/// Solutions of the first and of the last views, a half and a third of them, and whether it is the first.
fn one_sided(as_stated: &impl Hypothesis) -> Vec<(bool, ClosedFormSolution)> {
    let pairs: Vec<PosePair> = (0..as_stated.views()).filter_map(|view| as_stated.pair(view)).collect();
    let count = pairs.len();
    let mut solutions = Vec::new();
    for part in [2, 3] {
        let size = count / part;
        if size < LEAST_SOLVED.max(LEAST_BESIDE) {
            continue;
        }
        for (first, side) in [(true, &pairs[..size]), (false, &pairs[count - size..])] {
            let agreed = agreement(&as_stated.target().outer, side, false).ok();
            solutions.extend(agreed.map(|agreed| (first, agreed.solution)));
        }
    }
    solutions
}
