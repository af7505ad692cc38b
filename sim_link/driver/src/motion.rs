//! Motions of one driver: allowed, begun, and ended.

use handeye_arm::JointValues;
use handeye_estimate::placement::{DISTANCE_LIMIT_M, ROTATION_LIMIT_RAD};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;

use super::client::Driver;
use super::error::{DriverError, Ending};
use super::message::{Ability, PoseMessage, ToDriver};
use super::rest::{Moved, Place, RestWatch};
use super::shared::{Inner, Progress};

/// Where the arm is to go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// To a value for each joint, rad or m.
    Joints(JointValues),
    /// To a pose of the tip.
    Tip(Pose<Base, Tip>),
}

/// How a motion ended.
#[derive(Debug, Clone, PartialEq)]
pub enum MoveEnd {
    /// It is there.
    Arrived,
    /// The driver reports that it is there, but its states show that it moves, or is elsewhere: from where it was, or should be, to
    /// where it is.
    NotThere(Moved),
    /// The driver reports that it is there, and sends no states that would show it.
    Unseen,
    /// It was stopped on its way, and why.
    Stopped(String),
    /// It was not begun, and why.
    Refused(String),
}

impl Driver {
    /// Allows the driver to move the arm, or forbids it. A new connection begins read-only.
    ///
    /// # Errors
    /// [`DriverError::Refused`], [`DriverError::NoAnswer`], [`DriverError::Gone`], [`DriverError::Cannot`].
    pub fn arm(&self, on: bool) -> Result<(), DriverError> {
        if !self.hello().can_move() {
            self.require(Ability::MoveJoints)?;
        }
        let shared = self.shared();
        if !on {
            shared.lock().is_armed = false;
        }
        let id = shared.request(|id| {
            shared.lock().arming = on.then_some(id);
            ToDriver::Arm { id, on }
        })?;
        let what = if on { "`arm` with on" } else { "`arm` with off" };
        match shared.wait(shared.options.answer, None, |inner| inner.finished(id))? {
            Some(Progress::Refused(why)) => {
                Err(DriverError::Refused { driver: self.name().to_owned(), what: "to be armed", why })
            }
            Some(_) => Ok(()),
            None if on => {
                let mut inner = shared.lock();
                inner.abandon(id);
                inner.arming = None;
                drop(inner);
                Err(self.no_answer(what, shared.options.answer))
            }
            // A driver that may still move must not stay connected.
            None => Err(self.end(Ending::DoesNotStop)),
        }
    }

    /// Whether it may move the arm.
    pub fn is_armed(&self) -> bool {
        self.shared().lock().is_armed
    }

    /// Moves the arm at a share of its highest speed, over 0 and up to 1, and returns when it is at rest: at the goal, or
    /// where `cancel` or a stop brought it to rest.
    ///
    /// # Errors
    /// [`DriverError::NotArmed`], [`DriverError::Busy`], [`DriverError::Cannot`]: nothing was sent.
    /// [`DriverError::NoAnswer`], [`DriverError::Gone`].
    pub fn move_to(&self, goal: &Goal, speed: f64, cancel: &CancelToken) -> Result<MoveEnd, DriverError> {
        self.require(match goal {
            Goal::Joints(_) => Ability::MoveJoints,
            Goal::Tip(_) => Ability::MoveTip,
        })?;
        let shared = self.shared();
        self.check()?;
        {
            let mut inner = shared.lock();
            if !inner.is_armed {
                let why = inner.disarmed.clone();
                return Err(DriverError::NotArmed { driver: self.name().to_owned(), why });
            }
            if inner.is_moving {
                return Err(DriverError::Busy { driver: self.name().to_owned() });
            }
            inner.is_moving = true;
        }
        let ended = self.moved(goal, speed, cancel);
        shared.lock().is_moving = false;
        ended
    }

    fn moved(&self, goal: &Goal, speed: f64, cancel: &CancelToken) -> Result<MoveEnd, DriverError> {
        let shared = self.shared();
        let speed = speed.clamp(0.001, 1.0);
        let id = shared.request(|id| move_message(id, goal, speed))?;
        let begun = |inner: &mut Inner| (inner.requests.get(&id) != Some(&Progress::Sent)).then_some(());
        if shared.wait(shared.options.answer, None, begun)?.is_none() {
            // It may begin yet.
            self.stop()?;
            shared.lock().abandon(id);
            return Err(self.no_answer("`move` with accepted or refused", shared.options.answer));
        }
        let ended = shared.wait(shared.options.motion, Some(cancel), |inner| inner.finished(id))?;
        let ended = if let Some(ended) = ended {
            ended
        } else {
            self.stop()?;
            let ended = shared.wait(shared.options.answer, None, |inner| inner.finished(id))?;
            ended.ok_or_else(|| self.end(Ending::DoesNotStop))?
        };
        Ok(match ended {
            Progress::Refused(why) => MoveEnd::Refused(why),
            Progress::Stopped(why) => MoveEnd::Stopped(why),
            _ => self.seen_at(goal)?,
        })
    }

    /// What the states show about a motion that is done.
    fn seen_at(&self, goal: &Goal) -> Result<MoveEnd, DriverError> {
        let shared = self.shared();
        let (mut watch, mut last_s) = (RestWatch::default(), None);
        let stood = shared.wait(shared.options.answer, None, |inner| {
            let reading = inner.states.newest().filter(|reading| last_s != Some(reading.stamp_s))?;
            last_s = Some(reading.stamp_s);
            watch.take(reading.place()).then_some(())
        })?;
        let Some(newest) = watch.newest().filter(|_| watch.is_still().is_some()) else { return Ok(MoveEnd::Unseen) };
        if stood.is_none() {
            return Ok(watch.moved().map_or(MoveEnd::Unseen, MoveEnd::NotThere));
        }
        Ok(elsewhere(goal, newest).map_or(MoveEnd::Arrived, MoveEnd::NotThere))
    }

    /// Brings the arm to rest and waits until it is. A driver that does not answer in time loses its connection, which it
    /// must take as a stop too.
    ///
    /// # Errors
    /// [`DriverError::Gone`]; the arm may then still move.
    pub fn stop(&self) -> Result<(), DriverError> {
        if !self.hello().can_move() {
            return Ok(());
        }
        let shared = self.shared();
        let id = shared.request(|id| ToDriver::Stop { id })?;
        match shared.wait(shared.options.answer, None, |inner| inner.finished(id))? {
            Some(Progress::Refused(_)) | None => Err(self.end(Ending::DoesNotStop)),
            Some(_) => Ok(()),
        }
    }
}

/// From the goal to where the arm is, where that is another place.
fn elsewhere(goal: &Goal, place: &Place) -> Option<Moved> {
    match (goal, &place.joints) {
        (Goal::Joints(goal), Some(joints)) if goal.len() == joints.len() => {
            let index =
                (0..goal.len()).max_by(|&i, &j| (goal[i] - joints[i]).abs().total_cmp(&(goal[j] - joints[j]).abs()))?;
            let off = (goal[index] - joints[index]).abs();
            (off > ROTATION_LIMIT_RAD).then_some(Moved::Joint { index, from: goal[index], to: joints[index] })
        }
        (Goal::Joints(_), _) => None,
        (Goal::Tip(goal), _) => {
            let (distance_m, angle_rad) = goal.distance_to(&place.base_from_tip);
            let is_near = distance_m <= DISTANCE_LIMIT_M && angle_rad <= ROTATION_LIMIT_RAD;
            (!is_near).then_some(Moved::Tip { distance_m, angle_rad })
        }
    }
}

/// The request for a motion.
pub(super) fn move_message(id: u64, goal: &Goal, speed: f64) -> ToDriver {
    let (joints_rad, base_from_tip) = match goal {
        Goal::Joints(joints) => (Some(*joints), None),
        Goal::Tip(pose) => (None, Some(PoseMessage::of(pose))),
    };
    ToDriver::Move { id, joints_rad, base_from_tip, speed }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "motion_tests.rs"]
mod tests;
