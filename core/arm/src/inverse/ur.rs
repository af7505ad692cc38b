//! The closed form of the arms of Universal Robots.
//!
//! Two axes that cross at right angles in the shoulder, three that are parallel, and a wrist of which each axis crosses the
//! next at a right angle. Four lengths determine all that matters; where an arm is mounted, how its joints count and what
//! is behind its last axis are constants around them.
//!
//! Reference: Hawkins 2013, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms"; the wrist angles
//! are taken from the directions of the axes rather than from positions, which keeps them exact near the singularity.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};

use super::{IkError, Obstacle, nearest_turn, pose_error, wrap};
use crate::{Arm, Axis, JointKind, JointRange};

/// Joints of such an arm.
const JOINTS: usize = 6;
/// A value for each of them.
type Six = [f64; JOINTS];

/// Largest deviation of the chain of an arm from that of its closed form \[m, rad\] for the closed form to apply. Files
/// write a quarter turn with five digits or more, several times over; the solutions are polished on the chain itself.
const SAME_CHAIN: f64 = 1e-4;
/// Joint values at which the two are compared: none is special for any of the axes.
const COMPARED_AT: [Six; 3] = [[0.0; 6], [0.7, -1.3, 1.9, 0.4, -0.8, 2.3], [-2.1, 0.6, -0.9, -1.7, 1.2, -0.5]];
/// Distance or sine below which two axes are one line, or parallel where they have to cross.
const DEGENERATE: f64 = 1e-3;
/// Sine of the fifth angle below which the fourth and sixth axes count as parallel: the sixth joint is then free.
const PARALLEL_WRIST: f64 = 1e-10;
/// How far beyond its reach \[relative\] a goal may be by rounding alone: the arm is then taken as exactly stretched.
const REACH_SLACK: f64 = 1e-9;
/// A closed-form solution whose pose misses the goal by more \[m, rad\] is not one.
const ACCEPT: f64 = 1e-8;
/// Where the polishing stops \[m, rad\].
const POLISHED: f64 = 1e-12;
/// Two branches closer than this in every joint \[rad\] are one: at a stretched elbow the two halves meet.
const SAME_BRANCH_RAD: f64 = 1e-6;

/// The arm as a chain of Denavit–Hartenberg rows with the shoulder and the end of the wrist at its two ends:
/// `first_from_shoulder · Rz(c₁) Rx(90°) · Rz(c₂) Tx(upper) · Rz(c₃) Tx(lower) · Rz(c₄) Tz(side) Rx(90°) · Rz(c₅)
/// Tz(wrist) Rx(−90°) · Rz(c₆) · wrist_from_flange`, with `c = sense · q + zero`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct UrGeometry {
    upper_m: f64,
    lower_m: f64,
    /// Offset of the wrist from the plane of the two long links; not negative.
    side_m: f64,
    wrist_m: f64,
    first_from_shoulder: Isometry3<f64>,
    wrist_from_flange: Isometry3<f64>,
    /// 1, or −1 where the joint turns about the opposite of the row's axis.
    sense: Six,
    zero_rad: Six,
}

impl UrGeometry {
    /// The closed form of an arm; `None` when its geometry is not that of Universal Robots, whatever its name.
    pub fn of(arm: &Arm) -> Option<Self> {
        let bare = arm.clone().mounted(Isometry3::identity(), Isometry3::identity());
        if bare.joint_count() != JOINTS || bare.joints().iter().any(|joint| joint.kind != JointKind::Revolute) {
            return None;
        }
        let (axes, first_from_flange) = bare.axes(&[0.0; JOINTS]);
        let axes: [Axis; JOINTS] = axes.try_into().ok()?;
        // With the wrist on the positive side of the plane of the links.
        let found = [1.0, -1.0].into_iter().find_map(|sense| {
            Self::from_axes(&axes, sense, &first_from_flange).filter(|geometry| geometry.side_m >= 0.0)
        })?;
        let is_the_same = COMPARED_AT.iter().all(|joints| {
            let miss = pose_error(&found.forward(joints), &bare.tip(joints)).norm();
            miss < SAME_CHAIN
        });
        is_the_same.then_some(found)
    }

    /// The rows by the axes at zero, where those of joints 2, 3 and 4 count as `sense` times what they are. Only the
    /// existence of the rows is checked.
    fn from_axes(axes: &[Axis; JOINTS], sense: f64, first_from_flange: &Isometry3<f64>) -> Option<Self> {
        let direction = |i: usize| if (1..=3).contains(&i) { axes[i].direction * sense } else { axes[i].direction };
        let (z0, z1, z4, z5) = (direction(0), direction(1), direction(4), direction(5));
        let shoulder = crossing(&axes[0], &axes[1])?;
        let elbow_end = crossing(&axes[3], &axes[4])?;
        let wrist_end = crossing(&axes[4], &axes[5])?;
        // The long links are in the plane through the shoulder across the parallel axes.
        let in_plane = |point: &Vector3<f64>| point - z1 * (point - shoulder).dot(&z1);
        let (elbow, wrist) = (in_plane(&axes[2].point), in_plane(&axes[3].point));
        let (upper, lower) = (elbow - shoulder, wrist - elbow);
        if upper.norm() < DEGENERATE || lower.norm() < DEGENERATE {
            return None;
        }
        let x1 = z0.cross(&z1).try_normalize(DEGENERATE)?;
        let (x2, x3) = (upper.normalize(), lower.normalize());
        let x4 = z1.cross(&z4).try_normalize(DEGENERATE)?;
        let x5 = z5.cross(&z4).try_normalize(DEGENERATE)?;
        let angle = |from: &Vector3<f64>, to: &Vector3<f64>, about: &Vector3<f64>| {
            about.cross(from).dot(to).atan2(from.dot(to))
        };
        let frame = |x: &Vector3<f64>, z: &Vector3<f64>, origin: &Vector3<f64>| {
            let rotation = nalgebra::Rotation3::from_basis_unchecked(&[*x, z.cross(x), *z]);
            Isometry3::from_parts(Translation3::from(*origin), UnitQuaternion::from_rotation_matrix(&rotation))
        };
        Some(Self {
            upper_m: upper.norm(),
            lower_m: lower.norm(),
            side_m: (elbow_end - wrist).dot(&z1),
            wrist_m: (wrist_end - elbow_end).dot(&z4),
            first_from_shoulder: frame(&x1, &z0, &shoulder),
            wrist_from_flange: frame(&x5, &z5, &wrist_end).inv_mul(first_from_flange),
            sense: [1.0, sense, sense, sense, 1.0, 1.0],
            zero_rad: [
                0.0,
                angle(&x1, &x2, &z1),
                angle(&x2, &x3, &z1),
                angle(&x3, &x4, &z1),
                angle(&x4, &x5, &z4),
                0.0,
            ],
        })
    }

    /// `first_from_flange` by the rows.
    fn forward(&self, joints: &Six) -> Isometry3<f64> {
        let c: Six = std::array::from_fn(|i| self.sense[i] * joints[i] + self.zero_rad[i]);
        let shift = Isometry3::translation;
        self.first_from_shoulder
            * (turn_z(c[0]) * turn_x(FRAC_PI_2))
            * (turn_z(c[1]) * shift(self.upper_m, 0.0, 0.0))
            * (turn_z(c[2]) * shift(self.lower_m, 0.0, 0.0))
            * (turn_z(c[3]) * shift(0.0, 0.0, self.side_m) * turn_x(FRAC_PI_2))
            * (turn_z(c[4]) * self.pitch_link())
            * turn_z(c[5])
            * self.wrist_from_flange
    }

    /// The transform after the fifth joint.
    fn pitch_link(&self) -> Isometry3<f64> {
        Isometry3::translation(0.0, 0.0, self.wrist_m) * turn_x(-FRAC_PI_2)
    }

    /// See [`Arm::configurations`].
    pub fn all(&self, arm: &Arm, goal: &Isometry3<f64>) -> Vec<Six> {
        self.solve(arm, goal, 0.0).unwrap_or_default()
    }

    /// See [`Arm::inverse`].
    pub fn nearest(
        &self,
        arm: &Arm,
        goal: &Isometry3<f64>,
        near: &[f64],
        ranges: &[JointRange],
    ) -> Result<Six, IkError> {
        let branches = self.solve(arm, goal, near[5])?;
        let distance = |joints: &Six| -> f64 { joints.iter().zip(near).map(|(a, b)| (a - b).powi(2)).sum() };
        let within = |branch: &Six| -> Option<Six> {
            let mut joints = *branch;
            for (i, value) in joints.iter_mut().enumerate() {
                *value = nearest_turn(*value, near[i], &ranges[i])?;
            }
            Some(joints)
        };
        branches
            .iter()
            .filter_map(within)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .ok_or_else(|| least_violation(&branches, near, ranges))
    }

    /// All branches, with joint 6 at `free_rad` where it is free.
    fn solve(&self, arm: &Arm, goal: &Isometry3<f64>, free_rad: f64) -> Result<Vec<Six>, IkError> {
        let numbers = goal.translation.vector.iter().chain(goal.rotation.coords.iter());
        if !numbers.chain([&free_rad]).all(|v| v.is_finite()) {
            return Err(IkError::NotFinite);
        }
        let first_from_flange = arm.base_from_first.inv_mul(goal) * arm.flange_from_tip.inverse();
        let shoulder_from_wrist =
            self.first_from_shoulder.inv_mul(&first_from_flange) * self.wrist_from_flange.inverse();
        let free = self.sense[5] * free_rad + self.zero_rad[5];
        let mut found: Vec<Six> = Vec::with_capacity(8);
        let mut nearest_miss: Option<Obstacle> = None;
        for pan in self.pan_angles(&shoulder_from_wrist).map_err(|obstacle| IkError::Unreachable { obstacle })? {
            for (wrist, roll) in wrist_angles(&shoulder_from_wrist, pan, free) {
                match self.elbow_angles(&shoulder_from_wrist, pan, wrist, roll) {
                    Ok(arms) => {
                        for [lift, elbow, pitch] in arms {
                            let angles = [pan, lift, elbow, pitch, wrist, roll];
                            let raw = std::array::from_fn(|i| wrap(self.sense[i] * (angles[i] - self.zero_rad[i])));
                            let (polished, miss) = polish(arm, raw, goal);
                            if miss < ACCEPT && !found.iter().any(|known| same_branch(known, &polished)) {
                                found.push(polished);
                            }
                        }
                    }
                    Err(obstacle) => {
                        nearest_miss = Some(nearest_miss.map_or(obstacle, |known| known.or_easier(obstacle)));
                    }
                }
            }
        }
        match (found.is_empty(), nearest_miss) {
            (true, Some(obstacle)) => Err(IkError::Unreachable { obstacle }),
            // Every branch solved but none passed the check: the goal is on the very edge of the workspace.
            (true, None) => {
                let reach_m = self.upper_m + self.lower_m;
                Err(IkError::Unreachable { obstacle: Obstacle::TooFar { needed_m: reach_m, reach_m } })
            }
            (false, _) => Ok(found),
        }
    }

    /// First angle: the end of the fourth link must be at its offset from the plane of the arm.
    fn pan_angles(&self, shoulder_from_wrist: &Isometry3<f64>) -> Result<[f64; 2], Obstacle> {
        let wrist = shoulder_from_wrist.translation.vector;
        let distance_m = wrist.x.hypot(wrist.y);
        if distance_m * (1.0 + REACH_SLACK) < self.side_m {
            return Err(Obstacle::InColumn { distance_m, least_m: self.side_m });
        }
        // On the axis itself any angle will do.
        let ratio = if distance_m > 0.0 { self.side_m / distance_m } else { 1.0 };
        let towards = wrist.y.atan2(wrist.x) + FRAC_PI_2;
        let side = ratio.min(1.0).acos();
        Ok([towards + side, towards - side])
    }

    /// Second, third and fourth angle: the planar arm of two links, and the remaining rotation.
    fn elbow_angles(
        &self,
        shoulder_from_wrist: &Isometry3<f64>,
        pan: f64,
        wrist: f64,
        roll: f64,
    ) -> Result<[[f64; 3]; 2], Obstacle> {
        let pitch_from_wrist = turn_z(wrist) * self.pitch_link() * turn_z(roll);
        let lift_from_pitch =
            (turn_z(pan) * turn_x(FRAC_PI_2)).inverse() * shoulder_from_wrist * pitch_from_wrist.inverse();
        let wrist_point = lift_from_pitch * Point3::new(0.0, -self.side_m, 0.0);
        let (upper, lower) = (self.upper_m, self.lower_m);
        let needed_m = wrist_point.x.hypot(wrist_point.y);
        let cosine = (needed_m * needed_m - upper * upper - lower * lower) / (2.0 * upper * lower);
        if cosine > 1.0 + REACH_SLACK {
            return Err(Obstacle::TooFar { needed_m, reach_m: upper + lower });
        }
        if cosine < -1.0 - REACH_SLACK {
            return Err(Obstacle::TooNear { needed_m, least_m: (upper - lower).abs() });
        }
        let turned = lift_from_pitch.rotation * Vector3::x();
        let total = turned.y.atan2(turned.x);
        let bend = cosine.clamp(-1.0, 1.0).acos();
        Ok([bend, -bend].map(|elbow| {
            let lift = wrist_point.y.atan2(wrist_point.x) - (lower * elbow.sin()).atan2(upper + lower * elbow.cos());
            [lift, elbow, total - lift - elbow]
        }))
    }
}

/// Fifth and sixth angle from the direction of the parallel axes 2, 3 and 4 seen in the wrist.
fn wrist_angles(shoulder_from_wrist: &Isometry3<f64>, pan: f64, free: f64) -> Vec<(f64, f64)> {
    let axis = shoulder_from_wrist.rotation.inverse() * Vector3::new(pan.sin(), -pan.cos(), 0.0);
    let sine = axis.x.hypot(axis.y);
    if sine < PARALLEL_WRIST {
        return vec![(if axis.z > 0.0 { 0.0 } else { PI }, free)];
    }
    [1.0, -1.0].map(|sign| ((sign * sine).atan2(axis.z), (-sign * axis.y).atan2(sign * axis.x))).to_vec()
}

/// The point of `a` that is nearest to `b`: where they cross, if they do.
fn crossing(a: &Axis, b: &Axis) -> Option<Vector3<f64>> {
    let across = a.direction.cross(&b.direction);
    let squared = across.norm_squared();
    // A closed form has right angles here; half of one is far enough from parallel.
    (squared > 0.5).then(|| a.point + a.direction * ((b.point - a.point).cross(&b.direction).dot(&across) / squared))
}

fn least_violation(branches: &[Six], near: &[f64], ranges: &[JointRange]) -> IkError {
    let excess = |joint: usize, value: f64| (ranges[joint].min - value).max(value - ranges[joint].max);
    let worst = |branch: &Six| -> (f64, usize, f64) {
        (0..JOINTS)
            .map(|i| {
                let value = branch[i] + ((near[i] - branch[i]) / TAU).round() * TAU;
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
        min_deg: ranges[joint].min.to_degrees(),
        max_deg: ranges[joint].max.to_degrees(),
    }
}

/// Gauss–Newton on the pose error of the arm itself, keeping only steps that help; returns the remaining error \[m, rad\].
fn polish(arm: &Arm, start: Six, goal: &Isometry3<f64>) -> (Six, f64) {
    let mut joints = start;
    let (mut tip, mut columns) = arm.tip_and_columns(&joints);
    let mut error = pose_error(&tip, goal);
    for _ in 0..4 {
        if error.norm() < POLISHED {
            break;
        }
        let jacobian: Matrix6<f64> = columns.fixed_columns::<JOINTS>(0).into_owned();
        // The cut-off drops directions in which a singular arm cannot move anyway.
        let Ok(step) = jacobian.svd(true, true).solve(&error, 1e-9) else { break };
        let candidate: Six = std::array::from_fn(|i| wrap(joints[i] + step[i]));
        (tip, columns) = arm.tip_and_columns(&candidate);
        let candidate_error = pose_error(&tip, goal);
        if candidate_error.norm() >= error.norm() {
            break;
        }
        (joints, error) = (candidate, candidate_error);
    }
    (joints, error.norm())
}

fn same_branch(a: &Six, b: &Six) -> bool {
    a.iter().zip(b).all(|(a, b)| wrap(a - b).abs() < SAME_BRANCH_RAD)
}

fn turn_z(angle: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle))
}

fn turn_x(angle: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle))
}
