//! Joint values by search, for any arm: descents of the pose error from several places.

use std::f64::consts::PI;

use nalgebra::{Isometry3, SMatrix, Vector6};

use super::{Columns, IkError, damped_step, halton, nearest_turn, pose_error};
use crate::{Arm, JointKind, JointRange, MAX_JOINTS};

/// Errors \[m and rad\] below which a pose counts as reached.
const REACHED: f64 = 1e-8;
/// Where a descent stops: rounding errors, with a margin \[m and rad\].
const CONVERGED: f64 = 1e-13;
/// Iterations of one descent. Half of those that reach their goal take 11, and one in a hundred more than 28.
const ITERATIONS: usize = 60;
/// A descent that has improved by less than a tenth in this many iterations is in a local minimum that is not the goal.
const PATIENCE: usize = 8;
/// Starts in addition to the first, at about 10 µs each. With 96 the study `inverse_kinematics` reaches 99.93 % of the
/// goals of a Panda, with this many 99.98 %.
const STARTS: u32 = 256;
/// A solution found from the present values with no joint farther than this \[rad\] is taken at once; one that is farther
/// is compared with those of [`COMPARED`] more starts, because on the other side of a fold there may be a nearer one. With
/// three times as many starts the nearest is nearer by hundredths of a radian.
const NEAR_RAD: f64 = PI / 3.0;
const COMPARED: u32 = 24;
/// Largest change of a joint in one iteration \[rad\]: the equations are linear over about as much.
const MAX_STEP: f64 = 0.6;
/// Least damping, in units of squared singular values of an arm one unit long.
const LEAST_DAMPING: f64 = 1e-9;
/// Part of a range, from its middle, in which a joint is not moved.
const COMFORT: f64 = 0.7;
/// Dimensions of a pose: joints beyond these can move without it.
const POSE: usize = 6;

/// A value for each joint; zero beyond the last.
type Values = SMatrix<f64, MAX_JOINTS, 1>;

/// See [`Arm::inverse`].
pub(super) fn nearest(arm: &Arm, goal: &Isometry3<f64>, near: &[f64]) -> Result<Vec<f64>, IkError> {
    let search = Search::new(arm, goal, near);
    let mut best: Option<(f64, Values)> = None;
    let mut least_miss = search.descend(&search.near);
    if let Some(found) = search.reached(&least_miss) {
        if search.largest_move(&found) <= NEAR_RAD {
            return Ok(search.values(&found));
        }
        best = Some((search.distance(&found), found));
    }
    let mut starts: Vec<Values> = (0..STARTS).map(|n| search.place(n)).collect();
    starts.sort_by(|a, b| search.distance(a).total_cmp(&search.distance(b)));
    let mut compared = 0;
    for start in &starts {
        let end = search.descend(start);
        if let Some(found) = search.reached(&end) {
            let distance = search.distance(&found);
            if best.as_ref().is_none_or(|known| distance < known.0) {
                best = Some((distance, found));
            }
        }
        if end.miss < least_miss.miss {
            least_miss = end;
        }
        compared += u32::from(best.is_some());
        if compared > COMPARED {
            break;
        }
    }
    if let Some((_, found)) = best {
        return Ok(search.values(&found));
    }
    let error = pose_error(&arm.tip(&search.values(&least_miss.joints)), goal);
    Err(IkError::NotFound {
        distance_mm: error.fixed_rows::<3>(0).norm() * 1e3,
        angle_deg: error.fixed_rows::<3>(3).norm().to_degrees(),
        starts: starts.len() + 1,
    })
}

/// See [`Arm::inverse_nearby`].
pub(super) fn nearby(arm: &Arm, goal: &Isometry3<f64>, near: &[f64]) -> Option<Vec<f64>> {
    let search = Search::new(arm, goal, near);
    let end = search.descend(&search.near);
    search.reached(&end).map(|found| search.values(&found))
}

/// End of a descent.
struct End {
    /// Joint values in units of the search.
    joints: Values,
    /// Length of the pose error there, in units of the search.
    miss: f64,
}

/// A goal for an arm, in units in which lengths and angles count equally: lengths are divided by that of the arm.
struct Search<'a> {
    arm: &'a Arm,
    goal: &'a Isometry3<f64>,
    ranges: Vec<JointRange>,
    unit_m: f64,
    near: Values,
}

impl<'a> Search<'a> {
    fn new(arm: &'a Arm, goal: &'a Isometry3<f64>, near: &[f64]) -> Self {
        let links: f64 = arm.joints().iter().map(|joint| joint.previous_from_joint.translation.vector.norm()).sum();
        let ends = arm.last_from_flange.translation.vector.norm() + arm.flange_from_tip.translation.vector.norm();
        // A turn moves the tip by half the length of the stretched arm on average; a gantry may have no links at all.
        let stretched = links + ends;
        let unit_m = if stretched > 0.1 { stretched / 2.0 } else { 0.5 };
        let mut search = Self { arm, goal, ranges: arm.ranges(), unit_m, near: Values::zeros() };
        for (i, value) in near.iter().enumerate() {
            let unit = search.unit(i);
            let range = &mut search.ranges[i];
            (range.min, range.max) = (range.min / unit, range.max / unit);
            search.near[i] = range.clamp(value / unit);
        }
        search
    }

    fn count(&self) -> usize {
        self.ranges.len()
    }

    /// What one unit of a joint is, radians or metres.
    fn unit(&self, joint: usize) -> f64 {
        match self.arm.joints()[joint].kind {
            JointKind::Revolute => 1.0,
            JointKind::Prismatic => self.unit_m,
        }
    }

    /// Values in radians and metres. Converted back, a value may exceed its limit by rounding.
    fn values(&self, joints: &Values) -> Vec<f64> {
        let value = |i: usize| self.arm.joints()[i].range.clamp(joints[i] * self.unit(i));
        (0..self.count()).map(value).collect()
    }

    /// Error of the pose, and its decrease with each joint.
    fn at(&self, joints: &Values) -> (Vector6<f64>, Columns) {
        let mut raw = [0.0; MAX_JOINTS];
        for (i, value) in raw.iter_mut().enumerate().take(self.count()) {
            *value = joints[i] * self.unit(i);
        }
        let (tip, mut columns) = self.arm.tip_and_columns(&raw[..self.count()]);
        let mut error = pose_error(&tip, self.goal);
        for i in 0..self.count() {
            let unit = self.unit(i);
            columns.column_mut(i).scale_mut(unit);
        }
        columns.fixed_rows_mut::<3>(0).scale_mut(1.0 / self.unit_m);
        error.fixed_rows_mut::<3>(0).scale_mut(1.0 / self.unit_m);
        (error, columns)
    }

    /// Levenberg–Marquardt within the ranges.
    ///
    /// The damping follows the error, which takes the descent past singularities and keeps it quadratic at its end:
    /// Sugihara 2011, "Solvability-unconcerned inverse kinematics by the Levenberg–Marquardt method".
    fn descend(&self, start: &Values) -> End {
        let mut joints = *start;
        let (mut error, mut columns) = self.at(&joints);
        let mut miss = error.norm();
        let (mut factor, mut mark, mut since) = (1.0, miss, 0);
        for _ in 0..ITERATIONS {
            if miss <= CONVERGED || !miss.is_finite() {
                break;
            }
            let damping = factor * 0.1 * miss * miss + LEAST_DAMPING * miss.min(1.0) + 1e-14;
            let Some(step) = self.step(&joints, &columns, &error, damping) else { break };
            let mut next = joints + step;
            for i in 0..self.count() {
                next[i] = self.ranges[i].clamp(next[i]);
            }
            let (next_error, next_columns) = self.at(&next);
            let next_miss = next_error.norm();
            if next_miss < miss {
                (joints, error, columns, miss) = (next, next_error, next_columns, next_miss);
                factor = (factor / 4.0_f64).max(1e-3);
            } else {
                factor *= 8.0;
            }
            since += 1;
            if miss < 0.9 * mark {
                (mark, since) = (miss, 0);
            } else if since >= PATIENCE {
                break;
            }
        }
        End { joints, miss }
    }

    /// One step: joints that are at an end of their range and would leave it are held, and where there are redundant
    /// joints those near an end are moved inwards.
    fn step(&self, joints: &Values, columns: &Columns, error: &Vector6<f64>, damping: f64) -> Option<Values> {
        let mut free = *columns;
        let mut step = damped_step(&free, error, damping)?;
        let mut held = [false; MAX_JOINTS];
        for _ in 0..self.count() {
            let mut changed = false;
            for i in 0..self.count() {
                let range = &self.ranges[i];
                let leaves = (joints[i] <= range.min && step[i] < 0.0) || (joints[i] >= range.max && step[i] > 0.0);
                if leaves && !held[i] {
                    held[i] = true;
                    changed = true;
                    free.column_mut(i).fill(0.0);
                }
            }
            if !changed {
                break;
            }
            step = damped_step(&free, error, damping)?;
        }
        let still_free = held[..self.count()].iter().filter(|held| !**held).count();
        if still_free > POSE {
            step += self.inwards(joints, &free, &held, damping, step.norm())?;
        }
        let largest = step.amax();
        Some(if largest > MAX_STEP { step * (MAX_STEP / largest) } else { step })
    }

    /// A motion that keeps the pose and takes joints away from the ends of their ranges, no longer than `most`.
    ///
    /// Liégeois 1977, "Automatic supervisory control of the configuration and behavior of multibody mechanisms".
    fn inwards(
        &self,
        joints: &Values,
        free: &Columns,
        held: &[bool; MAX_JOINTS],
        damping: f64,
        most: f64,
    ) -> Option<Values> {
        let mut request = Values::zeros();
        for i in (0..self.count()).filter(|&i| !held[i]) {
            let range = &self.ranges[i];
            let half = (range.max - range.min) / 2.0;
            if half.is_finite() && half > 0.0 {
                let from_middle = joints[i] - f64::midpoint(range.min, range.max);
                let excess = (from_middle.abs() / half - COMFORT).max(0.0);
                request[i] = -from_middle.signum() * half * excess;
            }
        }
        let sideways = free * request;
        let motion = request - damped_step(free, &sideways, damping)?;
        let length = motion.norm();
        Some(if length > most { motion * (most / length) } else { motion })
    }

    /// The end of a descent at the revolutions nearest to the present values, when it is at the goal.
    fn reached(&self, end: &End) -> Option<Values> {
        // The unit may be longer than a metre.
        if end.miss > REACHED / self.unit_m.max(1.0) {
            return None;
        }
        let mut joints = end.joints;
        for i in 0..self.count() {
            if self.arm.joints()[i].kind == JointKind::Revolute {
                joints[i] = nearest_turn(joints[i], self.near[i], &self.ranges[i]).unwrap_or(joints[i]);
            }
        }
        Some(joints)
    }

    /// Place `n` of those that fill the workspace; a joint without limits is taken around its present value.
    fn place(&self, n: u32) -> Values {
        let mut joints = Values::zeros();
        for i in 0..self.count() {
            let range = &self.ranges[i];
            // One revolution covers all angles, and an unlimited length is searched over four times the arm.
            let middle = if range.min.is_finite() && range.max.is_finite() {
                f64::midpoint(range.min, range.max)
            } else {
                self.near[i]
            };
            let most = if self.arm.joints()[i].kind == JointKind::Revolute { PI } else { 4.0 };
            let half = ((range.max - range.min) / 2.0).min(most);
            let value = middle + half * (2.0 * halton::coordinate(n, i) - 1.0);
            joints[i] = range.clamp(value);
        }
        joints
    }

    fn distance(&self, joints: &Values) -> f64 {
        (joints - self.near).norm()
    }

    fn largest_move(&self, joints: &Values) -> f64 {
        (joints - self.near).amax()
    }
}

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
