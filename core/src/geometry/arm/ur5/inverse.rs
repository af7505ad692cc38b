//! Poses to joint values, in closed form.
//!
//! Reference: Hawkins 2013, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms"; the wrist angles
//! are taken from the directions of the axes rather than from positions, which keeps them exact near the singularity.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

use nalgebra::{Isometry3, Point3, Vector3, Vector6};

use super::forward::{forward, jacobian};
use super::{END_TURN, JOINTS, JointAngles, JointLimits, ROWS, turn_z};
use crate::geometry::se3;

/// Sine of the fifth angle below which the fourth and sixth axes count as parallel: the sixth joint is then free.
const PARALLEL_WRIST: f64 = 1e-10;
/// How far past its reach \[relative\] a goal may be by rounding alone: the arm is then taken as exactly stretched.
const REACH_SLACK: f64 = 1e-9;
/// A closed-form solution whose pose misses the goal by more \[m, rad\] is not one.
const ACCEPT: f64 = 1e-8;
/// Where the polishing stops \[m, rad\].
const POLISHED: f64 = 1e-12;
/// Two branches closer than this in every joint \[rad\] are one: at a stretched elbow the two halves meet.
const SAME_BRANCH_RAD: f64 = 1e-6;

/// What is in the way of a goal.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Obstacle {
    /// The goal is past the stretched arm.
    TooFar {
        /// Distance from shoulder to the wrist that the goal asks for.
        needed_m: f64,
        /// The longest there is.
        reach_m: f64,
    },
    /// The wrist would be inside the folded arm.
    TooNear {
        /// Distance from shoulder to the wrist that the goal asks for.
        needed_m: f64,
        /// The shortest there is.
        least_m: f64,
    },
    /// The wrist would be inside the column of the robot.
    InColumn {
        /// Distance of the wrist from the vertical axis.
        distance_m: f64,
        /// The shortest there is.
        least_m: f64,
    },
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFar { needed_m, reach_m } => write!(
                f,
                "its wrist would be {needed_m:.4} m from the shoulder and the arm reaches {reach_m:.4} m: bring it at \
                 least {:.1} mm closer to the robot",
                (needed_m - reach_m) * 1e3
            ),
            Self::TooNear { needed_m, least_m } => write!(
                f,
                "its wrist would be {needed_m:.4} m from the shoulder and the folded arm cannot come closer than \
                 {least_m:.4} m: move it at least {:.1} mm away from the shoulder",
                (least_m - needed_m) * 1e3
            ),
            Self::InColumn { distance_m, least_m } => write!(
                f,
                "its wrist would be {distance_m:.4} m from the vertical axis and cannot come closer than {least_m:.4} \
                 m: move it at least {:.1} mm away from the robot's column",
                (least_m - distance_m) * 1e3
            ),
        }
    }
}

/// Why no joint values put the arm at a pose.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IkError {
    /// No configuration reaches it, whatever the limits.
    #[error("the arm cannot reach this pose: {obstacle}")]
    Unreachable {
        /// What is in the way.
        obstacle: Obstacle,
    },
    /// Configurations reach it, but all of them have a joint out of its range.
    #[error(
        "this pose needs joint {} at {needed_deg:.1}°, outside its range of {min_deg:.1}° to {max_deg:.1}°, and all \
         other configurations are outside too: turn the tip or move it towards the middle of the workspace",
        joint + 1
    )]
    OutsideLimits {
        /// The joint, counted from 0, of the configuration that exceeds its limits least.
        joint: usize,
        /// Its value there.
        needed_deg: f64,
        /// Its lower limit.
        min_deg: f64,
        /// Its upper limit.
        max_deg: f64,
    },
    /// The goal or the seed is not a finite pose.
    #[error("the pose is not finite: it has a NaN or an infinite number")]
    NotFinite,
}

/// All configurations that put the connection at `arm_from_connection`, up to eight, every joint in (−π, π].
///
/// Each is polished until its pose agrees to 1e-12 m and rad (1e-8 where the arm is exactly stretched, which leaves
/// nothing to polish with). Empty when the pose is out of reach or not finite. Where the fourth and sixth axes are
/// parallel, joint 6 is free and is reported as 0, one configuration standing for all.
pub fn inverse_all(arm_from_connection: &Isometry3<f64>) -> Vec<JointAngles> {
    solve(arm_from_connection, 0.0).unwrap_or_default()
}

/// The configuration within the limits that is nearest to `seed` (Euclidean distance of the joint values).
///
/// Joints are also tried a full turn further where the limits leave room. Where joint 6 is free it keeps its value
/// from the seed.
///
/// # Errors
/// [`IkError`] says what is in the way or which joint would leave its range.
pub fn inverse_nearest(
    arm_from_connection: &Isometry3<f64>,
    seed: &JointAngles,
    limits: &JointLimits,
) -> Result<JointAngles, IkError> {
    if !seed.iter().all(|q| q.is_finite()) {
        return Err(IkError::NotFinite);
    }
    let branches = solve(arm_from_connection, seed[5])?;
    let distance = |joints: &JointAngles| -> f64 { joints.iter().zip(seed).map(|(a, b)| (a - b).powi(2)).sum() };
    branches
        .iter()
        .filter_map(|branch| nearest_turns(branch, seed, limits).ok())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .ok_or_else(|| least_violation(&branches, seed, limits))
}

/// Values of joint `i` that differ from `value` by whole turns and are within the limits.
fn turns(value: f64, limits: &JointLimits, i: usize) -> impl Iterator<Item = f64> + '_ {
    let lowest = ((limits.min_rad[i] - value) / TAU - REACH_SLACK).ceil();
    let highest = ((limits.max_rad[i] - value) / TAU + REACH_SLACK).floor();
    // A range of more than a thousand turns is not a joint; the bound keeps the list finite for infinite limits.
    let (lowest, highest) = (lowest.max(-1000.0) as i64, highest.min(1000.0) as i64);
    (lowest..=highest).map(move |k| value + k as f64 * TAU)
}

/// Every joint shifted by whole turns to be nearest to the seed within its limits, or the first that has no place.
fn nearest_turns(branch: &JointAngles, seed: &JointAngles, limits: &JointLimits) -> Result<JointAngles, usize> {
    let mut out = *branch;
    for i in 0..JOINTS {
        out[i] =
            turns(branch[i], limits, i).min_by(|a, b| (a - seed[i]).abs().total_cmp(&(b - seed[i]).abs())).ok_or(i)?;
    }
    Ok(out)
}

fn least_violation(branches: &[JointAngles], seed: &JointAngles, limits: &JointLimits) -> IkError {
    let excess = |joint: usize, value: f64| (limits.min_rad[joint] - value).max(value - limits.max_rad[joint]);
    let worst = |branch: &JointAngles| -> (f64, usize, f64) {
        (0..JOINTS)
            .map(|i| {
                let value = branch[i] + ((seed[i] - branch[i]) / TAU).round() * TAU;
                let best = [value - TAU, value, value + TAU]
                    .into_iter()
                    .min_by(|a, b| excess(i, *a).total_cmp(&excess(i, *b)))
                    .unwrap_or(value);
                (excess(i, best), i, best)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f64::INFINITY, 0, f64::NAN))
    };
    let (_, joint, value) =
        branches.iter().map(worst).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0, f64::NAN));
    IkError::OutsideLimits {
        joint,
        needed_deg: value.to_degrees(),
        min_deg: limits.min_rad[joint].to_degrees(),
        max_deg: limits.max_rad[joint].to_degrees(),
    }
}

/// All branches, with joint 6 at `free_wrist_rad` where it is free.
fn solve(arm_from_connection: &Isometry3<f64>, free_wrist_rad: f64) -> Result<Vec<JointAngles>, IkError> {
    let finite = arm_from_connection.translation.vector.iter().all(|v| v.is_finite())
        && arm_from_connection.rotation.coords.iter().all(|v| v.is_finite());
    if !finite {
        return Err(IkError::NotFinite);
    }
    let base_from_flange = turn_z(-END_TURN) * arm_from_connection * turn_z(-END_TURN);
    let mut found: Vec<JointAngles> = Vec::with_capacity(8);
    let mut nearest_miss: Option<Obstacle> = None;
    for pan in pan_angles(&base_from_flange).map_err(|obstacle| IkError::Unreachable { obstacle })? {
        for (wrist, roll) in wrist_angles(&base_from_flange, pan, free_wrist_rad) {
            match elbow_angles(&base_from_flange, pan, wrist, roll) {
                Ok(arms) => {
                    for [lift, elbow, pitch] in arms {
                        let angles = [pan, lift, elbow, pitch, wrist, roll];
                        let raw = std::array::from_fn(|i| wrap(angles[i] - ROWS[i].theta_offset_rad));
                        let (polished, miss) = polish(raw, arm_from_connection);
                        if miss < ACCEPT && !found.iter().any(|known| same_branch(known, &polished)) {
                            found.push(polished);
                        }
                    }
                }
                Err(obstacle) => nearest_miss = Some(nearest_miss.map_or(obstacle, |old| easier(old, obstacle))),
            }
        }
    }
    match (found.is_empty(), nearest_miss) {
        (true, Some(obstacle)) => Err(IkError::Unreachable { obstacle }),
        // Every branch solved but none passed the check: the goal sits on the very edge of the workspace.
        (true, None) => Err(IkError::Unreachable { obstacle: edge_of_reach() }),
        (false, _) => Ok(found),
    }
}

fn edge_of_reach() -> Obstacle {
    let reach_m = ROWS[1].a_m.abs() + ROWS[2].a_m.abs();
    Obstacle::TooFar { needed_m: reach_m, reach_m }
}

/// The obstacle that a smaller displacement of the goal removes.
fn easier(a: Obstacle, b: Obstacle) -> Obstacle {
    let excess = |o: &Obstacle| match *o {
        Obstacle::TooFar { needed_m, reach_m } => needed_m - reach_m,
        Obstacle::TooNear { needed_m, least_m } => least_m - needed_m,
        Obstacle::InColumn { distance_m, least_m } => least_m - distance_m,
    };
    if excess(&b) < excess(&a) { b } else { a }
}

/// First angle: the fifth frame's origin must be `d4` beside the plane of the arm.
fn pan_angles(base_from_flange: &Isometry3<f64>) -> Result<[f64; 2], Obstacle> {
    let wrist = base_from_flange * Point3::new(0.0, 0.0, -ROWS[5].d_m);
    let distance_m = wrist.x.hypot(wrist.y);
    if distance_m * (1.0 + REACH_SLACK) < ROWS[3].d_m {
        return Err(Obstacle::InColumn { distance_m, least_m: ROWS[3].d_m });
    }
    let ratio = ROWS[3].d_m / distance_m;
    let towards = wrist.y.atan2(wrist.x) + FRAC_PI_2;
    let side = ratio.min(1.0).acos();
    Ok([towards + side, towards - side])
}

/// Fifth and sixth angle from the direction of the parallel axes 2, 3 and 4 seen in the flange.
fn wrist_angles(base_from_flange: &Isometry3<f64>, pan: f64, free_wrist_rad: f64) -> Vec<(f64, f64)> {
    let axis = base_from_flange.rotation.inverse() * Vector3::new(pan.sin(), -pan.cos(), 0.0);
    let sine = axis.x.hypot(axis.y);
    if sine < PARALLEL_WRIST {
        return vec![(if axis.z > 0.0 { 0.0 } else { PI }, free_wrist_rad)];
    }
    [1.0, -1.0].map(|sign| ((sign * sine).atan2(axis.z), (-sign * axis.y).atan2(sign * axis.x))).to_vec()
}

/// Second, third and fourth angle: the planar arm of two links, and what is left of the rotation.
fn elbow_angles(base_from_flange: &Isometry3<f64>, pan: f64, wrist: f64, roll: f64) -> Result<[[f64; 3]; 2], Obstacle> {
    let base_from_shoulder = turn_z(pan) * ROWS[0].link();
    let pitch_from_flange = turn_z(wrist) * ROWS[4].link() * turn_z(roll) * ROWS[5].link();
    let shoulder_from_pitch = base_from_shoulder.inverse() * base_from_flange * pitch_from_flange.inverse();
    let wrist_point = shoulder_from_pitch * Point3::new(0.0, -ROWS[3].d_m, 0.0);
    let (upper, lower) = (ROWS[1].a_m, ROWS[2].a_m);
    let needed_m = wrist_point.x.hypot(wrist_point.y);
    let cosine = (needed_m * needed_m - upper * upper - lower * lower) / (2.0 * upper * lower);
    if cosine > 1.0 + REACH_SLACK {
        return Err(Obstacle::TooFar { needed_m, reach_m: upper.abs() + lower.abs() });
    }
    if cosine < -1.0 - REACH_SLACK {
        return Err(Obstacle::TooNear { needed_m, least_m: (upper.abs() - lower.abs()).abs() });
    }
    let turned = shoulder_from_pitch.rotation * Vector3::x();
    let total = turned.y.atan2(turned.x);
    let bend = cosine.clamp(-1.0, 1.0).acos();
    Ok([bend, -bend].map(|elbow| {
        let lift = wrist_point.y.atan2(wrist_point.x) - (lower * elbow.sin()).atan2(upper + lower * elbow.cos());
        [lift, elbow, total - lift - elbow]
    }))
}

/// Gauss–Newton on the pose error, keeping only steps that help; returns the remaining error \[m, rad\].
fn polish(start: JointAngles, goal: &Isometry3<f64>) -> (JointAngles, f64) {
    let mut joints = start;
    let mut error = pose_error(&forward(&joints).arm_from_connection, goal);
    for _ in 0..4 {
        if error.norm() < POLISHED {
            break;
        }
        // The cut-off drops directions in which a singular arm cannot move anyway.
        let Ok(step) = jacobian(&joints).svd(true, true).solve(&error, 1e-9) else { break };
        let candidate: JointAngles = std::array::from_fn(|i| wrap(joints[i] + step[i]));
        let candidate_error = pose_error(&forward(&candidate).arm_from_connection, goal);
        if candidate_error.norm() >= error.norm() {
            break;
        }
        (joints, error) = (candidate, candidate_error);
    }
    (joints, error.norm())
}

/// Displacement and rotation vector from `actual` to `goal`, both in the axes of the arm.
pub(super) fn pose_error(actual: &Isometry3<f64>, goal: &Isometry3<f64>) -> Vector6<f64> {
    let shift = goal.translation.vector - actual.translation.vector;
    let turn = se3::rotation_vector(&(goal.rotation * actual.rotation.inverse()));
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

fn same_branch(a: &JointAngles, b: &JointAngles) -> bool {
    a.iter().zip(b).all(|(a, b)| wrap(a - b).abs() < SAME_BRANCH_RAD)
}

/// The same angle in (−π, π].
pub(super) fn wrap(angle: f64) -> f64 {
    let wrapped = angle - (angle / TAU).round() * TAU;
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}
