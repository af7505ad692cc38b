//! Following a goal that moves: a caller gives, pass by pass, where the tip should be.
//!
//! Each point is computed here and sent for one pass of the simulation, as for a jog: the arm stops within a pass when
//! this client hangs, crashes, or loses its connection. A caller that takes longer than a pass makes the arm wait in
//! the passes between; it then still moves by the step of one pass, because several steps in one would be too fast, and
//! after a longer pause it starts again from rest.

use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Pose, Tip};

use super::follow_goal::{FollowEnd, FollowGoal, FollowLimits, positive};
use super::follow_plan::FollowPlan;
use super::reach::ArmKinematics;
use super::stream::{Pass, Point, Stream};
use super::{Arm, require_running};
use crate::error::LinkError;
use crate::options::CallOptions;
use crate::sim::ObjectHandle;

/// Name of the task, in messages.
const TASK: &str = "following";

/// An arm that got no point for longer \[passes\] has visibly come to rest, and starts from there. A network that misses a
/// pass now and then does not slow it down. Nor is a goal taken to move on by itself for longer.
const LONGEST_PAUSE_PASSES: f64 = 4.0;

/// What the caller wants in a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FollowRequest {
    /// Towards the goal and along with it.
    Towards(FollowGoal),
    /// Come to rest, and go on following when there is a goal again.
    Rest,
    /// Come to rest, and end.
    End,
}

/// The arm in a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowMoment {
    /// Simulated time \[s\] that the next point is for: one pass from now. A goal is meant for this time.
    pub sim_time_s: f64,
    /// The joints as they are sent \[rad, or m of a prismatic joint\].
    pub joints: JointValues,
    /// The tip by these joints.
    pub base_from_tip: Pose<Base, Tip>,
    /// Whether the arm does not move as its goal asks, because it would come too near to an obstacle.
    pub is_kept_off: bool,
}

impl Arm {
    /// Follows a goal from a standstill until `wish` ends it or something is in the way; the arm comes to rest within
    /// the limits in any case. The goal is shown by the target dummy, where there is one; in the end that is at the tip,
    /// where motions to a pose start it.
    ///
    /// `wish` is called once per pass, also while the arm comes to rest in the end, when its answer has no effect. The
    /// simulation is not held meanwhile; if a few passes go by, the goal is taken to move on at its velocity.
    ///
    /// # Errors
    /// [`LinkError::NotRunning`], also when the simulation is ended meanwhile; [`LinkError::BadMotion`] for limits that
    /// make no sense before anything moves, and for a goal that is not finite with the arm at rest. After any other
    /// [`LinkError`] the arm is at rest where it was last sent.
    pub fn follow(
        &mut self,
        kinematics: &ArmKinematics,
        limits: &FollowLimits,
        request: &mut dyn FnMut(&FollowMoment) -> FollowRequest,
    ) -> Result<FollowEnd, LinkError> {
        limits.validate()?;
        positive([("the time step of the simulation", self.info.time_step_s)])?;
        require_running(&mut self.sim, TASK)?;
        let start = self.movable_joints()?;
        if !kinematics.fits(&start, &self.base_from_tip()?) {
            return Ok(FollowEnd::OtherTip);
        }
        let among = self.among.clone();
        let limits = among.as_ref().map_or(*limits, |among| limits.within(&among.around.limits));
        let guard = among.as_deref().map(|among| among.guard(&start));
        match FollowPlan::new(kinematics, &limits, guard, start, self.info.time_step_s) {
            Ok(plan) => {
                let mut stream = Stream::begin(self, start, TASK)?;
                let outcome = self.send_follow(plan, &mut stream, request);
                let outcome = outcome.and_then(|end| self.put_target_to_tip().map(|()| end));
                stream.end(self, outcome)
            }
            Err(end) => Ok(end),
        }
    }

    fn send_follow(
        &mut self,
        mut plan: FollowPlan<'_>,
        stream: &mut Stream,
        request: &mut dyn FnMut(&FollowMoment) -> FollowRequest,
    ) -> Result<FollowEnd, LinkError> {
        let dt_s = self.info.time_step_s;
        let longest_pause_s = LONGEST_PAUSE_PASSES * dt_s;
        let mut ending = None;
        loop {
            let now_s = self.sim.get_simulation_time()?;
            if stream.has_sent_at(self, now_s)? {
                self.sim.step(&CallOptions::default())?;
                require_running(&mut self.sim, TASK)?;
                continue;
            }
            let sim_time_s = now_s + dt_s;
            let base_from_tip = plan.base_from_tip();
            let goal = match request(&FollowMoment {
                sim_time_s,
                joints: *plan.joints(),
                base_from_tip,
                is_kept_off: plan.is_kept_off(),
            }) {
                _ if ending.is_some() => None,
                FollowRequest::Towards(goal) if goal.is_finite() => Some(goal),
                FollowRequest::Towards(_) => {
                    let (expected, value) = ("a finite pose with finite velocities", f64::NAN);
                    ending = Some(Err(LinkError::BadMotion { what: "the goal", expected, value }));
                    None
                }
                FollowRequest::Rest => None,
                FollowRequest::End => {
                    ending = Some(Ok(FollowEnd::Released));
                    None
                }
            };
            let pass = stream.pass(self, |slot| {
                if slot.since_last_s.is_some_and(|s| !(0.0..=longest_pause_s).contains(&s)) {
                    plan.stand();
                }
                let late_s = (slot.now_s + dt_s - sim_time_s).clamp(0.0, longest_pause_s);
                let goal = goal.filter(|_| !slot.is_stopped).map(|goal| goal.after(late_s));
                let joints = plan.advance(goal.as_ref());
                Point { joints, target: goal.map(|goal| goal.base_from_tip) }
            })?;
            match pass {
                Pass::NotFollowing { joint, .. } => {
                    require_running(&mut self.sim, TASK)?;
                    return Ok(FollowEnd::NotFollowing { joint: joint + 1 });
                }
                Pass::None => require_running(&mut self.sim, TASK)?,
                Pass::Sent if stream.is_stopped() => ending = Some(Ok(FollowEnd::Stopped)),
                Pass::Sent => ending = ending.or(plan.obstacle().map(Ok)),
            }
            if plan.is_at_rest()
                && let Some(end) = ending.take()
            {
                return end;
            }
        }
    }

    /// Where a motion to a pose has it in the beginning.
    fn put_target_to_tip(&mut self) -> Result<(), LinkError> {
        let Some(dummy) = self.objects.target else { return Ok(()) };
        let base_from_tip = self.base_from_tip()?;
        self.sim.set_object_pose(dummy, ObjectHandle::WORLD, &base_from_tip)
    }
}

#[cfg(test)]
#[path = "follow_tests.rs"]
mod tests;
