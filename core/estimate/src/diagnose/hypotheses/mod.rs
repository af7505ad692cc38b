//! Hypotheses about conventions and pairing: what recorded poses may mean, each tried against what the camera saw.
//!
//! # What a hypothesis is
//! A mapping of every view to `base_from_tip`, by which the mount moves, and to `camera_from_target` ([`Hypothesis`]). It
//! states which way poses map, in which units and which order of numbers they were written ([`conventions`]), which pose
//! belongs to which image ([`pairing`]; [`steps`] where that changes within a session), and where the camera is.
//!
//! # How it is scored
//! Under each of them the closed forms are solved, and the distance between where the chain puts the target's outer points and
//! where the camera saw them is measured at the median view ([`agreement()`]). That is on the camera's side, in metres, so it
//! means the same under every unit of the robot's poses. Hypotheses are compared by their *misfit*: this distance over that of the
//! target.
//!
//! | threshold | |
//! | --- | --- |
//! | [`CLEAR`] | below it poses have no gross fault, and the other hypotheses are not examined further |
//! | [`EXPLAINED`], [`EXPLAINED_RAD`] | below it a hypothesis explains the views |
//! | [`TIMES`] | this many times more rules another one out |
//! | [`NEED`] | views with which hypotheses can be told apart |
//!
//! # In which order
//! From view to view robot and target turn by the same angle, whatever the units of length and the place of the camera: what
//! contradicts that can be dropped before anything is solved ([`turns`]). The others are solved plainly and, where none of them
//! is clear, again on choices of views, since a few wrong ones spoil a plain solution ([`ranked`]). Those with about the same
//! misfit are sorted by how common they are ([`sort_by_misfit`]).
//!
//! # What follows
//! One hypothesis that explains the views while every other is ruled out is [decided](Verdict::Decided); several that explain
//! them alike are [ambiguous](Verdict::Ambiguous), and nothing is [guessed](Verdict::Unexplained). Poses that map the other way
//! with the camera in the other place give the same equations, so no data can separate those two.
//!
//! # Who asks
//! The [doctor](super::doctor) tries changes of poses whose conventions were stated, which stay unless they are ruled out. The
//! importer of foreign recordings (`handeye_import`) tries what the files do not state.

pub mod agreement;
pub mod conventions;
pub mod pairing;
pub mod scale;
pub mod steps;
pub mod turns;

use nalgebra::{Isometry3, Point3};

use crate::handeye::closed_form::ClosedFormSolution;
use crate::handeye::numbering::{Turns, alike};
use crate::handeye::{HandEyeError, PosePair, subset};
use agreement::{Agreement, agreement};
use handeye_geometry::progress::Work;

/// A smaller misfit is not a gross fault: arms that are off by 3 mm half a metre away stay below.
pub(crate) const CLEAR: f64 = 0.01;
/// A hypothesis that explains the views has a smaller misfit, which is ten times that of such arms.
pub const EXPLAINED: f64 = 0.05;
/// And at the median a smaller angle \[rad\] than this: the same part of a turn by one radian.
pub const EXPLAINED_RAD: f64 = 0.05;
/// Another one is ruled out when its misfit is this many times larger. By these three no gross fault was accused in 3,000 healthy
/// simulated sessions, and those that were injected are found (`docs/studies/diagnosis.md`).
pub const TIMES: f64 = 3.0;
/// Views with which hypotheses can be told apart: with three any of them fits half of them.
pub const NEED: usize = 4;
/// Smaller misfits are rounding, of hypotheses that are the same equations.
const ROUNDING: f64 = 1e-7;
/// Without any noise a hypothesis is compared as if it had this misfit.
const LEAST_MISFIT: f64 = 1e-4;

/// A way to understand a recording.
pub trait Hypothesis {
    /// The target as the camera sees it.
    fn target(&self) -> &SeenTarget;
    /// Number of views.
    fn views(&self) -> usize;
    /// The pose pair that a view gives under it; `None` where that has no pose.
    fn pair(&self, view: usize) -> Option<PosePair>;

    /// Solves it with this many of its views, spread over the session. `robust` also tries choices of them.
    ///
    /// # Errors
    /// That of the closed forms.
    fn solve(&self, most_views: usize, robust: bool) -> Result<Agreement, HandEyeError> {
        let chosen = subset::spread(self.views(), most_views);
        let pairs: Vec<PosePair> = chosen.into_iter().filter_map(|view| self.pair(view)).collect();
        let target = self.target();
        agreement(&target.outer, &alike(&pairs, &target.turns), robust)
    }

    /// How far a solution puts the target of a view from where it was seen, metres; infinite where the view has no pose.
    fn misfit_m(&self, solution: &ClosedFormSolution, view: usize) -> f64 {
        self.pair(view).map_or(f64::INFINITY, |pair| self.target().misfit(solution, &pair).0)
    }
}

/// A target as the camera sees it: how far poses of it are apart.
#[derive(Debug, Clone)]
pub struct SeenTarget {
    /// Four outer points of it, where misfits are measured, metres.
    pub outer: [Point3<f64>; 4],
    /// Turns after which it looks the same.
    pub turns: Turns,
    /// Median distance of it from the camera, metres.
    pub distance_m: f64,
}

impl SeenTarget {
    /// How far a solution puts it from where it was seen, metres and radians; where it looks the same after a turn, in the
    /// nearest numbering.
    pub fn misfit(&self, solution: &ClosedFormSolution, pair: &PosePair) -> (f64, f64) {
        let chain = agreement::chain(solution, pair);
        let seen = *pair.camera_from_target.isometry();
        let of = |seen: &Isometry3<f64>| {
            (agreement::misfit(&self.outer, &chain, seen), chain.rotation.angle_to(&seen.rotation))
        };
        let ways = std::iter::once(seen).chain(self.turns.others(&seen)).map(|seen| of(&seen));
        // Of equal ones the first, which is the numbering as detected.
        ways.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, f64::INFINITY))
    }
}

/// Settings of the search among hypotheses.
pub struct Search<'a> {
    /// Most views that are used.
    pub most_views: usize,
    /// Hypotheses that are solved on choices of views, which takes some ten times as long.
    pub most_robust: usize,
    /// How unequally robot and target turn, which a few wrong views do not spoil: where there are more hypotheses, those with
    /// the most equal turns come first.
    pub unlike_rad: &'a dyn Fn(usize) -> f64,
    /// Misfit of the poses as they were stated, solved robustly, where it is known. It determines beforehand which of the two
    /// passes counts.
    pub as_stated: Option<f64>,
}

/// A hypothesis and its misfit.
pub struct Ranked {
    /// Its place among those that were tried.
    pub index: usize,
    /// Median distance between where it puts the target and where it was seen over the target's distance; infinite without a
    /// solution.
    pub misfit: f64,
    /// Its solution.
    pub agreement: Option<Agreement>,
}

/// Solves this many hypotheses, plainly and, where nothing is clear, robustly, and sorts them by their misfit. Not all of them
/// when `work` is cancelled.
pub fn ranked<H: Hypothesis>(
    count: usize,
    hypothesis: impl Fn(usize) -> Option<H>,
    search: &Search<'_>,
    work: &Work<'_>,
) -> Vec<Ranked> {
    let unsolved = |index: usize| Ranked { index, misfit: f64::INFINITY, agreement: None };
    let solved = |index: usize, robust: bool| {
        let h = hypothesis(index)?;
        let agreement = h.solve(search.most_views, robust).ok()?;
        Some(Ranked { index, misfit: agreement.median_m / h.target().distance_m, agreement: Some(agreement) })
    };
    let mut ranked: Vec<Ranked> = (0..count).map(unsolved).collect();
    let passes: &[bool] = match search.as_stated {
        None => &[false, true],
        Some(misfit) => &[misfit >= CLEAR],
    };
    for robust in passes {
        let mut chosen: Vec<usize> = (0..count).collect();
        if *robust && count > search.most_robust {
            chosen.sort_by(|a, b| (search.unlike_rad)(*a).total_cmp(&(search.unlike_rad)(*b)));
            chosen.truncate(search.most_robust);
        }
        for index in chosen.into_iter().take_while(|_| !work.is_cancelled()) {
            ranked[index] = solved(index, *robust).unwrap_or_else(|| unsolved(index));
        }
        if ranked.iter().any(|it| it.misfit < CLEAR) {
            break;
        }
    }
    ranked.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    ranked
}

/// Sorts by misfit. Where that is within a factor of the first of a run, the simpler one comes first: a median of a dozen
/// views is known no better, and two that are the same equations differ by rounding.
pub fn sort_by_misfit<T, K: Ord>(items: &mut [T], tie: f64, misfit: impl Fn(&T) -> f64, simplicity: impl Fn(&T) -> K) {
    items.sort_by(|a, b| misfit(a).total_cmp(&misfit(b)));
    let mut start = 0;
    while start < items.len() {
        let limit = tie * misfit(&items[start]) + ROUNDING;
        let end = start + items[start..].iter().take_while(|it| misfit(it) <= limit).count().max(1);
        items[start..end].sort_by_key(&simplicity);
        start = end;
    }
}

/// What is known of a hypothesis when it is compared with the others.
#[derive(Debug, Clone, Copy)]
pub struct Score {
    /// How far the target scatters over the views, over its distance from the camera.
    pub misfit: f64,
    /// Views that it was judged by.
    pub views: usize,
    /// Whether it explains them.
    pub explains: bool,
}

/// What follows from hypotheses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The first is the only one that explains the views.
    Decided,
    /// The first this many explain them about equally well: a person has to decide which it is.
    Ambiguous(usize),
    /// None explains them.
    Unexplained,
}

/// What follows from hypotheses, the best first.
pub fn verdict(of: &[Score]) -> Verdict {
    let Some(best) = of.first().filter(|best| best.explains) else { return Verdict::Unexplained };
    let limit = TIMES * best.misfit.max(LEAST_MISFIT);
    // With too few views to tell hypotheses apart, all of them are open.
    let is_open = |it: &&Score| it.explains && (it.misfit <= limit || it.views < NEED);
    match of.iter().take_while(is_open).count() {
        1 if best.views >= NEED || of.len() == 1 => Verdict::Decided,
        open => Verdict::Ambiguous(open),
    }
}

/// Whether the misfit of one hypothesis rules out another, in whichever unit both are.
pub fn rules_out(misfit: f64, other: f64) -> bool {
    TIMES * misfit < other
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_that_explain_the_views_alike_are_left_to_a_person() {
        let of = |misfit: f64, views: usize, explains: bool| Score { misfit, views, explains };
        let best = of(0.01, 10, true);
        assert_eq!(verdict(&[]), Verdict::Unexplained);
        assert_eq!(verdict(&[of(0.01, 10, false), best]), Verdict::Unexplained, "the best is contradicted");
        assert_eq!(verdict(&[best, of(0.031, 10, true), of(0.01, 10, false)]), Verdict::Decided);
        assert_eq!(verdict(&[best, of(0.029, 10, true), of(0.031, 10, true)]), Verdict::Ambiguous(2));
        assert_eq!(verdict(&[of(0.0, 10, true), of(2e-4, 10, true)]), Verdict::Ambiguous(2), "both are exact");
        assert_eq!(verdict(&[of(0.01, 3, true), of(0.04, 3, true)]), Verdict::Ambiguous(2), "three views fit anything");
        assert_eq!(verdict(&[of(0.01, 3, true)]), Verdict::Decided, "there is no other");
    }

    #[test]
    fn of_about_the_same_misfits_the_simplest_comes_first() {
        let mut items = [(0.03, 0), (0.01, 2), (0.012, 1), (0.016, 0), (0.017, 1), (f64::INFINITY, 0)];
        sort_by_misfit(&mut items, 1.5, |it| it.0, |it| it.1);
        assert_eq!(items, [(0.012, 1), (0.01, 2), (0.016, 0), (0.017, 1), (0.03, 0), (f64::INFINITY, 0)]);
        let mut exact = [(1e-16, 2), (9e-16, 1)];
        sort_by_misfit(&mut exact, 1.5, |it| it.0, |it| it.1);
        assert_eq!(exact[0].1, 1, "rounding");
    }
}
