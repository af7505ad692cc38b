//! Keeping an arm that is led by a goal off what it must not touch.
//!
//! Rates of the joints are changed as little as the tip notices, so that what is next is not neared faster than it may be:
//! with the gradient `g` of the room over the joints, `g · q̇ ≥ -v`. Of all rates that keep to it those are taken whose tip
//! moves most nearly as it was to: with `W` of the squared deviation of the tip,
//!
//! ```text
//! q̇ + W⁻¹ g (-v - g · q̇) / (gᵀ W⁻¹ g)
//! ```
//!
//! A redundant arm thus gives way with its redundant joints only. Reference: Faverjon and Tournassoud 1987, "A local based
//! approach for path planning of manipulators with a high number of degrees of freedom" (the bound on how fast a distance
//! shrinks).

use handeye_arm::JointValues;
use handeye_plan::Guard;
use nalgebra::{DMatrix, DVector, Matrix6xX};

/// Step of a joint [rad, m of a prismatic one] over which the room is compared: it moves no point of an arm by more than a tenth of
/// a millimetre or so.
const STEP: f64 = 1e-4;

/// What a joint that moves by a radian costs at least, as motion of the tip \[m\]: so little that redundant joints give way
/// first, and so much that those that hardly move the tip, as near a singular position, do not race.
const LEAST_COST_M: f64 = 0.03;

/// Free space next to an arm.
pub(super) struct Room {
    /// How much nearer an obstacle may come \[m\].
    pub left_m: f64,
    /// How that changes with the joints [m/rad, or m/m for a prismatic joint].
    gradient: DVector<f64>,
}

impl Room {
    /// `None` where nothing is as near as `within_m`.
    pub fn at(guard: &Guard<'_>, joints: &JointValues, within_m: f64) -> Option<Self> {
        let (left_m, _) = guard.nearest(joints, within_m)?;
        // Beyond the end of the search in both directions of each joint.
        let search_m = 2.0 * within_m;
        let at = |index: usize, step: f64| {
            let mut moved = *joints;
            moved[index] += step;
            guard.nearest(&moved, search_m).map_or(search_m, |(room_m, _)| room_m)
        };
        let slope = |index: usize, _| (at(index, STEP) - at(index, -STEP)) / (2.0 * STEP);
        Some(Self { left_m, gradient: DVector::from_fn(joints.len(), slope) })
    }
}

/// Rates with which the room changes by no less than `least_m_s`, and the tip moves as closely as possible to its command;
/// `None` where the given rates do. A turn of the tip by a radian counts as a shift by `turn_m`.
pub(super) fn deflected(
    rates: &JointValues,
    room: &Room,
    least_m_s: f64,
    jacobian: &Matrix6xX<f64>,
    turn_m: f64,
) -> Option<JointValues> {
    let gradient = &room.gradient;
    let wanted = DVector::from_column_slice(rates);
    let lacks_m_s = least_m_s - gradient.dot(&wanted);
    if lacks_m_s <= 0.0 {
        return None;
    }
    let weighted = DMatrix::from_fn(6, jacobian.ncols(), |row, column| {
        jacobian[(row, column)] * if row < 3 { 1.0 } else { turn_m }
    });
    let cost = weighted.tr_mul(&weighted) + DMatrix::identity(rates.len(), rates.len()) * LEAST_COST_M.powi(2);
    let way = cost.cholesky()?.solve(gradient);
    let gain = gradient.dot(&way);
    // Nothing that this arm can do changes the room.
    if gain <= f64::MIN_POSITIVE {
        return None;
    }
    let kept = wanted + way * (lacks_m_s / gain);
    Some(JointValues::from_fn(rates.len(), |i| kept[i]))
}
