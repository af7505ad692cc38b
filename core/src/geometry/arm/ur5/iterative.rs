//! Damped least squares as CoppeliaSim's simIK runs it for `sim.moveToPose`.

use nalgebra::{Isometry3, Matrix6, Vector6};

use super::forward::{forward, jacobian_at};
use super::inverse::pose_error;
use super::{JointAngles, JointLimits};

/// Largest change of one joint in one iteration: the step that simIK allows a joint by default, 10°.
const MAX_STEP_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Errors of the tip (m and rad) that no iteration is made for any more. They are some thousand times what rounding leaves
/// of a pose, and so small that an image of the same goal is the same bit for bit from wherever the arm came. With 1e-6 a
/// few pixels differ by one grey value, and a calibration of ten images by 0.007 mm.
const CONVERGED: f64 = 1e-12;

/// How [`damped_least_squares`] iterates; the defaults are those of `sim.moveToPose`.
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

/// Joint values that bring the tip to `arm_from_tip_goal`, iterating from `seed` with
/// `Δq = Jᵀ (J Jᵀ + λ² I)⁻¹ e`; `None` when the goal is not within the precision after the last iteration. Joints stop at
/// their limits.
///
/// The precision decides about success alone: iterations go on to [`CONVERGED`].
///
/// # Reference
/// Wampler 1986, "Manipulator inverse kinematic solutions based on vector formulations and damped least-squares
/// methods", eq. 20.
pub fn damped_least_squares(
    arm_from_tip_goal: &Isometry3<f64>,
    connection_from_tip: &Isometry3<f64>,
    seed: &JointAngles,
    options: &DlsOptions,
    limits: &JointLimits,
) -> Option<JointAngles> {
    let joints = towards(arm_from_tip_goal, connection_from_tip, seed, options, limits);
    let error = error_at(&joints, connection_from_tip, arm_from_tip_goal);
    is_within(&error, options.precision_m, options.precision_rad).then_some(joints)
}

/// As [`damped_least_squares`], for a goal that need not be in reach: where the iterations end, which is near the place
/// that is nearest to the goal.
pub fn towards(
    arm_from_tip_goal: &Isometry3<f64>,
    connection_from_tip: &Isometry3<f64>,
    seed: &JointAngles,
    options: &DlsOptions,
    limits: &JointLimits,
) -> JointAngles {
    let mut joints = limits.clamp(seed);
    for _ in 0..options.iterations {
        let error = error_at(&joints, connection_from_tip, arm_from_tip_goal);
        if is_within(&error, CONVERGED, CONVERGED) || !error.iter().all(|v| v.is_finite()) {
            break;
        }
        let j = jacobian_at(&joints, connection_from_tip);
        let damped = j * j.transpose() + Matrix6::identity() * options.damping.powi(2);
        let Some(damped) = damped.cholesky() else { break };
        let step = j.transpose() * damped.solve(&error);
        let scale = (MAX_STEP_RAD / step.amax()).min(1.0);
        joints = limits.clamp(&std::array::from_fn(|i| joints[i] + step[i] * scale));
    }
    joints
}

fn error_at(joints: &JointAngles, connection_from_tip: &Isometry3<f64>, goal: &Isometry3<f64>) -> Vector6<f64> {
    pose_error(&(forward(joints).arm_from_connection * connection_from_tip), goal)
}

fn is_within(error: &Vector6<f64>, precision_m: f64, precision_rad: f64) -> bool {
    error.fixed_rows::<3>(0).norm() <= precision_m && error.fixed_rows::<3>(3).norm() <= precision_rad
}
