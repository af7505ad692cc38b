//! Noise levels from the data: restricted maximum likelihood of the linearised model.
//!
//! With all unknowns integrated out, minus twice the log-likelihood of the noise levels is
//! `(n − 6 N) ln corner² + 6 N ln (corner² + view²) + 3 N ln robot_m² + 3 N ln robot_rad² + ln det H + Q` (and of the effects in
//! the model, slopes of the robot's field and errors of its arm, their number times the log of the variance of their kind) for `n`
//! residuals of `N` views, where `H` is the normal matrix and `Q` the least weighted cost. Its derivative by the log of each
//! variance is the familiar `count - expected sum of squares`, the fixed point of the EM iteration; Newton on the logs gets there
//! in a few steps where EM crawls when the robot is nearly exact.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector6};

use super::arm_errors::LEVELS_OF_ARMS;
use super::information::information;
use super::normal::{Reduced, System};
use super::view_block::{EFFECTS, add_square, columns, prior_weight};
use super::{JointProblem, Noise};
use crate::handeye::joint::state::State;
use crate::handeye::{HandEyeError, determined};

/// Lowest levels: a nanometre, a nanoradian and a millionth of a pixel are exact for every purpose here.
const LOWEST: Noise = Noise {
    corner_px: 1e-6,
    view_px: 0.0,
    robot_m: 1e-9,
    robot_rad: 1e-9,
    field_m: 1e-9,
    field_rad: 1e-9,
    link_rad: 1e-9,
    link_m: 1e-9,
    compliance_rad: 1e-9,
};
/// Highest levels: beyond them the robot pose has no information.
const HIGHEST: Noise = Noise {
    corner_px: 1e4,
    view_px: 1e4,
    robot_m: 1.0,
    robot_rad: 1.0,
    field_m: 1.0,
    field_rad: 1.0,
    link_rad: 1.0,
    link_m: 1.0,
    compliance_rad: 1.0,
};
/// Effects below this part of the robot's noise count as zero, and how far below does not matter.
const NO_EFFECT: f64 = 1e-3;
/// Newton steps.
const MAX_STEPS: usize = 60;
/// Largest change of a log-variance in one step.
const LARGEST_STEP: f64 = 3.0;
/// Gain of the likelihood below which the levels of an answer have converged: a unit of `-2 ln L` is one standard deviation,
/// so they are off by a thousandth of one.
pub const EXACTLY: f64 = 1e-6;
/// And levels that are only used for a decision, which requires gains of some units: they are off by a tenth of a
/// standard deviation.
pub const ROUGHLY: f64 = 1e-2;

/// Which levels are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Levels {
    /// The noise that the corners of a view share.
    pub view: bool,
    /// The robot's field.
    pub field: bool,
    /// The errors of its arm.
    pub arm: bool,
}

impl Levels {
    /// Places among the [`Logs`].
    pub fn estimated(self) -> impl Iterator<Item = usize> {
        (0..LEVELS).filter(move |k| match k {
            0..3 => true,
            3 => self.view,
            ..ARM_AT => self.field,
            _ => self.arm,
        })
    }

    /// Numbers per level, with those of the poses' part added to those of the corners where the two are one level.
    pub fn folded(self, mut of_levels: Logs) -> Logs {
        if !self.view {
            of_levels[0] += of_levels[3];
            of_levels[3] = 0.0;
        }
        of_levels
    }

    /// The same of a matrix with rows and columns per level; those of a level that is not estimated are zero.
    pub fn folded_matrix(self, of_levels: &LevelMatrix) -> LevelMatrix {
        let mut fold = LevelMatrix::zeros();
        for k in self.estimated() {
            fold[(k, k)] = 1.0;
        }
        if !self.view {
            fold[(0, 3)] = 1.0;
        }
        fold * of_levels * fold.transpose()
    }
}

/// Place of the first level of effects.
pub const EFFECTS_AT: usize = 4;
/// Place of the first level of the arm's errors.
const ARM_AT: usize = EFFECTS_AT + 2;
/// Number of levels.
pub const LEVELS: usize = EFFECTS_AT + EFFECTS;

/// Logs of the variances of a corner, of the robot's position and orientation, of the part of a view that looks like a
/// pose, and of the kinds of effects. The fourth follows the first where it is not estimated, and those of effects are
/// meaningless then.
pub type Logs = SVector<f64, LEVELS>;
/// Rows and columns per level.
pub type LevelMatrix = SMatrix<f64, LEVELS, LEVELS>;

/// The standard deviation of each kind of effects.
pub fn levels_of_effects(noise: &Noise) -> [f64; EFFECTS] {
    [noise.field_m, noise.field_rad, noise.link_rad, noise.link_m, noise.compliance_rad]
}

/// Rough levels for the first round: the robot is taken to explain the start's misfit with generous room.
pub fn starting_noise(problem: &JointProblem<'_>, state: &State) -> Noise {
    let mut squared = 0.0;
    let mut count = 0.0;
    for view in problem.views {
        let chain = state.chain(problem, view, &Vector6::zeros());
        for corner in &view.corners {
            let point = chain.camera_from_target * problem.board.point(corner.index, &state.shape);
            if let Ok(px) = state.intrinsics.project(&point) {
                squared += (px - corner.px).norm_squared();
                count += 2.0;
            }
        }
    }
    // Corners are good to a fraction of a pixel on any working camera; the rest of the misfit is the robot's to take.
    let misfit_px = if count > 0.0 { f64::sqrt(squared / count) } else { 1.0 };
    Noise { corner_px: misfit_px.clamp(1e-3, 0.3), robot_m: 1e-3, robot_rad: 2e-3, ..Noise::EXACT }
}

/// Largest relative change of any level, ignoring changes at the lower limit.
pub fn change(a: &Noise, b: &Noise) -> f64 {
    let relative = |a: f64, b: f64, floor: f64| (b.max(10.0 * floor) / a.max(10.0 * floor)).ln().abs();
    relative(a.corner_px, b.corner_px, LOWEST.corner_px)
        .max(relative(a.corner_px + a.view_px, b.corner_px + b.view_px, LOWEST.corner_px))
        .max(relative(a.robot_m, b.robot_m, LOWEST.robot_m))
        .max(relative(a.robot_rad, b.robot_rad, LOWEST.robot_rad))
        .max(relative(a.field_m, b.field_m, NO_EFFECT * a.robot_m))
        .max(relative(a.field_rad, b.field_rad, NO_EFFECT * a.robot_rad))
        .max(relative(a.link_rad, b.link_rad, NO_EFFECT * LEVELS_OF_ARMS[0]))
        .max(relative(a.link_m, b.link_m, NO_EFFECT * LEVELS_OF_ARMS[1]))
        .max(relative(a.compliance_rad, b.compliance_rad, NO_EFFECT * LEVELS_OF_ARMS[2]))
}

/// Minus twice the restricted log-likelihood at some levels, and related quantities.
pub struct Likelihood {
    pub value: f64,
    /// Derivatives by the log-variances.
    gradient: Logs,
    /// Number of residuals that determine each level: all that it affects, less those that the unknowns use up and those that
    /// are lost in the noise of the other levels. Those of the corners' rest and of the poses' part are separate, also where
    /// the two are one level.
    pub counts: Logs,
    /// Sums of `F_iᵀ F_i` over the views, see [`super::information`], for the corrections of position and of orientation.
    pub moments: [DMatrix<f64>; 2],
    pub reduced: Reduced,
    /// Covariance of the shared unknowns.
    pub covariance: DMatrix<f64>,
    /// Step of the shared unknowns from the point of linearisation to the optimum at these levels.
    pub step: DVector<f64>,
}

fn to_noise(logs: &Logs, levels: Levels) -> Noise {
    let level = |i: usize, low: f64, high: f64| (0.5 * logs[i]).exp().clamp(low, high);
    let corner_px = level(0, LOWEST.corner_px, HIGHEST.corner_px);
    let effect = |kind: usize, is_estimated: bool| {
        let (low, high) = (levels_of_effects(&LOWEST)[kind], levels_of_effects(&HIGHEST)[kind]);
        if is_estimated { level(EFFECTS_AT + kind, low, high) } else { 0.0 }
    };
    Noise {
        corner_px,
        // For a level that is not estimated rounding would leave a difference, which would then count as noise.
        view_px: if levels.view {
            (logs[3].exp() - corner_px.powi(2)).clamp(0.0, HIGHEST.view_px.powi(2)).sqrt()
        } else {
            0.0
        },
        robot_m: level(1, LOWEST.robot_m, HIGHEST.robot_m),
        robot_rad: level(2, LOWEST.robot_rad, HIGHEST.robot_rad),
        field_m: effect(0, levels.field),
        field_rad: effect(1, levels.field),
        link_rad: effect(2, levels.arm),
        link_m: effect(3, levels.arm),
        compliance_rad: effect(4, levels.arm),
    }
}

/// The levels as logs of variances; the poses' part is that of corners and view together.
pub fn to_logs(noise: &Noise) -> Logs {
    let together = noise.corner_px.powi(2) + noise.view_px.powi(2);
    let log = |level: f64| 2.0 * level.ln();
    let of_effects = levels_of_effects(noise).into_iter().zip(levels_of_effects(&LOWEST));
    let [corner, m, rad] = [noise.corner_px, noise.robot_m, noise.robot_rad].map(log);
    let all = [corner, m, rad, together.ln()].into_iter().chain(of_effects.map(|(level, low)| log(level.max(low))));
    Logs::from_iterator(all)
}

/// Keeps the logs in their range, and the pose's part no smaller than with independent corners.
pub fn kept(mut logs: Logs, levels: Levels) -> Logs {
    let (low, high) = (to_logs(&LOWEST), to_logs(&HIGHEST));
    for i in (0..LEVELS).filter(|i| *i != 3) {
        logs[i] = logs[i].clamp(low[i], high[i]);
    }
    logs[3] = if levels.view { logs[3].clamp(logs[0], high[3]) } else { logs[0] };
    logs
}

/// The restricted likelihood of a linearised system at some levels.
///
/// # Errors
/// [`HandEyeError::NoSolution`] where the levels leave the answer undetermined, [`HandEyeError::Cancelled`].
pub fn evaluate(system: &System, logs: &Logs, levels: Levels) -> Result<Likelihood, HandEyeError> {
    let noise = to_noise(logs, levels);
    let reduced = system.reduce(&noise)?;
    let prior = prior_weight(&noise);
    let views = system.blocks.len() as f64;
    let in_poses = 6.0 * views;
    let in_rest = system.residual_count() as f64 - in_poses;
    let least_cost = system.cost(&noise) - reduced.decrease();

    let covariance = reduced.inverse();
    let n = covariance.nrows();
    let step = reduced.shared_step();
    let steps = reduced.own_steps(&step);

    // Expected sums of squares of the corrections: estimate plus posterior variance.
    let mut squares = Vector6::zeros();
    let mut variances = Vector6::zeros();
    let mut moments = [DMatrix::zeros(n, n), DMatrix::zeros(n, n)];
    for ((own, step), correction) in reduced.own.iter().zip(&steps).zip(&system.corrections) {
        if system.cancel.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let estimate = correction + step;
        squares += estimate.component_mul(&estimate);
        variances += own.factor.inverse().diagonal();
        let follows = own.follows();
        let [x, y, z, rx, ry, rz] = columns(&follows);
        add_square(&mut moments[0], [x, y, z], 1.0);
        add_square(&mut moments[1], [rx, ry, rz], 1.0);
    }
    moments.iter_mut().for_each(DMatrix::fill_lower_triangle_with_upper_triangle);
    let (squares, traces) = (squares.component_mul(&prior), variances.component_mul(&prior));
    let halves = [0, 1].map(|k| {
        let (at, through) = (3 * k, moments[k].dot(&covariance) * prior[3 * k]);
        (squares.fixed_rows::<3>(at).sum(), traces.fixed_rows::<3>(at).sum() + through)
    });
    let unknowns = n as f64 + in_poses;
    // tr(H H⁻¹) counts the unknowns; the part not due to the priors is the corners' share.
    let known_cost = system.prior_cost(&noise, Some(&step));
    let known_trace = system.prior_trace(&noise, &covariance);
    let corner_squares = least_cost - squares.sum() - known_cost;
    let corner_trace = unknowns - halves[0].1 - halves[1].1 - known_trace;
    let rest = system.rest_squares(&step, &covariance);
    let (rest_squares, rest_trace) = (rest.0 / noise.corner_px.powi(2), rest.1 / noise.corner_px.powi(2));
    let [m, rad] = halves;
    let mut counts = Logs::zeros();
    let mut sums = Logs::zeros();
    counts.fixed_rows_mut::<EFFECTS_AT>(0).copy_from_slice(&[
        in_rest - rest_trace,
        3.0 * views - m.1,
        3.0 * views - rad.1,
        in_poses - (corner_trace - rest_trace),
    ]);
    sums.fixed_rows_mut::<EFFECTS_AT>(0).copy_from_slice(&[rest_squares, m.0, rad.0, corner_squares - rest_squares]);
    let mut of_effects = 0.0;
    for (kind, (places, level)) in system.layout.effects().into_iter().zip(levels_of_effects(&noise)).enumerate() {
        let at = EFFECTS_AT + kind;
        of_effects += places.len() as f64 * logs[at];
        counts[at] = places.len() as f64;
        for index in places {
            let effect = system.effects[index - system.layout.field_at()] + step[index];
            sums[at] += (effect / level).powi(2);
            counts[at] -= covariance[(index, index)] / level.powi(2);
        }
    }
    let (of_arms, by_arms) = prior_of_arms(logs, levels);
    let value = in_rest * logs[0]
        + of_effects
        + of_arms
        + in_poses * logs[3]
        + 3.0 * views * (logs[1] + logs[2])
        + reduced.log_determinant()
        + least_cost;
    let gradient = levels.folded(counts - sums) + by_arms;
    Ok(Likelihood { value, gradient, counts, moments, reduced, covariance, step })
}

/// The most likely noise levels of a linearised system, and the likelihood at them.
pub struct MostLikely {
    pub logs: Logs,
    pub at: Likelihood,
}

impl MostLikely {
    /// Approximately half the second derivatives of what was minimised, by the log-variances; zero for a level that is not
    /// estimated.
    pub fn information(&self, system: &System, levels: Levels, aim: Aim) -> LevelMatrix {
        0.5 * slope(system, &self.logs, &self.at, levels, aim).1
    }
}

/// What is minimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// Minus twice the restricted log-likelihood.
    Likelihood,
    /// The same less twice the log of the prior of [`prior`].
    Posterior,
}

/// Minus twice the log of the density of the log-variances of an arm's errors by [`LEVELS_OF_ARMS`], and its derivatives. It is
/// part of the likelihood: the prior knowledge of arms applies in every fit.
fn prior_of_arms(logs: &Logs, levels: Levels) -> (f64, Logs) {
    let (mut value, mut gradient) = (0.0, Logs::zeros());
    if levels.arm {
        for (k, usual) in (ARM_AT..).zip(LEVELS_OF_ARMS) {
            let ratio = logs[k].exp() / usual.powi(2);
            value += 2.0 * ratio.ln_1p() - logs[k];
            gradient[k] = 2.0 * ratio / (1.0 + ratio) - 1.0;
        }
    }
    (value, gradient)
}

/// Minus twice the log of the prior density of the other log-variances: proportional to [`Likelihood::counts`]. It is flat where
/// a level is well determined, as Jeffreys' prior of a variance is, so that a level which only a few numbers determine gives
/// Student's distribution; and it falls with the variance itself below what the noise of the other levels hides, so that a level
/// of zero gets its share among the others and no more.
///
/// # Reference
/// Berger & Deely 1988, "A Bayesian approach to ranking and selection of related means", JASA 83, 364–373 (the prior for
/// one level; it is Jeffreys' up to a constant where all views are equal).
pub fn prior(at: &Likelihood, levels: Levels) -> f64 {
    let counts = levels.folded(at.counts);
    -2.0 * levels.estimated().filter(|k| *k < ARM_AT).map(|k| counts[k].max(f64::MIN_POSITIVE).ln()).sum::<f64>()
}

/// Finds the levels where `aim` is least, beginning at `start`, until a step gains less than `tolerance`.
pub fn most_likely(
    system: &System,
    start: Logs,
    levels: Levels,
    aim: Aim,
    tolerance: f64,
) -> Result<MostLikely, HandEyeError> {
    let aimed = |at: &Likelihood| at.value + if aim == Aim::Posterior { prior(at, levels) } else { 0.0 };
    let mut logs = kept(start, levels);
    let mut at = evaluate(system, &logs, levels)?;
    let mut damping = 1e-3;
    for _ in 0..MAX_STEPS {
        let (gradient, curvature) = slope(system, &logs, &at, levels, aim);
        let mut improved = false;
        while damping < 1e9 {
            let next_logs = kept(logs + newton_step(&curvature, &gradient, damping), levels);
            // Levels that leave the answer undetermined are not the ones that are searched for.
            let next = determined(evaluate(system, &next_logs, levels))?;
            let gain = next.as_ref().map_or(f64::NEG_INFINITY, |next| aimed(&at) - aimed(next));
            if let (Some(next), true) = (next, gain > 0.0) {
                (logs, at) = (next_logs, next);
                damping = (damping * 0.2).max(1e-9);
                improved = gain > tolerance;
                break;
            }
            damping = (damping * 5.0).max(1e-6);
        }
        if !improved {
            break;
        }
    }
    Ok(MostLikely { logs, at })
}

/// Levels to search from, with those at zero lifted to where the noise of the others begins to hide them. Far below that the
/// log of a level makes no difference, so that a search that begins there stays there.
pub fn lifted(system: &System, noise: &Noise, levels: Levels) -> Result<Logs, HandEyeError> {
    /// Part of all numbers of a level that determine it at its start.
    const SEEN: f64 = 0.2;
    let mut logs = kept(to_logs(noise), levels);
    let counts = evaluate(system, &logs, levels)?.counts;
    let robot = 3.0 * system.blocks.len() as f64;
    let effects = system.layout.effects().map(|places| places.len() as f64);
    let of_effects = (EFFECTS_AT..).zip(effects).filter(|(_, all)| *all > 0.0);
    for (k, all) in [(1, robot), (2, robot)].into_iter().chain(of_effects) {
        let seen = (counts[k] / all).clamp(1e-12, 1.0);
        if seen < SEEN {
            logs[k] += (SEEN / seen).ln();
        }
    }
    Ok(logs)
}

/// Derivatives of what is minimised, the second ones as expected.
fn slope(system: &System, logs: &Logs, at: &Likelihood, levels: Levels, aim: Aim) -> (Logs, LevelMatrix) {
    let information = information(system, &to_noise(logs, levels), at, levels);
    let (mut gradient, mut curvature) = (at.gradient, 2.0 * information);
    if levels.arm {
        for (k, usual) in (ARM_AT..).zip(LEVELS_OF_ARMS) {
            let ratio = logs[k].exp() / usual.powi(2);
            curvature[(k, k)] += 2.0 * ratio / (1.0 + ratio).powi(2);
        }
    }
    if aim == Aim::Posterior {
        let counts = levels.folded(at.counts);
        for k in levels.estimated().filter(|k| *k < ARM_AT) {
            // The count of a level grows with its own variance and shrinks with that of the others, which hide it.
            let count = counts[k].max(f64::MIN_POSITIVE);
            gradient[k] -= 2.0;
            gradient += information.column(k) * (4.0 / count);
            let seen = (2.0 * information[(k, k)] / count).clamp(0.0, 1.0);
            curvature[(k, k)] += 2.0 * seen * (1.0 - seen);
        }
    }
    (gradient, curvature)
}

/// The noise levels that maximise the restricted likelihood of a linearised system, from `start`, and minus twice its log; to
/// a gain of `tolerance`.
pub fn restricted_likelihood(
    system: &System,
    start: &Logs,
    levels: Levels,
    tolerance: f64,
) -> Result<(Noise, f64), HandEyeError> {
    let found = most_likely(system, *start, levels, Aim::Likelihood, tolerance)?;
    Ok((to_noise(&found.logs, levels), found.at.value))
}

/// A step down even where the likelihood is not convex in the logs: eigenvalues are taken by their absolute value.
fn newton_step(hessian: &LevelMatrix, gradient: &Logs, damping: f64) -> Logs {
    let eigen = hessian.symmetric_eigen();
    let mut step = Logs::zeros();
    for i in 0..LEVELS {
        let direction = eigen.eigenvectors.column(i);
        let curvature = eigen.eigenvalues[i].abs() + damping * (1.0 + eigen.eigenvalues[i].abs());
        step -= direction * (direction.dot(gradient) / curvature);
    }
    let largest = step.amax();
    if largest > LARGEST_STEP { step * (LARGEST_STEP / largest) } else { step }
}
