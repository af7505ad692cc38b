//! The points of an arm that follows a goal, one per pass. Nothing here knows a connection or a clock.
//!
//! In every pass the plan knows how it would come to rest from where it is: all joints slow down together, so that each
//! keeps its direction. A step is taken only if that way to rest, from where the step leads, keeps all limits, the
//! ranges of the joints and the workspace, and touches nothing; otherwise less of the step is taken, in the worst case
//! none, and the arm brakes. So whatever goals come, the limits hold from the first pass to the last, and the arm can always be stopped.
//!
//! An obstacle does not end following: the arm passes it, as near to its goal as possible, or waits and goes on when the goal does.

use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3::rotation_vector;
use handeye_plan::Guard;
use nalgebra::{Isometry3, Vector3};

use super::follow_goal::{FollowEnd, FollowGoal, FollowLimits, moved};
use super::jog_plan::{JogObstacle, nearest};
use super::joints::{in_rad, largest_change, of_rad};
use super::keep_off::{self, Room};
use super::reach::ArmKinematics;

/// Share of the tip's acceleration that slows it down; the rest is for the curve that it takes when all joints brake.
const BRAKING_SHARE: f64 = 0.9;

/// Share of the tip's acceleration with which it comes closer to a goal that it has to stop at; the rest is for what the
/// goal does meanwhile.
const APPROACH_SHARE: f64 = 0.7;

/// Near the goal the tip makes up for this share of its distance per second [1/s]: slow enough that the noise of a goal
/// from images, 0.1 mm from one to the next, needs less than a fiftieth of the acceleration.
const APPROACH_RATE: f64 = 8.0;

/// Largest share of the distance that is made up for in one pass: with more, a long pass would swing past the goal.
const APPROACH_PER_PASS: f64 = 0.5;

/// Where the joints are so fast that the tip moves at less than this share of its limits, it makes no progress.
const CRAWL: f64 = 0.05;

/// A step in which a joint would be too fast is slowed down at least by this factor, as long as it is faster than the
/// crawl.
const LEAST_SLOWING: f64 = 0.9;
/// Number of such reductions: from full speed to less than the crawl.
const SLOWINGS: usize = 32;

/// How finely the share of a step that can be taken is sought: to a 64th.
const HALVINGS: usize = 6;

/// Passes to rest, at most: a step from which it would take more is not taken. With the limits that are the defaults it
/// takes less than a second.
const LONGEST_BRAKING: usize = 4000;

/// Tolerance of the limits for rounding \[relative\].
const ROUNDING: f64 = 1e-6;

/// The arm in motion: where it is, and its speeds in the last pass.
#[derive(Debug, Clone, Copy)]
struct Moving {
    joints: JointValues,
    /// In rad/s, or m/s of a prismatic joint.
    rates: JointValues,
    base_from_tip: Isometry3<f64>,
    velocity_m_s: Vector3<f64>,
    turn_rad_s: Vector3<f64>,
}

impl Moving {
    fn at_rest(kinematics: &ArmKinematics, joints: JointValues) -> Self {
        let base_from_tip = *kinematics.tip(&joints).isometry();
        let (velocity_m_s, turn_rad_s) = (Vector3::zeros(), Vector3::zeros());
        Self { joints, rates: JointValues::zeros(joints.len()), base_from_tip, velocity_m_s, turn_rad_s }
    }

    /// One pass later, if the joints move at these rates.
    fn after(&self, kinematics: &ArmKinematics, rates: JointValues, dt_s: f64) -> Self {
        let joints = JointValues::from_fn(rates.len(), |i| self.joints[i] + rates[i] * dt_s);
        let base_from_tip = *kinematics.tip(&joints).isometry();
        let shift = base_from_tip.translation.vector - self.base_from_tip.translation.vector;
        let turn = rotation_vector(&(base_from_tip.rotation * self.base_from_tip.rotation.inverse()));
        Self { joints, rates, base_from_tip, velocity_m_s: shift / dt_s, turn_rad_s: turn / dt_s }
    }

    fn is_at_rest(&self) -> bool {
        self.rates.iter().all(|rate| *rate == 0.0)
    }
}

/// An arm that follows.
#[derive(Debug)]
pub(super) struct FollowPlan<'a> {
    kinematics: &'a ArmKinematics,
    guard: Option<Guard<'a>>,
    limits: FollowLimits,
    dt_s: f64,
    now: Moving,
    obstacle: Option<FollowEnd>,
    is_kept_off: bool,
}

impl<'a> FollowPlan<'a> {
    /// From a standstill at `joints`, in passes of `dt_s`; `limits` have to be valid.
    ///
    /// # Errors
    /// A joint out of its range, or a tip outside of the workspace: no motion is possible.
    pub fn new(
        kinematics: &'a ArmKinematics,
        limits: &FollowLimits,
        guard: Option<Guard<'a>>,
        joints: JointValues,
        dt_s: f64,
    ) -> Result<Self, FollowEnd> {
        if let Some(joint) = kinematics.arm().first_violation(&joints) {
            return Err(FollowEnd::JointLimit { joint: joint + 1 });
        }
        let now = Moving::at_rest(kinematics, joints);
        if !limits.workspace.contains(&now.base_from_tip.translation.vector) {
            return Err(FollowEnd::Workspace);
        }
        Ok(Self { kinematics, guard, limits: *limits, dt_s, now, obstacle: None, is_kept_off: false })
    }

    /// The joints as they were last sent \[rad\].
    pub fn joints(&self) -> &JointValues {
        &self.now.joints
    }

    /// The tip by these joints.
    pub fn base_from_tip(&self) -> Pose<Base, Tip> {
        Pose::from_isometry(self.now.base_from_tip)
    }

    /// What was in the way; the arm comes to rest, and goals are ignored.
    pub fn obstacle(&self) -> Option<FollowEnd> {
        self.obstacle.clone()
    }

    /// Whether in the last pass the arm did not move as its goal asked, because it would have come too near to an
    /// obstacle.
    pub fn is_kept_off(&self) -> bool {
        self.is_kept_off
    }

    /// Whether the arm is at rest.
    pub fn is_at_rest(&self) -> bool {
        self.now.is_at_rest()
    }

    /// Reports that the arm is at rest after all, because it did not get its points for a while.
    pub fn stand(&mut self) {
        self.now = Moving::at_rest(self.kinematics, self.now.joints);
    }

    /// The joints for the next pass [rad]: towards the goal for the time of this point, or to rest with `None`.
    pub fn advance(&mut self, goal: Option<&FollowGoal>) -> JointValues {
        let braked = self.braked(&self.now);
        self.is_kept_off = false;
        self.now = match goal.filter(|_| self.obstacle.is_none()).map(|goal| self.rates_towards(goal)) {
            None => braked,
            Some(Err(obstacle)) => {
                self.obstacle = Some(obstacle);
                braked
            }
            Some(Ok(rates)) => {
                let kept_off = self.kept_off(&rates);
                self.is_kept_off = kept_off.is_some();
                self.most_of(&kept_off.unwrap_or(rates), &braked)
            }
        };
        self.now.joints
    }

    /// One pass of coming to rest: all joints by the same share, as fast as the limits allow.
    fn braked(&self, now: &Moving) -> Moving {
        let limits = &self.limits;
        let rates_rad_s = self.kinematics.kinds().zip(now.rates.iter()).map(|(kind, rate)| in_rad(kind, *rate));
        let fastest = rates_rad_s.fold(0.0, |most: f64, rate| most.max(rate.abs()));
        let lost = [
            limits.joint_acceleration_rad_s2 * self.dt_s / fastest,
            BRAKING_SHARE * limits.acceleration_m_s2 * self.dt_s / now.velocity_m_s.norm(),
            BRAKING_SHARE * limits.turn_acceleration_rad_s2 * self.dt_s / now.turn_rad_s.norm(),
        ];
        // A speed of zero gives an infinite share or NaN; neither is the smallest.
        let kept = 1.0 - lost.into_iter().fold(1.0, f64::min);
        now.after(self.kinematics, now.rates.map(|rate| rate * kept), self.dt_s)
    }

    /// Rates of the joints that the goal asks for, none faster than it may be.
    fn rates_towards(&self, goal: &FollowGoal) -> Result<JointValues, FollowEnd> {
        let goal_in_base = goal.base_from_tip.isometry();
        if !self.limits.workspace.contains(&goal_in_base.translation.vector) {
            return Err(FollowEnd::Workspace);
        }
        let (velocity_m_s, turn_rad_s) = self.twist_towards(goal);
        let share_of_limits =
            (velocity_m_s.norm() / self.limits.speed_m_s).max(turn_rad_s.norm() / self.limits.turn_rad_s);
        let largest_step = self.limits.joint_speed_rad_s * self.dt_s;
        let mut share = 1.0;
        for _ in 0..SLOWINGS {
            let step_s = self.dt_s * share;
            let next = moved(&self.now.base_from_tip, &(velocity_m_s * step_s), &(turn_rad_s * step_s));
            share *= match nearest(self.kinematics, &Pose::from_isometry(next), &self.now.joints) {
                Ok(joints) => {
                    let (_, by_rad) = largest_change(self.kinematics.kinds(), &self.now.joints, &joints);
                    if by_rad <= largest_step {
                        let rate = |i: usize| (joints[i] - self.now.joints[i]) / self.dt_s;
                        return Ok(JointValues::from_fn(joints.len(), rate));
                    }
                    (largest_step / by_rad).min(LEAST_SLOWING)
                }
                Err(JogObstacle::JointRange { joint, .. }) => return Err(FollowEnd::JointLimit { joint }),
                // Contacts are checked afterwards.
                Err(JogObstacle::Reach(_) | JogObstacle::Singular { .. } | JogObstacle::Contact(_)) => 0.5,
            };
            if share * share_of_limits < CRAWL {
                break;
            }
        }
        Err(FollowEnd::Singular)
    }

    /// Velocity [m/s] and angular velocity [rad/s] of the tip for the next pass, within its limits.
    fn twist_towards(&self, goal: &FollowGoal) -> (Vector3<f64>, Vector3<f64>) {
        let (limits, now, dt_s) = (&self.limits, &self.now, self.dt_s);
        let velocity_m_s = goal.velocity_m_s.cap_magnitude(limits.speed_m_s);
        let turn_rad_s = goal.angular_velocity_rad_s.cap_magnitude(limits.turn_rad_s);
        // The goal is for one pass later; its distance from the tip now is the distance left if both move on in the
        // same way.
        let goal_now = moved(goal.base_from_tip.isometry(), &(velocity_m_s * -dt_s), &(turn_rad_s * -dt_s));
        let shift = goal_now.translation.vector - now.base_from_tip.translation.vector;
        let turn = rotation_vector(&(goal_now.rotation * now.base_from_tip.rotation.inverse()));
        let rate = APPROACH_RATE.min(APPROACH_PER_PASS / dt_s);
        let linear = (limits.speed_m_s, limits.acceleration_m_s2);
        let angular = (limits.turn_rad_s, limits.turn_acceleration_rad_s2);
        (
            within(&now.velocity_m_s, &(velocity_m_s + approach(&shift, linear, rate)), linear, dt_s),
            within(&now.turn_rad_s, &(turn_rad_s + approach(&turn, angular, rate)), angular, dt_s),
        )
    }

    /// Rates as near to these as keep the arm off what it must not touch; `None` where they do that already.
    fn kept_off(&self, rates: &JointValues) -> Option<JointValues> {
        let guard = self.guard.as_ref()?;
        let FollowLimits { speed_m_s, acceleration_m_s2, turn_rad_s, .. } = self.limits;
        let rate = APPROACH_RATE.min(APPROACH_PER_PASS / self.dt_s);
        let room = Room::at(guard, &self.now.joints, nearing_distance(speed_m_s, acceleration_m_s2, rate))?;
        let fastest = nearing_speed(room.left_m, acceleration_m_s2, rate);
        let jacobian = self.kinematics.jacobian(&self.now.joints)?;
        // As much of a turn as of a shift: what both take at their limits.
        keep_off::deflected(rates, &room, -fastest, &jacobian, speed_m_s / turn_rad_s)
    }

    /// As much of a step as can be taken; the rest of it is braking.
    fn most_of(&self, rates: &JointValues, braked: &Moving) -> Moving {
        let change_rad_s = self.limits.joint_acceleration_rad_s2 * self.dt_s;
        let mut share: f64 = 1.0;
        for (i, (kind, wanted)) in self.kinematics.kinds().zip(rates.iter()).enumerate() {
            let change = of_rad(kind, change_rad_s);
            let more = wanted - braked.rates[i];
            let spent = (braked.rates[i] - self.now.rates[i]) * more.signum();
            if more.abs() > change - spent {
                share = share.min((change - spent).max(0.0) / more.abs());
            }
        }
        let step = |share: f64| {
            let rate = |i: usize| braked.rates[i] + (rates[i] - braked.rates[i]) * share;
            let rates = JointValues::from_fn(rates.len(), rate);
            let next = self.now.after(self.kinematics, rates, self.dt_s);
            self.can_be_taken(&next).then_some(next)
        };
        if let Some(whole) = step(share) {
            return whole;
        }
        let (mut best, mut too_much, mut taken) = (*braked, share, 0.0);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(taken, too_much);
            match step(middle) {
                Some(next) => (best, taken) = (next, middle),
                None => too_much = middle,
            }
        }
        best
    }

    /// Whether a step, and coming to rest after it, keep all limits.
    fn can_be_taken(&self, next: &Moving) -> bool {
        if !self.is_allowed(&self.now, next) {
            return false;
        }
        let mut now = *next;
        for _ in 0..LONGEST_BRAKING {
            if now.is_at_rest() {
                return true;
            }
            let braked = self.braked(&now);
            if !self.is_allowed(&now, &braked) {
                return false;
            }
            now = braked;
        }
        false
    }

    fn is_allowed(&self, from: &Moving, to: &Moving) -> bool {
        let limits = &self.limits;
        let is_within = |value: f64, limit: f64| value <= limit * (1.0 + ROUNDING);
        self.kinematics.kinds().enumerate().all(|(i, kind)| {
            let change = in_rad(kind, to.rates[i] - from.rates[i]).abs();
            is_within(in_rad(kind, to.rates[i]).abs(), limits.joint_speed_rad_s)
                && is_within(change, limits.joint_acceleration_rad_s2 * self.dt_s)
        }) && is_within(to.velocity_m_s.norm(), limits.speed_m_s)
            && is_within((to.velocity_m_s - from.velocity_m_s).norm(), limits.acceleration_m_s2 * self.dt_s)
            && is_within(to.turn_rad_s.norm(), limits.turn_rad_s)
            && is_within((to.turn_rad_s - from.turn_rad_s).norm(), limits.turn_acceleration_rad_s2 * self.dt_s)
            && limits.workspace.contains(&to.base_from_tip.translation.vector)
            && self.kinematics.arm().first_violation(&to.joints).is_none()
            && self.guard.as_ref().is_none_or(|guard| guard.contact(&to.joints).is_none())
    }
}

/// The speed at which the remaining distance shrinks: in proportion to it when it is small, else so that a steady
/// deceleration takes it there. Both meet with the same slope, so the deceleration is never exceeded.
fn approach(left: &Vector3<f64>, (fastest, acceleration): (f64, f64), rate: f64) -> Vector3<f64> {
    let distance = left.norm();
    if distance == 0.0 {
        return Vector3::zeros();
    }
    left * (nearing_speed(distance, acceleration, rate).min(fastest) / distance)
}

/// The speed at which a distance may shrink: in proportion to it, or at a steady deceleration.
fn nearing_speed(distance: f64, acceleration: f64, rate: f64) -> f64 {
    let deceleration = APPROACH_SHARE * acceleration;
    let proportional = deceleration / (rate * rate);
    if distance <= proportional {
        rate * distance
    } else {
        (2.0 * deceleration * (distance - proportional / 2.0)).sqrt()
    }
}

/// Farther away nothing is neared too fast at this speed.
fn nearing_distance(speed: f64, acceleration: f64, rate: f64) -> f64 {
    // Where `nearing_speed` is as much; more than that where it is still proportional.
    let deceleration = APPROACH_SHARE * acceleration;
    speed * speed / (2.0 * deceleration) + deceleration / (2.0 * rate * rate)
}

/// The wanted speed, as far as the limits of speed and acceleration allow.
fn within(now: &Vector3<f64>, wanted: &Vector3<f64>, (fastest, acceleration): (f64, f64), dt_s: f64) -> Vector3<f64> {
    let change = wanted.cap_magnitude(fastest) - now;
    now + change.cap_magnitude(acceleration * dt_s)
}

#[cfg(test)]
#[path = "follow_plan_tests.rs"]
mod tests;
