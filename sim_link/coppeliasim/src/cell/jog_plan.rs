//! The points of a jog, one per pass: along a fixed path, within limits of speed and acceleration, to a stop before
//! whatever is in the way. Nothing here knows a connection or a clock.

use handeye_arm::{IkError, JointKind, JointQuantity, JointRange, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
pub use handeye_plan::Contact;
use handeye_plan::{self as planning, Guard, SpeedLimits};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::joints::{CellJoint, in_rad, largest_change};
use super::reach::ArmKinematics;

/// Fastest jog of a joint [rad/s]: two thirds of what the model of the arm allows its joints by default.
pub const JOINT_SPEED: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// Half of what it allows [rad/s²]: from full speed a joint stops within 10°.
const JOINT_ACCELERATION: f64 = 180.0 * std::f64::consts::PI / 180.0;
/// Fastest jog of the tip along a line, and of a prismatic joint, which takes the tip along as fast [m/s]: the reduced speed
/// at which ISO 10218-1 lets people be near an arm.
pub const LINE_SPEED: f64 = 0.25;
/// From full speed the tip stops within 31 mm [m/s²].
const LINE_ACCELERATION: f64 = 1.0;
/// Fastest turn of the tip [rad/s].
pub const TURN_SPEED: f64 = 45.0 * std::f64::consts::PI / 180.0;
/// From full speed it stops within 6° [rad/s²].
const TURN_ACCELERATION: f64 = 180.0 * std::f64::consts::PI / 180.0;

/// Fastest joint while the tip is jogged [rad/s]: what the model of the arm allows its joints by default. One that shifts
/// over [`super::RAD_PER_M`] of it [m/s].
const JOINT_RATE: f64 = 90.0 * std::f64::consts::PI / 180.0;

/// Near a singular position the tip slows down so that no joint exceeds its rate; below this share of the fastest speed
/// it is not getting anywhere, and stops.
const CRAWL: f64 = 0.02;

/// Points of the way to a stop that are checked before each step.
const LOOK_AHEAD: usize = 8;

/// Points of a step of known length that are checked before it begins.
const STEP_SAMPLES: usize = 64;

/// A joint that turns by more between two neighbouring points of a path has changed to another configuration \[rad\].
const JUMP_RAD: f64 = 0.5;

/// Dimensions of a pose: joints beyond these are to spare.
const POSE: usize = 6;

/// Tolerance of a speed limit for rounding \[relative\].
const ROUNDING: f64 = 1e-6;

/// How often a step that is too fast is halved before it is given up: to less than the crawl.
const SLOWER_STEPS: usize = 6;

/// Closer to its end than this \[m, rad\] a path is at its end.
const AT_END: f64 = 1e-9;

/// Why a jog goes no further.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum JogObstacle {
    /// A joint is at the end of its range.
    #[error("joint {joint} is at the end of its range, {limit:.1}")]
    JointRange {
        /// Counted from 1 at the base.
        joint: usize,
        /// The end.
        limit: JointQuantity,
    },
    /// The arm reaches no further.
    #[error(transparent)]
    Reach(IkError),
    /// The joints would have to turn at once by a lot for the tip to move on by a little.
    #[error(
        "the arm is stretched, or two of its axes are in line: joint {joint} would be too fast; go another way or \
         move single joints"
    )]
    Singular {
        /// The fastest joint, counted from 1 at the base.
        joint: usize,
    },
    /// The arm would come nearer to something than it may.
    #[error(transparent)]
    Contact(Contact),
}

/// Where a jog leads.
#[derive(Debug, Clone, Copy)]
pub(super) enum Path<'a> {
    /// One joint from its start; `sign` is 1 or −1.
    Joint { index: usize, joint: CellJoint, sign: f64, start: JointValues },
    /// The tip from its start, along a unit vector of the base.
    Line { kinematics: &'a ArmKinematics, start: Pose<Base, Tip>, along: Vector3<f64> },
    /// The tip about an axis of the base through a point.
    Turn { kinematics: &'a ArmKinematics, start: Pose<Base, Tip>, about: Vector3<f64>, centre: Vector3<f64> },
}

impl Path<'_> {
    /// Fastest speed and acceleration along it.
    fn limits(&self) -> [f64; 2] {
        match self {
            Self::Joint { joint: CellJoint { kind: JointKind::Revolute, .. }, .. } => [JOINT_SPEED, JOINT_ACCELERATION],
            Self::Joint { .. } | Self::Line { .. } => [LINE_SPEED, LINE_ACCELERATION],
            Self::Turn { .. } => [TURN_SPEED, TURN_ACCELERATION],
        }
    }

    /// The joints after a distance, from those at a point shortly before.
    fn joints_at(&self, distance: f64, before: &JointValues) -> Result<JointValues, JogObstacle> {
        match self {
            Self::Joint { index, sign, start, .. } => {
                let mut joints = *start;
                joints[*index] += sign * distance;
                Ok(joints)
            }
            Self::Line { kinematics, start, along } => {
                let moved = Translation3::from(along * distance) * start.isometry();
                nearest(kinematics, &Pose::from_isometry(moved), before)
            }
            Self::Turn { kinematics, start, about, centre } => {
                let turn = UnitQuaternion::new(about * distance);
                let turn_about_centre = Isometry3::from_parts(Translation3::from(centre - turn * centre), turn);
                nearest(kinematics, &Pose::from_isometry(turn_about_centre * start.isometry()), before)
            }
        }
    }

    /// The joint that moves most, counted from 0, and by how much \[rad\].
    fn largest_change(&self, from: &JointValues, to: &JointValues) -> (usize, f64) {
        match self {
            Self::Joint { index, joint, .. } => (*index, in_rad(joint.kind, to[*index] - from[*index]).abs()),
            Self::Line { kinematics, .. } | Self::Turn { kinematics, .. } => {
                largest_change(kinematics.kinds(), from, to)
            }
        }
    }

    /// How far it leads, where that is known beforehand.
    fn end(&self) -> Option<(f64, JogObstacle)> {
        let Self::Joint { index, joint, sign, start } = self else { return None };
        let limit = if *sign > 0.0 { joint.range.max } else { joint.range.min };
        let obstacle = JogObstacle::JointRange { joint: index + 1, limit: joint.kind.quantity(limit) };
        limit.is_finite().then(|| (((limit - start[*index]) * sign).max(0.0), obstacle))
    }
}

/// The joints of the same configuration of the arm, or what is in the way.
///
/// Joints that an arm has to spare move as little as they can. Where that takes one of them to the end of its range, those
/// near an end give way as far as the others can do without them.
pub(super) fn nearest(
    kinematics: &ArmKinematics,
    goal: &Pose<Base, Tip>,
    before: &JointValues,
) -> Result<JointValues, JogObstacle> {
    // Without the ranges first: within them the nearest may be another configuration, and a jump.
    let half_turn = std::f64::consts::PI;
    let around: Vec<JointRange> =
        (before.iter()).map(|q| JointRange { min: q - half_turn, max: q + half_turn, speed: f64::INFINITY }).collect();
    let joints = near(kinematics, goal, before, &around)?;
    let arm = kinematics.arm();
    let Some(joint) = arm.first_violation(&joints) else { return Ok(joints) };
    let range = &arm.joints()[joint].range;
    if arm.joint_count() > POSE
        && let Ok(within) = near(kinematics, goal, before, &arm.ranges())
    {
        return Ok(within);
    }
    let limit = if joints[joint] > range.max { range.max } else { range.min };
    Err(JogObstacle::JointRange { joint: joint + 1, limit: arm.joints()[joint].kind.quantity(limit) })
}

fn near(
    kinematics: &ArmKinematics,
    goal: &Pose<Base, Tip>,
    before: &JointValues,
    ranges: &[JointRange],
) -> Result<JointValues, JogObstacle> {
    let joints = kinematics.reach_within(goal, before, ranges).map_err(JogObstacle::Reach)?;
    let (fastest, by_rad) = largest_change(kinematics.kinds(), before, &joints);
    if by_rad > JUMP_RAD { Err(JogObstacle::Singular { joint: fastest + 1 }) } else { Ok(joints) }
}

/// The fastest speed for the next `dt_s` from which the rest of a distance is enough to stop.
fn stopping_speed(distance: f64, acceleration: f64, dt_s: f64) -> f64 {
    let left = distance.max(0.0);
    // The solution of v·dt + v²/2a = distance, written so that nothing cancels.
    2.0 * left / (dt_s + (dt_s * dt_s + 2.0 * left / acceleration).sqrt())
}

/// Obstacles that a jog avoids, and where its tip is.
#[derive(Debug)]
pub(super) struct Watch<'a> {
    /// What it may come near to.
    pub guard: Guard<'a>,
    pub arm: &'a planning::Arm,
}

impl Watch<'_> {
    fn limits(&self) -> SpeedLimits {
        self.guard.surroundings().limits
    }

    /// The speed along a path at which the tip has its limit, from two points that are `between` apart on it.
    fn tip_limit(&self, from: &JointValues, to: &JointValues, between: f64) -> f64 {
        let Some(tip_m_s) = self.limits().tip_m_s else { return f64::INFINITY };
        match (self.arm.tip(from), self.arm.tip(to)) {
            (Some(from), Some(to)) => tip_m_s * between / from.distance_to(&to).0.max(f64::MIN_POSITIVE),
            _ => f64::INFINITY,
        }
    }
}

/// A jog under way.
#[derive(Debug)]
pub(super) struct JogPlan<'a> {
    path: Path<'a>,
    among: Option<Watch<'a>>,
    dt_s: f64,
    /// Length after which it ends by itself.
    length: Option<f64>,
    distance: f64,
    speed: f64,
    joints: JointValues,
    obstacle: Option<JogObstacle>,
}

impl<'a> JogPlan<'a> {
    /// From a standstill at `joints`, in passes of `dt_s`; with a `length` \[m, rad\] it ends there.
    ///
    /// # Errors
    /// What prevents a jog of the given length.
    pub fn new(
        path: Path<'a>,
        among: Option<Watch<'a>>,
        joints: JointValues,
        dt_s: f64,
        length: Option<f64>,
    ) -> Result<Self, JogObstacle> {
        let plan = Self { path, among, dt_s, length, distance: 0.0, speed: 0.0, joints, obstacle: None };
        plan.check_length()?;
        Ok(plan)
    }

    fn check_length(&self) -> Result<(), JogObstacle> {
        let Some(length) = self.length else { return Ok(()) };
        if let Some((end, obstacle)) = self.path.end()
            && length > end + AT_END
        {
            return Err(obstacle);
        }
        let [fastest, _] = self.limits();
        let mut joints = self.joints;
        for sample in 1..=STEP_SAMPLES {
            let between = length / STEP_SAMPLES as f64;
            let next = self.joints_at(between * sample as f64, &joints)?;
            self.rate_limit(&joints, &next, between, fastest)?;
            joints = next;
        }
        Ok(())
    }

    /// The joints for the next pass; `share` of the fastest speed is wanted, and a standstill with `None`.
    pub fn advance(&mut self, share: Option<f64>) -> JointValues {
        let [fastest, acceleration] = self.limits();
        let wanted = share.filter(|share| share.is_finite()).map_or(0.0, |share| share.clamp(0.0, 1.0) * fastest);
        let change = acceleration * self.dt_s;
        let next = wanted.clamp((self.speed - change).max(0.0), self.speed + change);
        self.speed = next.min(self.free_speed(next));
        if let Err(obstacle) = self.step() {
            (self.speed, self.obstacle) = (0.0, Some(obstacle));
        }
        self.joints
    }

    /// Moves on for one pass, more slowly if a joint would be too fast: the speed between the checked points may be
    /// higher than at them.
    fn step(&mut self) -> Result<(), JogObstacle> {
        let mut joint = 0;
        for _ in 0..SLOWER_STEPS {
            let mut distance = self.distance + self.speed * self.dt_s;
            if let Some(length) = self.length
                && length - distance < AT_END
            {
                distance = length;
            }
            let joints = self.joints_at(distance, &self.joints)?;
            let (fastest, by_rad) = self.path.largest_change(&self.joints, &joints);
            let moved = distance - self.distance;
            let tip_limit = self
                .among
                .as_ref()
                .map_or(f64::INFINITY, |among| among.tip_limit(&self.joints, &joints, moved.max(f64::MIN_POSITIVE)));
            if by_rad <= self.joint_rate() * self.dt_s && moved <= tip_limit * self.dt_s * (1.0 + ROUNDING) {
                (self.joints, self.distance) = (joints, distance);
                return Ok(());
            }
            joint = fastest + 1;
            self.speed /= 2.0;
        }
        Err(JogObstacle::Singular { joint })
    }

    /// Fastest speed and acceleration along the path.
    fn limits(&self) -> [f64; 2] {
        let [speed, acceleration] = self.path.limits();
        let Some(limits) = self.among.as_ref().map(Watch::limits) else { return [speed, acceleration] };
        let speed = match self.path {
            Path::Joint { joint: CellJoint { kind: JointKind::Revolute, .. }, .. } => limits.joint(speed),
            Path::Joint { .. } | Path::Line { .. } => limits.tip(speed),
            Path::Turn { .. } => speed,
        };
        [speed, acceleration]
    }

    /// The fastest joint while the tip is jogged \[rad/s\].
    fn joint_rate(&self) -> f64 {
        self.among.as_ref().map_or(JOINT_RATE, |among| among.limits().joint(JOINT_RATE))
    }

    /// The joints after a distance, from those at a point shortly before, where nothing is in the way.
    fn joints_at(&self, distance: f64, before: &JointValues) -> Result<JointValues, JogObstacle> {
        let joints = self.path.joints_at(distance, before)?;
        match self.among.as_ref().and_then(|among| among.guard.contact(&joints)) {
            Some(contact) => Err(JogObstacle::Contact(contact)),
            None => Ok(joints),
        }
    }

    /// Whether the arm is at rest.
    pub fn is_at_rest(&self) -> bool {
        self.speed <= AT_END || self.is_at_end()
    }

    /// Whether its length is complete.
    pub fn is_at_end(&self) -> bool {
        self.length.is_some_and(|length| self.distance >= length)
    }

    /// The obstacle, once the jog slows down for it.
    pub fn obstacle(&self) -> Option<&JogObstacle> {
        self.obstacle.as_ref()
    }

    /// The fastest speed up to `speed` that leaves the way to stop, and no joint faster than it may be.
    fn free_speed(&mut self, speed: f64) -> f64 {
        let [fastest, acceleration] = self.limits();
        let stopping = |distance: f64| stopping_speed(distance, acceleration, self.dt_s);
        let mut free = speed;
        self.obstacle = None;
        if let Some(length) = self.length {
            free = free.min(stopping(length - self.distance));
        }
        if let Some((end, obstacle)) = self.path.end() {
            let bound = stopping(end - self.distance);
            if bound < free {
                (free, self.obstacle) = (bound, Some(obstacle));
            }
        }
        if self.among.is_none() && matches!(self.path, Path::Joint { .. }) {
            return free;
        }
        let between = (speed * self.dt_s + speed * speed / (2.0 * acceleration)) / LOOK_AHEAD as f64;
        if between <= 0.0 {
            return free;
        }
        let mut joints = self.joints;
        for sample in 1..=LOOK_AHEAD {
            let behind = between * (sample - 1) as f64;
            let ahead = self.joints_at(self.distance + between * sample as f64, &joints).and_then(|next| {
                let rate_limit = self.rate_limit(&joints, &next, between, fastest)?;
                Ok((next, rate_limit))
            });
            match ahead {
                Ok((next, rate_limit)) => {
                    free = free.min((rate_limit * rate_limit + 2.0 * acceleration * behind).sqrt());
                    joints = next;
                }
                Err(obstacle) => {
                    self.obstacle = Some(obstacle);
                    return free.min(stopping(behind));
                }
            }
        }
        free
    }

    /// The speed along the path at which the fastest joint has its rate.
    fn rate_limit(&self, from: &JointValues, to: &JointValues, between: f64, fastest: f64) -> Result<f64, JogObstacle> {
        let tip_limit = self.among.as_ref().map_or(f64::INFINITY, |among| among.tip_limit(from, to, between));
        if matches!(self.path, Path::Joint { .. }) {
            return Ok(fastest.min(tip_limit));
        }
        let (joint, by_rad) = self.path.largest_change(from, to);
        let limit = self.joint_rate() * between / by_rad.max(f64::MIN_POSITIVE);
        if limit < CRAWL * fastest {
            Err(JogObstacle::Singular { joint: joint + 1 })
        } else {
            Ok(limit.min(fastest).min(tip_limit))
        }
    }
}

#[cfg(test)]
#[path = "jog_plan_tests.rs"]
mod tests;
