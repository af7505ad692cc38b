//! Motions to a goal: of the joints, and of the tip along a straight line.
//!
//! Each point is computed here and sent for one pass of the simulation, as for a jog: the arm stops within a pass when
//! this client hangs, crashes, or loses its connection, a stop is braked on every simulator, and a server only has to set
//! joint positions. In every pass the joints are where they were sent, or the motion ends and reports which is not.
//!
//! For the tip that takes an arm whose kinematics is known; any other is left to the server, see [`super::served`].

use std::time::{Duration, Instant};

use handeye_arm::{JointKind, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_plan::travel;

use super::arm::{MotionTolerance, SettleOptions};
use super::joint_elsewhere::joint_elsewhere;
use super::joints::{difference_rad, largest_change, of_rad};
use super::reach::ArmKinematics;
use super::stream::{PLACED_OFF_RAD, Pass, Point, Stream};
use super::{Arm, require_running};
use crate::error::LinkError;
use crate::options::CallOptions;
use crate::sim::MotionLimits;
use handeye_motion::{self as motion, JointMotion, MotionState, Sync};

/// Longest motion, in real time. The slowest sensible one takes a minute; a simulation may run slower than real time.
pub(super) const LONGEST_MOTION: Duration = Duration::from_mins(10);

/// How long a pass that is under way may go on after a motion was cancelled: a pass takes a twentieth of a second, but
/// another client may hold the simulation forever.
pub(super) const BRAKE_GRACE: Duration = Duration::from_millis(300);

/// Longest time to come to rest, in real time. From the fastest motion of the reference sequence it takes about two seconds.
pub(super) const LONGEST_BRAKING: Duration = Duration::from_secs(10);

/// An arm that got no point for longer has come to rest for all to see, and starts from there. Passes do not count: a
/// simulation that does not keep to real time runs many while a point is computed.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// Fastest joint on a straight line \[rad/s\], that of the stock UR5 model: where some joint would have to be faster, the
/// line leads past a singular position. One that shifts over [`super::RAD_PER_M`] of it \[m/s\], as of all that follows.
const LINE_JOINT_SPEED_RAD_S: f64 = std::f64::consts::FRAC_PI_2;

/// Braking of a stop, harder than the motion's own: joints as hard as those of the stock UR5 may [rad/s², rad/s³], the
/// tip, which stays on its line, from 0.3 m/s within two passes and 15 mm [m/s² and rad/s², m/s³ and rad/s³].
const JOINT_BRAKE: [f64; 2] = [2.0 * std::f64::consts::PI, 20.0 * std::f64::consts::PI];
const LINE_BRAKE: [f64; 2] = [6.0, 240.0];

/// Joints that move by less in a pass are at rest \[rad\], and passes after which an arm that does not come nearer is
/// at rest.
const STANDS_RAD: f64 = 1e-5;
const LONGEST_OVERTIME_PASSES: u32 = 100;

/// Passes of a line that are gone through beforehand at most.
const MOST_PASSES: usize = 100_000;
/// Space diagonal of a unit cube.
const SPACE_DIAGONAL: f64 = 1.732_050_807_568_877_2;

/// Largest distance of a controlled joint from its goal at the end of a motion \[rad\]: a load keeps it from its target by
/// a little.
const ARRIVED_OFF_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// A way to a goal, and where on it the arm is.
#[derive(Debug, Clone)]
enum Way<'a> {
    /// All joints at once.
    Joints(Box<Joints>),
    /// The tip along a line.
    Line(Box<Line<'a>>),
}

#[derive(Debug, Clone)]
struct Joints {
    motion: JointMotion,
    limits: motion::MotionLimits,
    goal: JointValues,
    kinds: Vec<JointKind>,
}

#[derive(Debug, Clone)]
struct Line<'a> {
    kinematics: &'a ArmKinematics,
    motion: motion::PoseMotion,
    limits: motion::MotionLimits,
    /// Fastest joint while the tip is off its line, and the most that is allowed on it.
    joint_speed_rad_s: f64,
    goal: Pose<Base, Tip>,
    joints: JointValues,
    /// Speeds of the tip, along x, y, z and about its axis.
    speeds: Vec<f64>,
    /// Velocities of the joints while the tip is off its line.
    astray: Option<JointValues>,
    /// Passes since the end of the line.
    overtime: u32,
    is_over: bool,
}

impl<'a> Way<'a> {
    fn joints(
        start: &JointValues,
        goal: &JointValues,
        limits: &MotionLimits,
        kinds: Vec<JointKind>,
    ) -> Result<Self, LinkError> {
        let limits = generator_limits(limits);
        let rest = MotionState::at_rest(start.to_vec());
        let motion = JointMotion::new(rest, goal, &JointValues::zeros(goal.len()), Some(&limits), Sync::Phase)
            .map_err(|error| unplanned(&error))?;
        Ok(Self::Joints(Box::new(Joints { motion, limits, goal: *goal, kinds })))
    }

    fn line(
        kinematics: &'a ArmKinematics,
        start: &JointValues,
        goal: &Pose<Base, Tip>,
        limits: &MotionLimits,
        joint_speed_rad_s: f64,
    ) -> Result<Self, LinkError> {
        let limits = generator_limits(limits);
        let tip = kinematics.tip(start);
        let motion = motion::PoseMotion::new(tip.isometry(), goal.isometry(), Some(&limits), None, Sync::Phase)
            .map_err(|error| unplanned(&error))?;
        Ok(Self::Line(Box::new(Line {
            kinematics,
            motion,
            limits,
            joint_speed_rad_s,
            goal: *goal,
            joints: *start,
            speeds: vec![0.0; 4],
            astray: None,
            overtime: 0,
            is_over: false,
        })))
    }

    /// The joints one pass later.
    fn next(&mut self, time_step_s: f64) -> JointValues {
        match self {
            Self::Joints(joints) => {
                let step = joints.motion.step(time_step_s);
                JointValues::from_fn(joints.goal.len(), |i| step.pos[i])
            }
            Self::Line(line) => line.next(time_step_s),
        }
    }

    fn is_over(&self) -> bool {
        match self {
            Self::Joints(joints) => joints.motion.at(joints.motion.time_s()).finished,
            Self::Line(line) => line.is_over,
        }
    }

    /// Replaces the rest by coming to rest: of the tip on its line, or of the joints where it is off its line, so that it
    /// does not go there first.
    fn brake(&mut self) {
        if let Self::Line(line) = self
            && let Some(vel) = line.astray
        {
            let state = MotionState { vel: vel.to_vec(), ..MotionState::at_rest(line.joints.to_vec()) };
            let kinds: Vec<JointKind> = line.kinematics.kinds().collect();
            let limits = joint_brake(&kinds, &vel);
            match JointMotion::stop(state, &limits) {
                Ok(stop) => {
                    let goal = JointValues::from_fn(kinds.len(), |i| stop.target_pos()[i]);
                    *self = Self::Joints(Box::new(Joints { motion: stop, limits, goal, kinds }));
                }
                Err(error) => tracing::error!(%error, "a motion could not be braked"),
            }
            return;
        }
        let braked = match self {
            Self::Joints(joints) => {
                let state = joints.motion.at(joints.motion.time_s()).state();
                let limits = joint_brake(&joints.kinds, &state.vel);
                JointMotion::stop(state, &limits).map(|stop| joints.motion = stop)
            }
            Self::Line(line) => line.motion.stop(&brake(&line.speeds, |_| LINE_BRAKE)).map(|stop| line.motion = stop),
        };
        if let Err(error) = braked {
            // There is a way to rest from any state.
            tracing::error!(%error, "a motion could not be braked");
        }
    }

    /// The same goal from a standstill.
    fn begin_again(&mut self, joints: &JointValues) {
        let rest = MotionState::at_rest(joints.to_vec());
        match self {
            Self::Joints(way) => {
                let still = JointValues::zeros(way.goal.len());
                if let Ok(again) = JointMotion::new(rest, &way.goal, &still, Some(&way.limits), Sync::Phase) {
                    way.motion = again;
                }
            }
            Self::Line(line) => {
                let tip = line.kinematics.tip(joints);
                let (goal, limits) = (line.goal.isometry(), Some(&line.limits));
                if let Ok(again) = motion::PoseMotion::new(tip.isometry(), goal, limits, None, Sync::Phase) {
                    (line.motion, line.joints, line.astray) = (again, *joints, None);
                }
            }
        }
    }
}

fn joint_brake(kinds: &[JointKind], vel: &[f64]) -> motion::MotionLimits {
    brake(vel, |i| JOINT_BRAKE.map(|limit| of_rad(kinds[i], limit)))
}

/// Limits of braking; `hardest` gives acceleration and jerk.
fn brake(vel: &[f64], hardest: impl Fn(usize) -> [f64; 2]) -> motion::MotionLimits {
    // Braking makes nothing faster, so the limit of speed is only not to be in the way.
    let fastest = vel.iter().fold(1.0_f64, |fastest, vel| fastest.max(vel.abs()));
    motion::MotionLimits {
        max_vel: vec![2.0 * fastest; vel.len()],
        max_accel: (0..vel.len()).map(|i| hardest(i)[0]).collect(),
        max_jerk: (0..vel.len()).map(|i| hardest(i)[1]).collect(),
        min_vel: None,
        min_accel: None,
    }
}

impl Line<'_> {
    /// The joints one pass later.
    ///
    /// Where the line leads out of reach, past a singular position or to the end of a joint, the tip leaves it by as much
    /// as it takes, and comes back to it as fast as the joints may.
    fn next(&mut self, time_step_s: f64) -> JointValues {
        let step = self.motion.step(time_step_s);
        let most_rad = self.joint_speed_rad_s * time_step_s;
        let on_line = Pose::from_isometry(step.pose);
        let solved = self.kinematics.reach(&on_line, &self.joints).ok();
        let kinematics = self.kinematics;
        let travel_rad = |from: &JointValues, to: &JointValues| largest_change(kinematics.kinds(), from, to).1;
        let exact = solved.filter(|joints| travel_rad(joints, &self.joints) <= most_rad);
        let joints = exact.unwrap_or_else(|| {
            // The way back may lead through what kept the tip from its line; the goal itself is worth a detour.
            let goal = solved.filter(|_| step.finished);
            let wanted = goal.unwrap_or_else(|| self.kinematics.towards(&on_line, &self.joints));
            let share = (most_rad / travel_rad(&wanted, &self.joints)).min(1.0);
            JointValues::from_fn(wanted.len(), |i| self.joints[i] + share * (wanted[i] - self.joints[i]))
        });
        self.overtime += u32::from(step.finished);
        let stands = exact.is_some() || travel_rad(&joints, &self.joints) < STANDS_RAD;
        self.is_over = step.finished && (stands || self.overtime > LONGEST_OVERTIME_PASSES);
        let vel = JointValues::from_fn(joints.len(), |i| (joints[i] - self.joints[i]) / time_step_s);
        self.astray = exact.is_none().then_some(vel);
        (self.joints, self.speeds) = (joints, step.vel);
        joints
    }
}

fn generator_limits(limits: &MotionLimits) -> motion::MotionLimits {
    motion::MotionLimits {
        max_vel: limits.velocity.clone(),
        max_accel: limits.acceleration.clone(),
        max_jerk: limits.jerk.clone(),
        min_vel: None,
        min_accel: None,
    }
}

fn unplanned(error: &motion::MotionError) -> LinkError {
    LinkError::NoProfile { reason: error.to_string() }
}

impl Arm {
    /// Moves the joints to `goal` (rad, or m of a prismatic joint) within `limits` and those of the surroundings, and
    /// returns when they are there and, where a controller moves them, at rest.
    ///
    /// # Errors
    /// [`LinkError::JointCount`], [`LinkError::JointOutOfRange`], [`LinkError::InTheWay`] or [`LinkError::BadMotion`]
    /// before anything moves; [`LinkError::NotRunning`];
    /// [`LinkError::Cancelled`] with the arm at rest, [`LinkError::MotionStopped`] when it was another client that
    /// stopped it; [`LinkError::JointElsewhere`] when something else moves or holds a joint.
    pub fn move_to_joints(
        &mut self,
        goal: &[f64],
        limits: &MotionLimits,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        const TASK: &str = "moving the joints";
        let goal = self.check_range(goal)?;
        limits.validate(goal.len())?;
        let start = self.ready(TASK, cancel)?;
        let limits = &self.limits_to(&start, &goal, limits)?;
        let dynamic = self.send_motion(
            Way::joints(&start, &goal, limits, self.info.joint_kinds().collect())?,
            start,
            TASK,
            cancel,
        )?;
        if dynamic.contains(&true) {
            self.settle(&SettleOptions::default(), cancel)?;
        }
        let here = self.joint_values()?;
        let most_rad = |joint: usize| if dynamic[joint] { ARRIVED_OFF_RAD } else { PLACED_OFF_RAD };
        match (0..goal.len()).find(|&i| difference_rad(self.kind(i), here[i], goal[i]) > most_rad(i)) {
            Some(joint) => Err(joint_elsewhere(joint, self.kind(joint), here[joint], goal[joint])),
            None => Ok(()),
        }
    }

    /// Moves the tip to `goal` within `limits` (x, y, z, angle), waits until the arm is at rest, and compares.
    ///
    /// An arm whose kinematics is known goes along a straight line as far as it can; towards a goal out of reach it ends as
    /// near as it gets. Any other is moved by the inverse kinematics of the server.
    ///
    /// # Errors
    /// As [`Arm::move_to_joints`]; [`LinkError::Unreached`] when the tip is elsewhere, [`LinkError::NotSettled`] when it
    /// does not come to rest; where the server moves it, [`LinkError::NoSuchObject`] in a scene without a target dummy.
    pub fn move_to_pose(
        &mut self,
        goal: &Pose<Base, Tip>,
        limits: &MotionLimits,
        tolerance: &MotionTolerance,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        const TASK: &str = "moving the tip";
        if !goal.is_finite() {
            let value = f64::NAN;
            return Err(LinkError::BadMotion { what: "the goal", expected: "a finite pose", value });
        }
        limits.validate(4)?;
        let start = self.ready(TASK, cancel)?;
        let kinematics = self.kinematics()?.ok();
        match &kinematics {
            Some(kinematics) => {
                let way = self.line_among(kinematics, &start, goal, limits)?;
                self.send_motion(way, start, TASK, cancel)?;
            }
            None => self.move_by_server(goal, limits, TASK, cancel)?,
        }
        self.settle(&SettleOptions::default(), cancel)?;
        let (distance_m, angle_rad) = self.base_from_tip()?.distance_to(goal);
        if distance_m <= tolerance.distance_m && angle_rad <= tolerance.angle_rad {
            return Ok(());
        }
        Err(LinkError::Unreached { distance_mm: distance_m * 1e3, angle_deg: angle_rad.to_degrees() })
    }

    /// The limits of a motion of the joints, no faster than the surroundings allow, where nothing is in its way.
    fn limits_to(
        &self,
        start: &JointValues,
        goal: &JointValues,
        limits: &MotionLimits,
    ) -> Result<MotionLimits, LinkError> {
        let Some(among) = &self.among else { return Ok(limits.clone()) };
        if let Some(contact) = among.contact(start, goal) {
            return Err(LinkError::InTheWay { contact });
        }
        let mut limits = limits.clone();
        // All joints go in phase, so the one that is slowest for its way holds up the others.
        let duration_s = (0..goal.len()).map(|i| (goal[i] - start[i]).abs() / limits.velocity[i]).fold(0.0, f64::max);
        if duration_s > 0.0 {
            let wanted_rad_s = travel(start, goal) / duration_s;
            let share = among.arm.joint_speed(start, goal, &among.around, wanted_rad_s) / wanted_rad_s;
            for velocity in &mut limits.velocity {
                *velocity *= share;
            }
        }
        Ok(limits)
    }

    /// A motion of the tip along a line within the limits of the surroundings, where nothing is in its way. All of it is
    /// checked as it will be sent, also where it leads out of reach and leaves its line.
    fn line_among<'k>(
        &self,
        kinematics: &'k ArmKinematics,
        start: &JointValues,
        goal: &Pose<Base, Tip>,
        limits: &MotionLimits,
    ) -> Result<Way<'k>, LinkError> {
        let Some(among) = &self.among else {
            return Way::line(kinematics, start, goal, limits, LINE_JOINT_SPEED_RAD_S);
        };
        let mut limits = limits.clone();
        for velocity in limits.velocity.iter_mut().take(3) {
            // Along all three axes at once the tip is no faster than allowed.
            *velocity = among.around.limits.tip(*velocity * SPACE_DIAGONAL) / SPACE_DIAGONAL;
        }
        let joint_speed_rad_s = among.around.limits.joint(LINE_JOINT_SPEED_RAD_S);
        let way = Way::line(kinematics, start, goal, &limits, joint_speed_rad_s)?;
        let guard = among.guard(start);
        let (mut tried, mut before) = (way.clone(), *start);
        for _ in 0..MOST_PASSES {
            let next = tried.next(self.info.time_step_s);
            let contact = guard.contact(&next).or_else(|| guard.contact_on_path(&before, &next));
            if let Some(contact) = contact {
                return Err(LinkError::InTheWay { contact });
            }
            before = next;
            if tried.is_over() {
                break;
            }
        }
        Ok(way)
    }

    /// Where the joints are, ready to be moved.
    fn ready(&mut self, task: &'static str, cancel: &CancelToken) -> Result<JointValues, LinkError> {
        require_running(&mut self.sim, task)?;
        if cancel.is_cancelled() {
            return Err(LinkError::Cancelled { call: task.to_owned() });
        }
        self.movable_joints()
    }

    /// Returns which joints are moved by their controllers.
    fn send_motion(
        &mut self,
        way: Way<'_>,
        start: JointValues,
        task: &'static str,
        cancel: &CancelToken,
    ) -> Result<Vec<bool>, LinkError> {
        let mut stream = Stream::begin(self, start, task)?;
        let dynamic = stream.dynamic().to_vec();
        let outcome = self.send_points(way, &mut stream, task, cancel).map(|()| dynamic);
        stream.end(self, outcome)
    }

    fn send_points(
        &mut self,
        mut way: Way<'_>,
        stream: &mut Stream,
        task: &'static str,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        let dt_s = self.info.time_step_s;
        let started = Instant::now();
        let patient = CallOptions { grace: BRAKE_GRACE, ..CallOptions::cancelled_by(cancel) };
        let mut braking_since: Option<Instant> = None;
        let (mut sent, mut sent_at) = (*stream.sent(), started);
        loop {
            let call = if braking_since.is_some() { CallOptions::default() } else { patient.clone() };
            let pass = stream.pass_with(self, &call, |slot| {
                if sent_at.elapsed() > LONGEST_PAUSE && braking_since.is_none() {
                    way.begin_again(&sent);
                }
                sent_at = Instant::now();
                if (slot.is_stopped || cancel.is_cancelled()) && braking_since.is_none() {
                    way.brake();
                    braking_since = Some(Instant::now());
                }
                sent = way.next(dt_s);
                Point { joints: sent, target: None }
            })?;
            match pass {
                Pass::NotFollowing { joint, at } => {
                    // A simulation that is ended puts the joints back.
                    require_running(&mut self.sim, task)?;
                    return Err(joint_elsewhere(joint, self.kind(joint), at, sent[joint]));
                }
                Pass::None => require_running(&mut self.sim, task)?,
                Pass::Sent if !way.is_over() => {}
                Pass::Sent if stream.is_stopped() => return Err(LinkError::MotionStopped { task }),
                Pass::Sent if braking_since.is_some() => return Err(LinkError::Cancelled { call: task.to_owned() }),
                Pass::Sent => return Ok(()),
            }
            let awaited = match braking_since {
                Some(since) if since.elapsed() > LONGEST_BRAKING => "the arm to brake",
                _ if started.elapsed() > LONGEST_MOTION => "the arm to arrive",
                _ => continue,
            };
            return Err(LinkError::WaitedTooLong { task, awaited: awaited.to_owned(), after: started.elapsed() });
        }
    }

    /// The goal, if it is one of this arm.
    fn check_range(&self, goal: &[f64]) -> Result<JointValues, LinkError> {
        let need = self.info.joints.len();
        let of_arm = JointValues::try_from(goal).ok().filter(|goal| goal.len() == need);
        let goal = of_arm.ok_or(LinkError::JointCount { got: goal.len(), need })?;
        for (index, (&value, joint)) in goal.iter().zip(&self.info.joints).enumerate() {
            if !value.is_finite() {
                let expected = "finite joint values";
                return Err(LinkError::BadMotion { what: "the goal", expected, value });
            }
            // A millionth over the end is rounding, and clamping it moves nothing.
            let inside = (joint.range.min - 1e-6..=joint.range.max + 1e-6).contains(&value);
            if !inside {
                let [goal, min, max] = [value, joint.range.min, joint.range.max].map(|v| joint.kind.quantity(v));
                return Err(LinkError::JointOutOfRange { joint: index + 1, goal, min, max });
            }
        }
        Ok(goal)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use handeye_arm::ArmKind;

    /// A tip whose line leads through the column of the arm strays, and a stop does not take it back to its line first.
    #[test]
    fn a_stop_of_a_tip_that_is_off_its_line_brakes_the_joints_at_once() {
        let kinematics =
            ArmKinematics::ur5(Isometry3::identity(), Isometry3::identity(), &ArmKind::Ur5Coppeliasim.ranges())
                .expect("ranges with room");
        let start = JointValues::from([0.0, 0.8, -1.2, 0.2, 1.5, 0.0]);
        let mut behind = start;
        behind[0] += 2.5;
        let (goal, limits) = (kinematics.tip(&behind), MotionLimits::uniform(4, 0.5, 2.0, 20.0));
        let mut way = Way::line(&kinematics, &start, &goal, &limits, LINE_JOINT_SPEED_RAD_S).expect("a profile");
        let is_astray = |way: &Way<'_>| matches!(way, Way::Line(line) if line.astray.is_some_and(|v| v[0].abs() > 0.5));
        let mut joints = start;
        for _ in 0..400 {
            joints = way.next(0.05);
            if is_astray(&way) {
                break;
            }
        }
        assert!(is_astray(&way), "the line leads past the column: {joints:?}");
        way.brake();
        let mut passes = 0;
        while !way.is_over() {
            joints = way.next(0.05);
            passes += 1;
            assert!(passes <= 10, "at pi / 2 rad/s it takes a third of a second to stop");
        }
        assert_eq!(way.next(0.05), joints, "and it stands");
    }
}
