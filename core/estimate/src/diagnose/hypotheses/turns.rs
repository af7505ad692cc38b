//! Which conventions the turns alone rule out.
//!
//! From one view to another robot and target turn by the same angle, whatever the places of camera and target and the direction
//! in which the poses map: with `A` of the robot and `C` of the target as the camera sees it, `A_i⁻¹ A_j X = X C_i C_j⁻¹`, and
//! a rotation has the angle of every rotation that it is similar to (Shiu and Ahmad 1989, the rotational part of AX = XB). So
//! all units of length, directions and places of the camera are one case here, and no equations are solved.

use super::{EXPLAINED_RAD, Hypothesis};
use crate::handeye::subset;

/// Views that are compared, each with each.
const MOST_VIEWS: usize = 20;
/// With this many times the difference of the best a hypothesis is not ruled out, so that something is listed where nothing
/// explains.
const NEAR: f64 = 2.0;
/// This part of all pairs of views decides: half of the views may be wrong.
const PART: f64 = 0.25;

/// Difference between the angles by which robot and target turn, radians: that of the better quarter of the pairs of views.
/// `None` with one view.
pub fn unlike_rad(h: &impl Hypothesis) -> Option<f64> {
    let turns = &h.target().turns;
    let chosen = subset::spread(h.views(), MOST_VIEWS).into_iter().filter_map(|view| h.pair(view));
    let rotations: Vec<_> =
        chosen.map(|pair| (pair.anchor_from_mount.rotation(), pair.camera_from_target.rotation())).collect();
    let mut unlike = Vec::with_capacity(rotations.len() * rotations.len() / 2);
    for (i, (robot, seen)) in rotations.iter().enumerate() {
        for (other_robot, other_seen) in &rotations[..i] {
            let turned = robot.angle_to(other_robot);
            let ways = turns.quarters().map(|quarters| {
                let seen = turns.motion(quarters).map_or(*seen, |motion| seen * motion.rotation);
                (turned - seen.angle_to(other_seen)).abs()
            });
            unlike.push(ways.fold(f64::INFINITY, f64::min));
        }
    }
    unlike.sort_by(f64::total_cmp);
    unlike.get((PART * unlike.len() as f64) as usize).copied()
}

/// Largest difference between the turns of robot and target, radians, where it is `least_rad` under the best
/// hypothesis.
pub fn limit_rad(least_rad: f64) -> f64 {
    // Without anything to compare, which is infinite, nothing is ruled out.
    (NEAR * least_rad).max(EXPLAINED_RAD)
}
