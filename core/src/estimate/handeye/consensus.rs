//! A start that most views agree with, when some of them are wrong.
//!
//! A closed form takes every view at its word, and one wrong view spoils it. So besides the closed forms on all views,
//! small sets of them are solved, and the solution is taken that puts the nearest part of all views nearest (least trimmed
//! sum of misfits). Targets that look the same after half a turn may be numbered from either end in every view; both are
//! tried, and the views that have to be renumbered are named.
//!
//! # Reference
//! Fischler & Bolles 1981, "Random sample consensus", CACM 24; Rousseeuw 1984, "Least median of squares regression",
//! JASA 79 (trimming). The sets are drawn by a fixed rule, so the answer is the same every time.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::closed_form::{ClosedForm as _, ClosedFormSolution, ParkMartin};
use super::draw::Draw;
use super::{PosePair, subset};
use crate::geometry::frames::Pose;

/// Sets that are tried: with four in ten views wrong, one in eight sets of four is clean, and fifty leave no doubt.
const TRIALS: usize = 60;
/// Views in a set: two motions are the least, a third one steadies them.
const SET: usize = 4;
/// Part of the views that a start has to agree with.
const AGREEING: f64 = 0.7;
/// Views below which nothing can be outvoted.
const NEED: usize = 5;

/// A start and the views whose target has to be turned by half a turn for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus {
    /// The start.
    pub solution: ClosedFormSolution,
    /// Views, in ascending order, that fit better when the target is numbered from its other end.
    pub turned: Vec<usize>,
}

/// Half a turn about the axis through a point of a flat target and across it.
pub fn half_turn_about(point: &Point3<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    Translation3::from(point.coords) * turn * Translation3::from(-point.coords)
}

/// The candidate that most views agree with.
///
/// `candidates` are the closed forms on all views. `misfit(solution, view, turned)` is how badly a view fits, in pixels or
/// any unit, not finite where it has no image; `half_turn` is the motion of the target frame by which a symmetric target
/// comes to look the same, `None` for a target that does not. `None` when no candidate has a finite misfit.
pub fn consensus(
    pairs: &[PosePair],
    candidates: &[ClosedFormSolution],
    half_turn: Option<&Isometry3<f64>>,
    misfit: impl Fn(&ClosedFormSolution, usize, bool) -> f64,
) -> Option<Consensus> {
    let judged = subset::spread(pairs.len(), subset::MOST_VIEWS);
    let either = |solution: &ClosedFormSolution, view: usize| {
        let plain = misfit(solution, view, false);
        let turned = if half_turn.is_some() { misfit(solution, view, true) } else { f64::INFINITY };
        (plain, turned)
    };
    let score = |solution: &ClosedFormSolution| {
        let mut misfits: Vec<f64> = judged.iter().map(|&view| either(solution, view)).map(|(a, b)| a.min(b)).collect();
        misfits.sort_by(f64::total_cmp);
        let agreeing = if pairs.len() < NEED { misfits.len() } else { trimmed(misfits.len()) };
        misfits[..agreeing].iter().sum::<f64>()
    };
    let drawn = if pairs.len() < NEED { Vec::new() } else { drawn(pairs, half_turn) };
    let best = candidates
        .iter()
        .chain(&drawn)
        .map(|solution| (score(solution), solution))
        .filter(|(score, _)| score.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let solution = *best.1;
    let mut turned: Vec<usize> = (0..pairs.len())
        .filter(|&view| {
            let (plain, turned) = either(&solution, view);
            turned < plain
        })
        .collect();
    if turned.len() * 2 > pairs.len()
        && let Some(half_turn) = half_turn
    {
        // Numbering all views from the other end is the same target in another frame; fewer changes are easier to follow.
        turned = (0..pairs.len()).filter(|view| !turned.contains(view)).collect();
        let anchor_from_target = Pose::from_isometry(solution.anchor_from_target.isometry() * half_turn);
        return Some(Consensus { solution: ClosedFormSolution { anchor_from_target, ..solution }, turned });
    }
    Some(Consensus { solution, turned })
}

/// How many of so many views a start has to agree with.
fn trimmed(count: usize) -> usize {
    ((AGREEING * count as f64).ceil() as usize).clamp(1, count)
}

/// Solutions of small sets of views.
fn drawn(pairs: &[PosePair], half_turn: Option<&Isometry3<f64>>) -> Vec<ClosedFormSolution> {
    let mut solutions = Vec::new();
    let mut draw = Draw::new(0x9e37_79b9_7f4a_7c15);
    // With two numberings of every view but the first there are eight times as many sets.
    let numberings = if half_turn.is_some() { 1usize << (SET - 1) } else { 1 };
    for _ in 0..TRIALS {
        let set = draw.distinct(pairs.len(), SET);
        for numbering in 0..numberings {
            let turned = |k: usize| k > 0 && numbering >> (k - 1) & 1 == 1;
            let views: Vec<PosePair> = set
                .iter()
                .enumerate()
                .map(|(k, &view)| match half_turn {
                    Some(half_turn) if turned(k) => turn(&pairs[view], half_turn),
                    _ => pairs[view],
                })
                .collect();
            solutions.extend(ParkMartin.solve(&views).ok());
        }
    }
    solutions
}

/// The pair with its target numbered from the other end.
fn turn(pair: &PosePair, half_turn: &Isometry3<f64>) -> PosePair {
    let camera_from_target = Pose::from_isometry(pair.camera_from_target.isometry() * half_turn);
    PosePair { camera_from_target, ..*pair }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use crate::estimate::handeye::Mode;
    use crate::geometry::se3;
    use crate::testing::sessions::{REALISTIC, Trial, camera, trial};

    fn pairs(t: &Trial) -> Vec<PosePair> {
        let pair = |view: &crate::targets::observation::View| {
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
        let found = consensus(&pairs, &[all], None, |s, view, _| distance(s, &pairs[view])).expect("finds");
        let error = |s: &ClosedFormSolution| s.mount_from_camera.distance_to(&t.mount_from_camera).0;
        assert!(error(&found.solution) < 1e-6, "{}", error(&found.solution));
        assert!(error(&all) > 1e-3, "the views were wrong: {}", error(&all));
    }

    #[test]
    fn views_numbered_from_the_other_end_are_named() {
        let t = trial(Mode::EyeToHand, 9, &REALISTIC, camera(), 72);
        let mut pairs = pairs(&t);
        let centre = crate::testing::sessions::BOARD.centre();
        let half_turn = half_turn_about(&centre);
        for i in [2, 5, 6] {
            pairs[i] = turn(&pairs[i], &half_turn);
        }
        let misfit = |s: &ClosedFormSolution, view: usize, turned: bool| {
            if turned { distance(s, &turn(&pairs[view], &half_turn)) } else { distance(s, &pairs[view]) }
        };
        let found = consensus(&pairs, &[], Some(&half_turn), misfit).expect("finds");
        assert_eq!(found.turned, [2, 5, 6]);
        assert!(found.solution.mount_from_camera.distance_to(&t.mount_from_camera).0 < 1e-6);
    }
}
