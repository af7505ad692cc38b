//! Noise levels from the data: restricted maximum likelihood of the linearised model.
//!
//! With all unknowns integrated out, minus twice the log-likelihood of the noise levels is
//! `n ln corner² + 3 N ln robot_m² + 3 N ln robot_rad² + ln det H + Q`, where `H` is the normal matrix and `Q` the least
//! weighted cost. Its derivative by the log of each variance is the familiar `count - expected sum of squares`, the
//! fixed point of the EM iteration; Newton on the three logs gets there in a few steps where EM crawls when the robot
//! is nearly exact.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::chain::camera_from_target;
use super::normal::{MAX_SHARED, System, prior_weight};
use super::optimise::State;
use super::{JointProblem, Noise};
use crate::handeye::HandEyeError;

/// Lowest levels: a nanometre, a nanoradian and a millionth of a pixel are exact for every purpose here.
const LOWEST: Noise = Noise { corner_px: 1e-6, robot_m: 1e-9, robot_rad: 1e-9 };
/// Highest levels: beyond them the robot pose says nothing.
const HIGHEST: Noise = Noise { corner_px: 1e4, robot_m: 1.0, robot_rad: 1.0 };
/// Newton steps.
const MAX_STEPS: usize = 60;
/// Largest change of a log-variance in one step.
const LARGEST_STEP: f64 = 3.0;
/// Ends when the likelihood would gain less than this: a unit of `-2 ln L` is one standard deviation.
const GAIN_TOLERANCE: f64 = 1e-6;

/// Rough levels for the first round: the robot is taken to explain the start's misfit with generous room.
pub fn starting_noise(problem: &JointProblem<'_>, state: &State) -> Noise {
    let mut squared = 0.0;
    let mut count = 0.0;
    for view in problem.views {
        let chain =
            camera_from_target(problem.mode, &view.base_from_tip, &state.mount_from_camera, &state.anchor_from_target);
        for corner in &view.corners {
            let point = chain.isometry() * problem.points[corner.index];
            if let Ok(px) = state.intrinsics.project(&point) {
                squared += (px - corner.px).norm_squared();
                count += 2.0;
            }
        }
    }
    // Corners are good to a fraction of a pixel on any working camera; the rest of the misfit is the robot's to take.
    let misfit_px = if count > 0.0 { f64::sqrt(squared / count) } else { 1.0 };
    Noise { corner_px: misfit_px.clamp(1e-3, 0.3), robot_m: 1e-3, robot_rad: 2e-3 }
}

/// Largest relative change of any level, ignoring what happens at the floor.
pub fn change(a: &Noise, b: &Noise) -> f64 {
    let relative = |a: f64, b: f64, floor: f64| (b.max(10.0 * floor) / a.max(10.0 * floor)).ln().abs();
    relative(a.corner_px, b.corner_px, LOWEST.corner_px)
        .max(relative(a.robot_m, b.robot_m, LOWEST.robot_m))
        .max(relative(a.robot_rad, b.robot_rad, LOWEST.robot_rad))
}

/// Minus twice the restricted log-likelihood and its gradient by the three log-variances.
struct Likelihood {
    value: f64,
    gradient: Vector3<f64>,
}

fn to_noise(logs: &Vector3<f64>) -> Noise {
    let level = |i: usize, low: f64, high: f64| (0.5 * logs[i]).exp().clamp(low, high);
    Noise {
        corner_px: level(0, LOWEST.corner_px, HIGHEST.corner_px),
        robot_m: level(1, LOWEST.robot_m, HIGHEST.robot_m),
        robot_rad: level(2, LOWEST.robot_rad, HIGHEST.robot_rad),
    }
}

fn to_logs(noise: &Noise) -> Vector3<f64> {
    Vector3::new(noise.corner_px.ln(), noise.robot_m.ln(), noise.robot_rad.ln()) * 2.0
}

fn evaluate(system: &System, logs: &Vector3<f64>) -> Result<Likelihood, HandEyeError> {
    let noise = to_noise(logs);
    let reduced = system.reduce(&noise)?;
    let prior = prior_weight(&noise);
    let views = system.blocks.len() as f64;
    let residuals = system.residual_count() as f64;
    let least_cost = system.cost(&noise) - reduced.decrease();

    let shared_covariance = reduced.inverse();
    let n = shared_covariance.nrows();
    let mut wide = nalgebra::SMatrix::<f64, MAX_SHARED, MAX_SHARED>::zeros();
    wide.view_mut((0, 0), (n, n)).copy_from(&shared_covariance);
    let shared_step = reduced.shared_step();
    let steps = reduced.own_steps(&shared_step);

    // Expected sums of squares of the corrections: estimate plus posterior variance.
    let mut squares = Vector6::zeros();
    let mut variances = Vector6::zeros();
    for ((own, step), correction) in reduced.own.iter().zip(&steps).zip(&system.corrections) {
        if system.cancel.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let estimate = correction + step;
        squares += estimate.component_mul(&estimate);
        let solved = own.factor.solve(&own.gain);
        let covariance: Matrix6<f64> = own.factor.inverse() + solved * wide * solved.transpose();
        variances += covariance.diagonal();
    }
    let prior_cost = squares.dot(&prior);
    let prior_trace = variances.dot(&prior);
    let unknowns = n as f64 + 6.0 * views;
    // tr(H H⁻¹) counts the unknowns; what the priors do not take of it is the corners' share.
    let corner_squares = (least_cost - prior_cost) + (unknowns - prior_trace);
    let expected = squares + variances;
    let robot_m = expected.fixed_rows::<3>(0).sum() * prior[0];
    let robot_rad = expected.fixed_rows::<3>(3).sum() * prior[3];
    let value = residuals * logs[0] + 3.0 * views * (logs[1] + logs[2]) + reduced.log_determinant() + least_cost;
    let gradient = Vector3::new(residuals - corner_squares, 3.0 * views - robot_m, 3.0 * views - robot_rad);
    Ok(Likelihood { value, gradient })
}

/// The noise levels that maximise the restricted likelihood of a linearised system, from `start`.
pub fn restricted_likelihood(system: &System, start: &Noise) -> Result<Noise, HandEyeError> {
    const DIFFERENCE: f64 = 1e-4;
    let (low, high) = (to_logs(&LOWEST), to_logs(&HIGHEST));
    let clamp = |logs: Vector3<f64>| Vector3::from_fn(|i, _| logs[i].clamp(low[i], high[i]));
    let mut logs = clamp(to_logs(start));
    let mut at = evaluate(system, &logs)?;
    let mut damping = 1e-3;
    for _ in 0..MAX_STEPS {
        let mut hessian = Matrix3::zeros();
        for i in 0..3 {
            let mut shifted = logs;
            // Towards the inside, so that the clamp in `to_noise` cannot flatten the difference.
            let h = if shifted[i] + DIFFERENCE > high[i] { -DIFFERENCE } else { DIFFERENCE };
            shifted[i] += h;
            hessian.set_column(i, &((evaluate(system, &shifted)?.gradient - at.gradient) / h));
        }
        let hessian = 0.5 * (hessian + hessian.transpose());
        let mut improved = false;
        while damping < 1e9 {
            let step = newton_step(&hessian, &at.gradient, damping);
            let next_logs = clamp(logs + step);
            let next = evaluate(system, &next_logs)?;
            if next.value < at.value {
                let gain = at.value - next.value;
                (logs, at) = (next_logs, next);
                damping = (damping * 0.2).max(1e-9);
                improved = gain > GAIN_TOLERANCE;
                break;
            }
            damping = (damping * 5.0).max(1e-6);
        }
        if !improved {
            break;
        }
    }
    Ok(to_noise(&logs))
}

/// A step down even where the likelihood is not convex in the logs: eigenvalues are taken by their absolute value.
fn newton_step(hessian: &Matrix3<f64>, gradient: &Vector3<f64>, damping: f64) -> Vector3<f64> {
    let eigen = hessian.symmetric_eigen();
    let mut step = Vector3::zeros();
    for i in 0..3 {
        let direction = eigen.eigenvectors.column(i);
        let curvature = eigen.eigenvalues[i].abs() + damping * (1.0 + eigen.eigenvalues[i].abs());
        step -= direction * (direction.dot(gradient) / curvature);
    }
    let largest = step.amax();
    if largest > LARGEST_STEP { step * (LARGEST_STEP / largest) } else { step }
}
