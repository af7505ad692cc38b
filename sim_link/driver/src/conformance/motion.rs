//! Checks that move the arm, by little.

use std::time::{Duration, Instant};

use handeye_arm::{JointKind, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::super::limits;
use super::super::message::Ability;
use super::super::motion::{Goal, MoveEnd, move_message};
use super::super::shared::{Inner, Progress};
use super::super::states::Reading;
use super::{Check, Run, gone, passed, skipped, warning, wrong};

/// How far a joint is moved \[rad, m of a prismatic one\].
const TURN_RAD: f64 = 0.2;
const SHIFT_M: f64 = 0.02;
/// At which share of the highest speed: slow enough that a motion can be ended on its way.
const SPEED: f64 = 0.05;
/// That of a motion which is to last for longer than the silence that ends it.
const SLOW: f64 = 0.02;
/// How long a motion is left alone before it is ended.
const UNDER_WAY: Duration = Duration::from_millis(150);
/// A driver that hears nothing for so long brakes; a motion that was over before tells nothing.
const SILENCE: Duration = Duration::from_secs(1);
/// With what braking takes.
const QUIET: Duration = Duration::from_millis(2500);
/// How far an arm at rest may creep in a tenth of a second.
const AT_REST: f64 = 1e-3;

/// What ends a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Brake {
    Stop,
    Disarm,
    Quiet,
}

impl Run<'_> {
    pub(super) fn motion(&self) -> Result<Check, Check> {
        const NAME: &str = "motion";
        if !self.driver.hello().can_move() {
            return Ok(skipped(NAME, "it says of itself that it moves nothing"));
        }
        if !self.options.allow_motion {
            return Ok(skipped(NAME, "not allowed: --allow-motion has it move by up to 0.2 rad or 2 cm"));
        }
        let start = self.here(NAME)?;
        gone(NAME, self.driver.arm(true))?;
        let away = self.goal_away(&start);
        self.reaches(NAME, &away)?;
        let mut ended_early = Vec::new();
        for (brake, what) in
            [(Brake::Stop, "`stop`"), (Brake::Disarm, "`arm` with on false"), (Brake::Quiet, "a second of silence")]
        {
            // There and back by turns: from wherever the last one was ended.
            let here = self.here(NAME)?;
            let goal = if far(&here, &away) > 0.5 * far(&start, &away) { &away } else { &self.goal_here(&start) };
            if !self.is_ended_by(NAME, goal, brake, what)? {
                ended_early.push(what);
            }
            gone(NAME, self.driver.arm(true))?;
        }
        self.reaches(NAME, &self.goal_here(&start))?;
        gone(NAME, self.driver.arm(false))?;
        let text = "reaches its goals, and is ended by `stop`, `arm` with on false, and a second of silence";
        if ended_early.is_empty() {
            return Ok(passed(NAME, text));
        }
        let why = format!("{}: not tried, the arm was there before it could be ended", ended_early.join(", "));
        Ok(warning(NAME, why))
    }

    fn here(&self, name: &'static str) -> Result<Reading, Check> {
        let patience = self.options.driver.answer;
        Ok(gone(name, self.driver.first_state(patience, self.cancel))?.reading)
    }

    /// Where the arm stands, in the terms in which it is moved.
    pub(super) fn goal_here(&self, reading: &Reading) -> Goal {
        match &reading.joints {
            Some(joints) if self.can(Ability::MoveJoints) => Goal::Joints(*joints),
            _ => Goal::Tip(reading.base_from_tip),
        }
    }

    fn goal_away(&self, start: &Reading) -> Goal {
        match self.goal_here(start) {
            Goal::Joints(joints) => {
                let last = joints.len().saturating_sub(1);
                let hello = &self.driver.hello().joints[last];
                let step = if hello.kind == JointKind::Prismatic { SHIFT_M } else { TURN_RAD };
                let has_room = hello.max.is_none_or(|max| joints[last] + step < max);
                let to = joints[last] + if has_room { step } else { -step };
                Goal::Joints(JointValues::from_fn(joints.len(), |i| if i == last { to } else { joints[i] }))
            }
            Goal::Tip(pose) => {
                let up = Isometry3::from_parts(Vector3::new(0.0, 0.0, SHIFT_M).into(), UnitQuaternion::identity());
                Goal::Tip(Pose::<Base, Tip>::from_isometry(up * pose.isometry()))
            }
        }
    }

    fn reaches(&self, name: &'static str, goal: &Goal) -> Result<(), Check> {
        match gone(name, self.driver.move_to(goal, SPEED, self.cancel))? {
            // What the states say of it is looked at below.
            MoveEnd::Arrived | MoveEnd::NotThere(_) | MoveEnd::Unseen => {}
            MoveEnd::Stopped(why) => return Err(wrong(name, format!("a motion was stopped that nobody ended: {why}"))),
            MoveEnd::Refused(why) => {
                return Err(wrong(name, format!("a motion of 0.2 rad or 2 cm was refused: {why}")));
            }
        }
        // The state that says so may be a moment behind.
        self.wait(name, Duration::from_millis(200))?;
        let here = self.here(name)?;
        let [off_rad, off_m] = self.off(&here, goal);
        if off_rad > limits::GOAL_RAD || off_m > limits::GOAL_M {
            let why = format!(
                "`done` after `move`, and the newest state is {:.1} mrad and {:.1} mm from the goal: {} mrad and {} mm at the most",
                off_rad * 1e3,
                off_m * 1e3,
                limits::GOAL_RAD * 1e3,
                limits::GOAL_M * 1e3
            );
            return Err(wrong(name, why));
        }
        if here.moving == Some(true) {
            return Err(wrong(name, "`done` after `move`, and the newest state has `moving` true"));
        }
        Ok(())
    }

    /// How far the arm is from a goal \[rad, m\].
    fn off(&self, reading: &Reading, goal: &Goal) -> [f64; 2] {
        match (goal, &reading.joints) {
            (Goal::Joints(goal), Some(here)) => {
                let mut off = [0.0_f64; 2];
                for ((a, b), joint) in goal.iter().zip(here).zip(&self.driver.hello().joints) {
                    let kind = usize::from(joint.kind == JointKind::Prismatic);
                    off[kind] = off[kind].max((a - b).abs());
                }
                off
            }
            (Goal::Joints(_), None) => [0.0; 2],
            (Goal::Tip(goal), _) => {
                let (off_m, off_rad) = goal.distance_to(&reading.base_from_tip);
                [off_rad, off_m]
            }
        }
    }

    /// Begins a motion, ends it, and looks whether the arm stands. False when it was there before.
    fn is_ended_by(&self, name: &'static str, goal: &Goal, brake: Brake, what: &str) -> Result<bool, Check> {
        let (shared, patience) = (self.driver.shared(), self.options.driver.answer);
        let speed = if brake == Brake::Quiet { SLOW } else { SPEED };
        let id = gone(name, shared.request(|id| move_message(id, goal, speed)))?;
        let begun = |inner: &mut Inner| (inner.requests.get(&id) != Some(&Progress::Sent)).then_some(());
        if gone(name, shared.wait(patience, Some(self.cancel), begun))?.is_none() {
            return Err(wrong(name, "`move` is answered with neither `accepted` nor `refused`"));
        }
        self.wait(name, UNDER_WAY)?;
        let was_over = shared.update(|inner| inner.finished(id));
        match was_over {
            None => {}
            Some(Progress::Refused(why)) => return Err(wrong(name, format!("a small motion was refused: {why}"))),
            Some(_) => return Ok(false),
        }
        if brake == Brake::Stop {
            let second = gone(name, shared.request(|id| move_message(id, goal, SPEED)))?;
            let answered = gone(name, shared.wait(patience, Some(self.cancel), |inner| inner.finished(second)))?;
            let is_refused = matches!(answered, Some(Progress::Refused(_)));
            let is_over = shared.update(|inner| inner.finished(id).is_some());
            if !is_refused && !is_over {
                return Err(wrong(name, "a second `move` while the arm moves is not refused"));
            }
            if is_over {
                return Ok(false);
            }
        }
        let patience = match brake {
            Brake::Stop => {
                gone(name, self.driver.stop())?;
                patience
            }
            Brake::Disarm => {
                gone(name, self.driver.arm(false))?;
                patience
            }
            Brake::Quiet => {
                shared.update(|inner| inner.trial.is_quiet = true);
                QUIET
            }
        };
        let since = Instant::now();
        let ended = gone(name, shared.wait(patience, Some(self.cancel), |inner| inner.finished(id)))?;
        let is_early = brake != Brake::Quiet || since.elapsed() < SILENCE;
        shared.update(|inner| inner.trial.is_quiet = false);
        match ended {
            None => {
                let _gone_too = self.driver.stop().is_err();
                return Err(wrong(name, format!("{what} does not end a motion: it must be answered with `stopped`")));
            }
            Some(Progress::Done) if is_early => return Ok(false),
            Some(Progress::Done) => {
                return Err(wrong(name, format!("{what} does not end a motion: the arm went on to its goal")));
            }
            Some(_) => {}
        }
        let first = self.here(name)?;
        self.wait(name, Duration::from_millis(100))?;
        let crept = far(&self.here(name)?, &self.goal_here(&first));
        if crept > AT_REST {
            let why =
                format!("{what} was answered, and the arm moves on: by {crept:.4} rad or m in a tenth of a second");
            return Err(wrong(name, why));
        }
        Ok(true)
    }
}

/// How far the arm is from a goal, in the coordinate that is farthest.
fn far(reading: &Reading, goal: &Goal) -> f64 {
    match (goal, &reading.joints) {
        (Goal::Joints(goal), Some(here)) => goal.iter().zip(here).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
        (Goal::Joints(_), None) => 0.0,
        (Goal::Tip(goal), _) => {
            let (off_m, off_rad) = goal.distance_to(&reading.base_from_tip);
            off_m.max(off_rad)
        }
    }
}
