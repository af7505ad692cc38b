//! Damped least squares as CoppeliaSim's simIK runs it for `sim.moveToPose`.

use nalgebra::Isometry3;

use super::{damped_step, is_within, pose_error};
use crate::{Arm, JointRange};

/// Largest change of one joint in one iteration: the step that simIK allows a joint by default, 10°. A prismatic joint is
/// limited to the same number in metres, which no step in a fraction of a second reaches.
const MAX_STEP_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Errors of the tip (m and rad) below which no more iterations are made. They are some thousand times the rounding errors
/// of a pose, and so small that an image of the same goal is the same bit for bit wherever the arm came from. With 1e-6 a
/// few pixels differ by one grey value, and a calibration of ten images by 0.007 mm.
const CONVERGED: f64 = 1e-12;

/// Options of damped least squares; the defaults are those of `sim.moveToPose`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DlsOptions {
    /// Damping λ; the normal equations get λ² on their diagonal.
    pub damping: f64,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Position error up to which the goal counts as reached.
    pub precision_m: f64,
    /// Rotation error up to which the goal counts as reached.
    pub precision_rad: f64,
}

impl Default for DlsOptions {
    fn default() -> Self {
        Self { damping: 0.02, iterations: 20, precision_m: 1e-3, precision_rad: 0.5_f64.to_radians() }
    }
}

/// Iterates from `near` with `Δq = Jᵀ (J Jᵀ + λ² I)⁻¹ e` towards a pose of the tip that need not be in reach. Joints stop
/// at the ends of their ranges. It ends near the pose that is nearest to the goal.
///
/// The precision of the options is not used: iterations go on to [`CONVERGED`].
///
/// # Reference
/// Wampler 1986, "Manipulator inverse kinematic solutions based on vector formulations and damped least-squares
/// methods", eq. 20.
pub(super) fn towards(
    arm: &Arm,
    goal: &Isometry3<f64>,
    near: &[f64],
    options: &DlsOptions,
    ranges: &[JointRange],
) -> Vec<f64> {
    let mut joints: Vec<f64> = near.iter().zip(ranges).map(|(value, range)| range.clamp(*value)).collect();
    for _ in 0..options.iterations {
        let (tip, columns) = arm.tip_and_columns(&joints);
        let error = pose_error(&tip, goal);
        if is_within(&error, CONVERGED, CONVERGED) || !error.iter().all(|v| v.is_finite()) {
            break;
        }
        let Some(step) = damped_step(&columns, &error, options.damping.powi(2)) else { break };
        let scale = (MAX_STEP_RAD / step.amax()).min(1.0);
        for ((value, step), range) in joints.iter_mut().zip(step.iter()).zip(ranges) {
            *value = range.clamp(*value + step * scale);
        }
    }
    joints
}
