//! Sending the arm one point per pass of the simulation.
//!
//! A point is sent as `sim.moveToConfig` does it inside the server: a joint that is moved by forces gets a new target
//! position, any other is set to the position. So the arm stops within a pass when this client hangs, crashes, or loses
//! its connection.
//!
//! A client that is too slow for the simulation misses passes, and the arm is at rest in them. It still gets the next
//! point of its plan, the step of one pass: to catch up it would have to exceed its speed limits.

use std::time::Instant;

use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Pose, Tip};

use super::Arm;
use super::arm::clock_past;
use super::hold::Held;
use super::joints::{difference_rad, read_joint_values};
use super::sentinel::Sentinel;
use crate::error::LinkError;
use crate::options::CallOptions;
use crate::sim::ObjectHandle;

/// A joint that is where it is put may be off by rounding \[rad\].
pub(super) const PLACED_OFF_RAD: f64 = 1e-6;

/// A joint moved by forces lags behind: by a few degrees, as its controller is tuned. One that lags more is given time while it
/// comes nearer to where it was sent: no simulator reports how fast its controllers can be \[rad\].
const DRIVEN_OFF_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// The stream of points to an arm that no other client moves.
pub(super) struct Stream {
    sentinel: Sentinel,
    dynamic: Vec<bool>,
    sent: JointValues,
    /// Where the joints were in the previous pass.
    seen: JointValues,
    seen_s: Option<f64>,
    /// When simulated time went on for the last time.
    advanced: Instant,
    is_stopped: bool,
    task: &'static str,
}

/// The pass for which a point is wanted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot {
    /// Simulated time \[s\]; the point takes effect in the pass that begins now.
    pub now_s: f64,
    /// Since the point before \[s\], negative after a new start of the simulation; `None` for the first point.
    pub since_last_s: Option<f64>,
    /// A client had the cell stop everything.
    pub is_stopped: bool,
}

/// The point that is sent in a pass.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// Where the joints go.
    pub joints: JointValues,
    /// Where the target dummy goes, if anywhere.
    pub target: Option<Pose<Base, Tip>>,
}

/// Result of a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pass {
    /// None has gone by since the last point, or a slow joint is still on its way to it; nothing was sent.
    None,
    /// A point was sent, and the pass is over.
    Sent,
    /// A joint is not where it was sent; nothing was sent.
    NotFollowing {
        /// The joint, counted from 0.
        joint: usize,
        /// Its position.
        at: f64,
    },
}

impl Stream {
    /// For an arm at rest at `start`; `task` names the purpose, in messages.
    pub fn begin(arm: &mut Arm, start: JointValues, task: &'static str) -> Result<Self, LinkError> {
        let joints = &arm.objects.joints;
        let dynamic = joints.iter().map(|&joint| arm.sim.is_joint_dynamic(joint)).collect::<Result<_, _>>()?;
        let sentinel = Sentinel::begin(&mut arm.sim, &arm.info)?;
        let advanced = Instant::now();
        Ok(Self { sentinel, dynamic, sent: start, seen: start, seen_s: None, advanced, is_stopped: false, task })
    }

    /// Tidies up behind the last point, unless the connection is gone or this client a new one for the server.
    pub fn end<T>(self, arm: &mut Arm, outcome: Result<T, LinkError>) -> Result<T, LinkError> {
        match outcome {
            Err(error) if error.is_connection_loss() || matches!(error, LinkError::Held { .. }) => Err(error),
            outcome => self.sentinel.end(&mut arm.sim).and(outcome),
        }
    }

    /// Which joints are moved by their controllers.
    pub fn dynamic(&self) -> &[bool] {
        &self.dynamic
    }

    /// Where the joints were sent last.
    pub fn sent(&self) -> &JointValues {
        &self.sent
    }

    /// Whether a client had the cell stop everything since the stream began.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// Whether a point was sent at this simulated time already, so that the next pass has to be waited for.
    ///
    /// # Errors
    /// [`LinkError::WaitedTooLong`] when simulated time has not advanced for as long as a call may take.
    pub fn has_sent_at(&self, arm: &mut Arm, now_s: f64) -> Result<bool, LinkError> {
        if self.seen_s != Some(now_s) {
            return Ok(false);
        }
        let after = self.advanced.elapsed();
        if after > arm.sim.connection().total_timeout() {
            return Err(LinkError::WaitedTooLong { task: self.task, awaited: clock_past(now_s), after });
        }
        Ok(true)
    }

    /// Sends the next point, if a pass has gone by since the last one and the joints are where they were sent, and waits
    /// for the end of the pass. `next` is called while the simulation is held, so it must be quick.
    pub fn pass(&mut self, arm: &mut Arm, next: impl FnOnce(&Slot) -> Point) -> Result<Pass, LinkError> {
        self.pass_with(arm, &CallOptions::default(), next)
    }

    /// [`Self::pass`] with separate limits for the wait.
    pub fn pass_with(
        &mut self,
        arm: &mut Arm,
        wait: &CallOptions,
        next: impl FnOnce(&Slot) -> Point,
    ) -> Result<Pass, LinkError> {
        // All joints go to a point in the same pass, however slow the network.
        let held = Held::acquire(&mut arm.sim)?;
        let pass = self.sentinel.is_stopped(&mut arm.sim).and_then(|now| {
            self.is_stopped |= now;
            self.send(arm, next)
        });
        let pass = held.release(&mut arm.sim, pass)?;
        // A point takes effect in the pass that follows, also the last one.
        arm.sim.step(wait)?;
        Ok(pass)
    }

    fn send(&mut self, arm: &mut Arm, next: impl FnOnce(&Slot) -> Point) -> Result<Pass, LinkError> {
        let now_s = arm.sim.get_simulation_time()?;
        if self.has_sent_at(arm, now_s)? {
            return Ok(Pass::None);
        }
        let since_last_s = self.seen_s.map(|seen_s| now_s - seen_s);
        (self.seen_s, self.advanced) = (Some(now_s), Instant::now());
        let joints = read_joint_values(&mut arm.sim, &arm.objects)?;
        let tolerance = |joint: usize| if self.dynamic[joint] { DRIVEN_OFF_RAD } else { PLACED_OFF_RAD };
        let off_rad = |at: &JointValues, joint: usize| difference_rad(arm.kind(joint), at[joint], self.sent[joint]);
        let is_off = |&joint: &usize| off_rad(&joints, joint) > tolerance(joint);
        let comes_nearer = |joint: usize| self.dynamic[joint] && off_rad(&joints, joint) < off_rad(&self.seen, joint);
        let elsewhere = (0..joints.len()).filter(is_off).find(|&joint| !comes_nearer(joint));
        let is_behind = (0..joints.len()).any(|joint| is_off(&joint));
        self.seen = joints;
        if let Some(joint) = elsewhere {
            return Ok(Pass::NotFollowing { joint, at: joints[joint] });
        }
        if is_behind {
            return Ok(Pass::None);
        }
        let point = next(&Slot { now_s, since_last_s, is_stopped: self.is_stopped });
        for joint in (0..joints.len()).filter(|&i| point.joints[i] != self.sent[i]) {
            let (handle, position) = (arm.objects.joints[joint], point.joints[joint]);
            if self.dynamic[joint] {
                arm.sim.set_joint_target_position(handle, position)?;
            } else {
                arm.sim.set_joint_position(handle, position)?;
            }
        }
        self.sent = point.joints;
        if let (Some(dummy), Some(pose)) = (arm.objects.target, &point.target) {
            arm.sim.set_object_pose(dummy, ObjectHandle::WORLD, pose)?;
        }
        Ok(Pass::Sent)
    }
}
