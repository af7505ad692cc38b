//! The check that moves the arm, by little.

use std::time::{Duration, Instant};

use handeye_arm::JointKind;
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::super::error::DriverError;
use super::super::limits;
use super::super::message::Ability;
use super::super::motion::{Goal, MoveEnd, move_message};
use super::super::shared::{Inner, Progress};
use super::super::states::Reading;
use super::{Checked, Found, Run, Wrong, wrong};

/// How far a joint is moved \[rad, or m for a prismatic joint\].
const TURN_RAD: f64 = 0.2;
const SHIFT_M: f64 = 0.02;
/// Share of the highest speed: slow enough that a motion can be ended on its way.
const SPEED: f64 = 0.05;
/// Speed of a motion that has to last longer than the silence that ends it.
const SLOW: f64 = 0.02;
/// How long a motion runs before it is ended.
const UNDER_WAY: Duration = Duration::from_millis(150);
/// A driver that receives nothing for this long brakes; a motion that was over before shows nothing.
const SILENCE: Duration = Duration::from_secs(1);
/// The same with the time for braking.
const QUIET: Duration = Duration::from_millis(2500);
/// How far an arm at rest may creep in a tenth of a second.
const AT_REST: f64 = 1e-3;

/// What ends a motion, at which speed, and within which time.
type Brake = (&'static str, f64, Option<Duration>, fn(&Run) -> Result<(), DriverError>);

const STOP: &str = "`stop`";
const BRAKES: [Brake; 3] = [
    (STOP, SPEED, None, |run| run.driver.stop()),
    ("`arm` with on false", SPEED, None, |run| run.driver.arm(false)),
    ("a second of silence", SLOW, Some(QUIET), |run| {
        run.driver.shared().update(|inner| inner.trial.is_quiet = true);
        Ok(())
    }),
];

impl Run {
    pub(super) fn motion(&self) -> Checked {
        if !self.options.allow_motion {
            return Ok(Found::Skipped("not allowed: --allow-motion has it move by up to 0.2 rad or 2 cm"));
        }
        let start = self.here()?;
        self.driver.arm(true)?;
        let away = self.goal_away(&start);
        self.reaches(&away)?;
        let mut ended_early = Vec::new();
        for brake in &BRAKES {
            // There and back by turns: from wherever the last one was ended.
            let is_away = far(&self.here()?, &away) <= 0.5 * far(&start, &away);
            let goal = if is_away { &self.goal_here(&start) } else { &away };
            if !self.is_ended_by(goal, brake)? {
                ended_early.push(brake.0);
            }
            self.driver.arm(true)?;
        }
        self.reaches(&self.goal_here(&start))?;
        self.driver.arm(false)?;
        if ended_early.is_empty() {
            let text = "reaches its goals, and is ended by `stop`, `arm` with on false, and a second of silence";
            return Ok(Found::Passed(text.into()));
        }
        let early = ended_early.join(", ");
        Ok(Found::Warning(format!("{early}: not tried, the arm was there before it could be ended")))
    }

    fn here(&self) -> Result<Reading, Wrong> {
        Ok(self.driver.first_state(self.options.driver.answer, &self.cancel)?.reading)
    }

    /// The present place as a goal, joints or tip, whichever the driver can move to.
    pub(super) fn goal_here(&self, reading: &Reading) -> Goal {
        match &reading.joints {
            Some(joints) if self.can(Ability::MoveJoints) => Goal::Joints(*joints),
            _ => Goal::Tip(reading.base_from_tip),
        }
    }

    fn goal_away(&self, start: &Reading) -> Goal {
        match self.goal_here(start) {
            Goal::Joints(mut joints) => {
                let last = joints.len().saturating_sub(1);
                let hello = &self.driver.hello().joints[last];
                let step = if hello.kind == JointKind::Prismatic { SHIFT_M } else { TURN_RAD };
                let has_room = hello.max.is_none_or(|max| joints[last] + step < max);
                joints[last] += if has_room { step } else { -step };
                Goal::Joints(joints)
            }
            Goal::Tip(pose) => {
                let up = Isometry3::from_parts(Vector3::new(0.0, 0.0, SHIFT_M).into(), UnitQuaternion::identity());
                Goal::Tip(Pose::<Base, Tip>::from_isometry(up * pose.isometry()))
            }
        }
    }

    fn reaches(&self, goal: &Goal) -> Result<(), Wrong> {
        match self.driver.move_to(goal, SPEED, &self.cancel)? {
            // The states are checked below.
            MoveEnd::Arrived | MoveEnd::NotThere(_) | MoveEnd::Unseen => {}
            MoveEnd::Stopped(why) => return wrong(format!("a motion was stopped that nobody ended: {why}")),
            MoveEnd::Refused(why) => return wrong(format!("a motion of 0.2 rad or 2 cm was refused: {why}")),
        }
        // The state that shows it may be late.
        self.wait(Duration::from_millis(200))?;
        let here = self.here()?;
        let [off_rad, off_m] = self.off(&here, goal);
        if off_rad > limits::GOAL_RAD || off_m > limits::GOAL_M {
            return wrong(format!(
                "`done` after `move`, and the newest state is {:.1} mrad and {:.1} mm from the goal: {} mrad and {} mm at the most",
                off_rad * 1e3,
                off_m * 1e3,
                limits::GOAL_RAD * 1e3,
                limits::GOAL_M * 1e3
            ));
        }
        if here.moving == Some(true) {
            return wrong("`done` after `move`, and the newest state has `moving` true");
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

    /// Begins a motion, ends it, and looks whether the arm is at rest. False when it was there before.
    fn is_ended_by(&self, goal: &Goal, &(what, speed, within, end): &Brake) -> Result<bool, Wrong> {
        let (shared, answer) = (self.driver.shared(), self.options.driver.answer);
        let id = shared.request(|id| move_message(id, goal, speed))?;
        let begun = |inner: &mut Inner| (inner.requests.get(&id) != Some(&Progress::Sent)).then_some(());
        if shared.wait(answer, Some(&self.cancel), begun)?.is_none() {
            return wrong("`move` is answered with neither `accepted` nor `refused`");
        }
        self.wait(UNDER_WAY)?;
        match shared.update(|inner| inner.finished(id)) {
            None => {}
            Some(Progress::Refused(why)) => return wrong(format!("a small motion was refused: {why}")),
            Some(_) => return Ok(false),
        }
        if what == STOP && !self.refuses_another(id, goal)? {
            return Ok(false);
        }
        end(self)?;
        let since = Instant::now();
        let ended = shared.wait(within.unwrap_or(answer), Some(&self.cancel), |inner| inner.finished(id))?;
        let is_early = within.is_none() || since.elapsed() < SILENCE;
        shared.update(|inner| inner.trial.is_quiet = false);
        match ended {
            None => {
                let _gone_too = self.driver.stop().is_err();
                return wrong(format!("{what} does not end a motion: it must be answered with `stopped`"));
            }
            Some(Progress::Done) if is_early => return Ok(false),
            Some(Progress::Done) => {
                return wrong(format!("{what} does not end a motion: the arm went on to its goal"));
            }
            Some(_) => {}
        }
        let first = self.here()?;
        self.wait(Duration::from_millis(100))?;
        let crept = far(&self.here()?, &self.goal_here(&first));
        if crept > AT_REST {
            return wrong(format!(
                "{what} was answered, and the arm moves on: by {crept:.4} rad or m in a tenth of a second"
            ));
        }
        Ok(true)
    }

    /// Asks for a second motion, which must be refused. False when the first was over before.
    fn refuses_another(&self, first: u64, goal: &Goal) -> Result<bool, Wrong> {
        let shared = self.driver.shared();
        let second = shared.request(|id| move_message(id, goal, SPEED))?;
        let answer = shared.wait(self.options.driver.answer, Some(&self.cancel), |inner| inner.finished(second))?;
        if shared.update(|inner| inner.finished(first).is_some()) {
            return Ok(false);
        }
        match answer {
            Some(Progress::Refused(_)) => Ok(true),
            _ => wrong("a second `move` while the arm moves is not refused"),
        }
    }
}

/// Distance of the arm from a goal, in the coordinate with the largest one.
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
