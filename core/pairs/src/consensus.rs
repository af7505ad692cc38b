//! A start that most views agree with, when some of them are wrong.
//!
//! A closed form trusts every view, and one wrong view spoils it. So in addition to the closed forms on all views, small sets of
//! them are solved, and the solution is taken that puts the nearest part of all views nearest (least trimmed sum of misfits).
//! Targets that look the same after half a turn, or a quarter, may be numbered from another corner in every view; all are tried,
//! and the views that have to be renumbered are named.
//!
//! # Reference
//! Fischler & Bolles 1981, "Random sample consensus", CACM 24; Rousseeuw 1984, "Least median of squares regression",
//! JASA 79 (trimming). The sets are drawn by a fixed rule, so the answer is the same every time.

use super::closed_form::{ClosedForm as _, ClosedFormSolution, ParkMartin};
use super::draw::Draw;
use super::numbering::{Turns, unlike_rad};
use super::{PosePair, subset};

/// Sets that are tried: with four in ten views wrong, one in eight sets of four is clean, and fifty sets are enough.
const TRIALS: usize = 60;
/// Views in a set: two motions are the minimum, a third one makes them more robust.
const SET: usize = 4;
/// Part of the views that a start has to agree with.
const AGREEING: f64 = 0.7;
/// Views below which no view can be outvoted.
const NEED: usize = 5;

/// Numberings of a set that are solved: of the four of square targets those under which the turns of robot and target
/// agree best.
const NUMBERINGS: usize = 1 << (SET - 1);

/// A start and the views whose target has to be renumbered for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus {
    /// The start.
    pub solution: ClosedFormSolution,
    /// Views, in ascending order, that fit better when the target is numbered from another corner, and the quarter turns.
    pub turned: Vec<(usize, usize)>,
}

/// The candidate that most views agree with.
///
/// `candidates` are the closed forms on all views. `misfit(solution, view, quarters)` is the misfit of a view renumbered by this
/// many quarter turns, in pixels or any unit, not finite where it has no image; `turns` are the ways to number the target. `None`
/// when no candidate has a finite misfit.
pub fn consensus(
    pairs: &[PosePair],
    candidates: &[ClosedFormSolution],
    turns: &Turns,
    misfit: impl Fn(&ClosedFormSolution, usize, usize) -> f64,
) -> Option<Consensus> {
    let judged = subset::spread(pairs.len(), subset::MOST_VIEWS);
    // Of equal ones the first, which is as detected.
    let best_way = |solution: &ClosedFormSolution, view: usize| {
        let ways = turns.quarters().map(|quarters| (misfit(solution, view, quarters), quarters));
        ways.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
    };
    let score = |solution: &ClosedFormSolution| {
        let mut misfits: Vec<f64> = judged.iter().map(|&view| best_way(solution, view).0).collect();
        misfits.sort_by(f64::total_cmp);
        let agreeing = if pairs.len() < NEED { misfits.len() } else { trimmed(misfits.len()) };
        misfits[..agreeing].iter().sum::<f64>()
    };
    let drawn = if pairs.len() < NEED { Vec::new() } else { drawn(pairs, turns) };
    let best = candidates
        .iter()
        .chain(&drawn)
        .map(|solution| (score(solution), solution))
        .filter(|(score, _)| score.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let solution = *best.1;
    let quarters: Vec<usize> = (0..pairs.len()).map(|view| best_way(&solution, view).1).collect();
    // Renumbering all views is the same target in another frame; the solution with fewer changes is easier to follow.
    let count = |way: usize| quarters.iter().filter(|it| **it == way).count();
    let mut common = 0;
    for way in turns.quarters() {
        if count(way) > count(common) {
            common = way;
        }
    }
    let anchor_from_target = turns.turned(&solution.anchor_from_target, 4 - common);
    let turned = quarters.iter().map(|it| (it + 4 - common) % 4).enumerate().filter(|(_, it)| *it != 0).collect();
    Some(Consensus { solution: ClosedFormSolution { anchor_from_target, ..solution }, turned })
}

/// How many of `count` views a start has to agree with.
fn trimmed(count: usize) -> usize {
    ((AGREEING * count as f64).ceil() as usize).clamp(1, count)
}

/// Solutions of small sets of views.
fn drawn(pairs: &[PosePair], turns: &Turns) -> Vec<ClosedFormSolution> {
    let mut solutions = Vec::new();
    let mut draw = Draw::new(0x9e37_79b9_7f4a_7c15);
    for _ in 0..TRIALS {
        let set: Vec<PosePair> = draw.distinct(pairs.len(), SET).into_iter().map(|view| pairs[view]).collect();
        let mut numbered = numbered(&set, turns);
        if numbered.len() > NUMBERINGS {
            let unlike = |views: &[PosePair]| -> f64 {
                (1..views.len())
                    .flat_map(|i| (0..i).map(move |j| (i, j)))
                    .map(|(i, j)| unlike_rad(&views[i], &views[j]))
                    .sum()
            };
            numbered.sort_by(|a, b| unlike(a).total_cmp(&unlike(b)));
            numbered.truncate(NUMBERINGS);
        }
        solutions.extend(numbered.iter().filter_map(|views| ParkMartin.solve(views).ok()));
    }
    solutions
}

/// A set of views in every numbering of all but the first.
fn numbered(set: &[PosePair], turns: &Turns) -> Vec<Vec<PosePair>> {
    let mut all: Vec<Vec<PosePair>> = vec![Vec::new()];
    for (k, pair) in set.iter().enumerate() {
        let ways = turns.quarters().take(if k == 0 { 1 } else { usize::MAX });
        all = ways
            .flat_map(|quarters| {
                let pair = turns.pair(pair, quarters);
                all.iter().map(move |views| views.iter().copied().chain([pair]).collect()).collect::<Vec<_>>()
            })
            .collect();
    }
    all
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use crate::Mode;
    use handeye_geometry::se3;
    use handeye_simulate::session::{REALISTIC, Session, camera, trial};

    fn pairs(t: &Session) -> Vec<PosePair> {
        let pair = |view: &handeye_geometry::targets::observation::View| {
            let anchor_from_mount = t.mode.anchor_from_mount(&view.base_from_tip);
            let camera_from_target = t.mount_from_camera.inverse() * anchor_from_mount.inverse() * t.anchor_from_target;
            PosePair { anchor_from_mount, camera_from_target }
        };
        t.views.iter().map(pair).collect()
    }

    fn distance(solution: &ClosedFormSolution, pair: &PosePair) -> f64 {
        let predicted =
            solution.mount_from_camera.inverse() * pair.anchor_from_mount.inverse() * solution.anchor_from_target;
        se3::log((pair.camera_from_target.inverse() * predicted).isometry()).norm()
    }

    #[test]
    fn four_wrong_views_of_ten_are_outvoted() {
        let t = trial(Mode::EyeInHand, 10, &REALISTIC, camera(), 71);
        let mut pairs = pairs(&t);
        for (i, pair) in pairs.iter_mut().take(4).enumerate() {
            let off = Vector6::new(0.02, 0.01 * i as f64, -0.03, 0.1, -0.05 * i as f64, 0.2);
            pair.camera_from_target = pair.camera_from_target.perturbed(&off);
        }
        let all = ParkMartin.solve(&pairs).expect("solves");
        let found =
            consensus(&pairs, &[all], &Turns::default(), |s, view, _| distance(s, &pairs[view])).expect("finds");
        let error = |s: &ClosedFormSolution| s.mount_from_camera.distance_to(&t.mount_from_camera).0;
        assert!(error(&found.solution) < 1e-6, "{}", error(&found.solution));
        assert!(error(&all) > 1e-3, "the views were wrong: {}", error(&all));
    }

    /// A board whose numbering is ambiguous by half a turn, and one by a quarter.
    #[test]
    fn views_numbered_from_another_corner_are_named() {
        use handeye_geometry::targets::{Grid, TargetSpec};
        let grid = |columns| Grid { columns, rows: 9, square_m: 0.01 };
        for (target, wrong) in [
            (TargetSpec::Circles(grid(8)), vec![(2, 2), (5, 2), (6, 2)]),
            (TargetSpec::Circles(grid(9)), vec![(0, 1), (2, 3), (5, 2), (6, 1), (7, 3)]),
        ] {
            let t = trial(Mode::EyeToHand, 9, &REALISTIC, camera(), 72);
            let mut pairs = pairs(&t);
            let turns = Turns::of(&target);
            for (view, quarters) in &wrong {
                pairs[*view] = turns.pair(&pairs[*view], 4 - quarters);
            }
            let misfit =
                |s: &ClosedFormSolution, view: usize, quarters: usize| distance(s, &turns.pair(&pairs[view], quarters));
            let found = consensus(&pairs, &[], &turns, misfit).expect("finds");
            assert_eq!(found.turned, wrong);
            assert!(found.solution.mount_from_camera.distance_to(&t.mount_from_camera).0 < 1e-6);
            assert!(found.solution.anchor_from_target.distance_to(&t.anchor_from_target).0 < 1e-6);
        }
    }
}
