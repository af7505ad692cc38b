//! Damped least squares as CoppeliaSim's simIK runs it for `sim.moveToPose`.

use nalgebra::{Isometry3, Matrix6};

use super::forward::{forward, jacobian_at};
use super::inverse::pose_error;
use super::{JointAngles, JointLimits};

/// Largest change of one joint in one iteration: the step that simIK allows a joint by default, 10°.
const MAX_STEP_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// How [`damped_least_squares`] iterates; the defaults are those of `sim.moveToPose`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DlsOptions {
    /// Damping λ; the normal equations get λ² on their diagonal.
    pub damping: f64,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Position error below which the goal is reached.
    pub precision_m: f64,
    /// Rotation error below which the goal is reached.
    pub precision_rad: f64,
}

impl Default for DlsOptions {
    fn default() -> Self {
        Self { damping: 0.02, iterations: 20, precision_m: 1e-3, precision_rad: 0.5_f64.to_radians() }
    }
}

/// Joint values that bring the tip near `arm_from_tip_goal`, iterating from `seed` with
/// `Δq = Jᵀ (J Jᵀ + λ² I)⁻¹ e`; `None` when the goal is not within the precision after the last iteration.
///
/// It stops as soon as the error is within the precision, so the result is no better than that: for an exact
/// configuration use [`super::inverse_nearest`]. Joints stop at their limits.
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
    let (joints, is_there) = descend(arm_from_tip_goal, connection_from_tip, seed, options, limits);
    is_there.then_some(joints)
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
    descend(arm_from_tip_goal, connection_from_tip, seed, options, limits).0
}

/// The last joints, and whether they are within the precision.
fn descend(
    arm_from_tip_goal: &Isometry3<f64>,
    connection_from_tip: &Isometry3<f64>,
    seed: &JointAngles,
    options: &DlsOptions,
    limits: &JointLimits,
) -> (JointAngles, bool) {
    let mut joints = limits.clamp(seed);
    for iteration in 0..=options.iterations {
        let tip = forward(&joints).arm_from_connection * connection_from_tip;
        let error = pose_error(&tip, arm_from_tip_goal);
        if !error.iter().all(|v| v.is_finite()) {
            break;
        }
        if error.fixed_rows::<3>(0).norm() <= options.precision_m
            && error.fixed_rows::<3>(3).norm() <= options.precision_rad
        {
            return (joints, true);
        }
        if iteration == options.iterations {
            break;
        }
        let j = jacobian_at(&joints, connection_from_tip);
        let damped = j * j.transpose() + Matrix6::identity() * options.damping.powi(2);
        let Some(damped) = damped.cholesky() else { break };
        let step = j.transpose() * damped.solve(&error);
        let scale = (MAX_STEP_RAD / step.amax()).min(1.0);
        joints = limits.clamp(&std::array::from_fn(|i| joints[i] + step[i] * scale));
    }
    (joints, false)
}
