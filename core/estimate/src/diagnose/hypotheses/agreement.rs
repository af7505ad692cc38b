//! A hand-eye transform that most views agree on, without weights: robust against views that are simply wrong.

use nalgebra::{Isometry3, Point3};

use crate::handeye::closed_form::{ClosedForm, ClosedFormSolution, ParkMartin, Shah};
use crate::handeye::{HandEyeError, PosePair, subset};
use handeye_geometry::statistics::median;

/// Choices of views that are tried in addition to all of them. With three of ten views wrong a choice of five is clean
/// once in six times, and the two steps below correct choices with one wrong view.
const CHOICES: usize = 10;
/// Views below which there is nothing to choose from.
const MIN_TO_CHOOSE: usize = 8;
/// Steps that solve again with the better half of the views (Rousseeuw & Van Driessen 1999, "concentration").
const CONCENTRATIONS: usize = 2;
/// Views that go into one solution: the pairs grow with the square, and what follows only needs a start.
const MOST_SOLVED: usize = 60;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// A solution and how far it is from each view.
#[derive(Clone)]
pub struct Agreement {
    /// Hand-eye and target.
    pub solution: ClosedFormSolution,
    /// Distance between where the chain puts the target's outer points and where the camera saw them, RMS per view,
    /// metres.
    pub misfit_m: Vec<f64>,
    /// Median over the views.
    pub median_m: f64,
}

/// The solution with the least median misfit over a fixed set of choices of views. `thorough` tries the choices; without
/// it only all views together are solved. `outer` are the outer points of the target, where misfits are measured.
///
/// # Errors
/// That of the closed form when no choice has a solution.
pub fn agreement(outer: &[Point3<f64>; 4], pairs: &[PosePair], thorough: bool) -> Result<Agreement, HandEyeError> {
    let all: Vec<usize> = (0..pairs.len()).collect();
    let mut tried = Vec::new();
    let mut error = None;
    let mut attempt = |chosen: &[usize], tried: &mut Vec<Agreement>| {
        let some: Vec<PosePair> =
            subset::spread(chosen.len(), MOST_SOLVED).into_iter().map(|i| pairs[chosen[i]]).collect();
        for method in [&ParkMartin as &dyn ClosedForm, &Shah] {
            match method.solve(&some) {
                Ok(solution) => tried.push(judged(outer, pairs, solution)),
                Err(e) => error = Some(e),
            }
        }
    };
    attempt(&all, &mut tried);
    if thorough && pairs.len() >= MIN_TO_CHOOSE {
        let size = (pairs.len() / 3).clamp(5, 10);
        for choice in 0..CHOICES {
            attempt(&some_of(pairs.len(), size, choice), &mut tried);
        }
        tried.sort_by(|a, b| a.median_m.total_cmp(&b.median_m));
        tried.truncate(3);
        for _ in 0..CONCENTRATIONS {
            for good in tried.clone() {
                let half: Vec<usize> = all.iter().copied().filter(|i| good.misfit_m[*i] <= good.median_m).collect();
                attempt(&half, &mut tried);
            }
        }
    }
    let best = tried.into_iter().min_by(|a, b| a.median_m.total_cmp(&b.median_m));
    best.ok_or_else(|| {
        error.unwrap_or(HandEyeError::NoSolution {
            method: "the closed forms",
            views: pairs.len(),
            reason: "none gave a finite answer",
        })
    })
}

/// `size` of `count` indices, another choice for every number, the same every time.
fn some_of(count: usize, size: usize, choice: usize) -> Vec<usize> {
    let mut order: Vec<(f64, usize)> =
        (0..count).map(|i| (((i * i + 3 * i + 1) as f64 * GOLDEN * (choice as f64 + 1.37)).fract(), i)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.into_iter().take(size).map(|(_, i)| i).collect()
}

fn judged(outer: &[Point3<f64>; 4], pairs: &[PosePair], solution: ClosedFormSolution) -> Agreement {
    let of = |pair: &PosePair| misfit(outer, &chain(&solution, pair), pair.camera_from_target.isometry());
    let misfit_m: Vec<f64> = pairs.iter().map(of).collect();
    let median_m = median(misfit_m.iter().copied()).unwrap_or(f64::INFINITY);
    Agreement { solution, misfit_m, median_m }
}

/// Where a solution puts the target as the camera sees it.
pub fn chain(solution: &ClosedFormSolution, pair: &PosePair) -> Isometry3<f64> {
    let chain = solution.mount_from_camera.inverse() * pair.anchor_from_mount.inverse() * solution.anchor_from_target;
    *chain.isometry()
}

/// RMS distance of the target's outer points at two poses, metres.
pub fn misfit(outer: &[Point3<f64>; 4], a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    let squared: f64 = outer.iter().map(|p| (a * p - b * p).norm_squared()).sum();
    (squared / outer.len() as f64).sqrt()
}
