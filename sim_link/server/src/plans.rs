//! Motions of `moveToConfig` and `moveToPose`: one step at a time, run by the server or by the client itself.

use std::collections::BTreeMap;

use ciborium::Value;

use super::args::{ApiError, Fields};
use super::cell::Cell;
use super::task::{Next, Task, Wake};
use handeye_cell::world::State;
use handeye_motion::{MotionLimits, Sync};
use handeye_wire as wire;

/// Motions that a client may have prepared and not yet cleaned up.
const MAX_PLANS: usize = 64;

/// The resolution of time that the motion generator of the simulator has.
const TIME_GRAIN_S: f64 = 1e-4;

/// Longest time step that makes sense.
const MAX_TIME_STEP_S: f64 = 10.0;

/// A motion that is planned and advanced in steps.
pub trait Plan: std::fmt::Debug + Send {
    /// Computes the state one step later.
    ///
    /// # Errors
    /// The motion cannot go on.
    fn advance(&mut self, dt_s: f64) -> Result<(), ApiError>;

    /// Moves joints or objects to the state.
    ///
    /// # Errors
    /// The moved object no longer exists.
    fn apply(&mut self, cell: &mut Cell) -> Result<(), ApiError>;

    /// Whether the state is the last one.
    fn is_finished(&self) -> bool;

    /// Replaces the rest of the motion by coming to rest within its limits.
    fn brake(&mut self);

    /// The state as the API shows it.
    fn state(&self) -> Vec<(Value, Value)>;

    /// What a callback is called with.
    fn callback_args(&self) -> Vec<Value> {
        vec![Value::Map(self.state())]
    }

    /// What the call returns in the end.
    fn result(&self) -> Vec<Value> {
        vec![Value::Map(self.state())]
    }
}

/// A plan and how it is run.
#[derive(Debug)]
pub struct Motion {
    /// What moves.
    pub plan: Box<dyn Plan>,
    /// Function of the client that is called instead of moving anything.
    pub callback: Option<String>,
    /// Length of a step; the simulation's if absent.
    pub time_step_s: Option<f64>,
    /// The motion was requested to end early.
    pub braking: bool,
}

impl Motion {
    /// A motion that is not stopped.
    pub fn new(plan: Box<dyn Plan>, callback: Option<String>, time_step_s: Option<f64>) -> Self {
        Self { plan, callback, time_step_s, braking: false }
    }

    /// One step: the next state, and unless a callback does it, the move there.
    ///
    /// # Errors
    /// See [`Plan`].
    pub fn advance(&mut self, cell: &mut Cell) -> Result<(), ApiError> {
        let dt_s = self.time_step_s.unwrap_or_else(|| cell.world.simulation().time_step_s());
        self.plan.advance(dt_s)?;
        if self.callback.is_none() { self.plan.apply(cell) } else { Ok(()) }
    }

    /// Replaces the rest of the motion by coming to rest.
    pub fn brake(&mut self) {
        if !self.braking {
            self.plan.brake();
            self.braking = true;
        }
    }
}

/// `sim.moveToConfig` and `sim.moveToPose`: steps until the goal is reached.
#[derive(Debug)]
pub struct MotionTask {
    motion: Motion,
    /// Whether the simulation advanced when the motion began: then it ends with the simulation.
    simulated: bool,
}

impl MotionTask {
    /// A motion to be run by the server.
    pub fn new(motion: Motion, cell: &Cell) -> Self {
        Self { motion, simulated: cell.world.simulation().is_advancing() }
    }

    fn is_cut_off(&self, cell: &Cell) -> bool {
        self.simulated && cell.world.simulation().state() == State::Stopped
    }
}

impl Task for MotionTask {
    fn resume(&mut self, cell: &mut Cell, wake: Wake) -> Result<Next, ApiError> {
        match wake {
            // In Lua everything but nil and false is true.
            Wake::Executed(values) => {
                let aborted = !matches!(values.first(), None | Some(Value::Null | Value::Bool(false)));
                if aborted { Ok(Next::Return(self.motion.plan.result())) } else { Ok(Next::Pass) }
            }
            Wake::PassOver if self.motion.plan.is_finished() || self.is_cut_off(cell) => {
                Ok(Next::Return(self.motion.plan.result()))
            }
            Wake::Started | Wake::PassOver | Wake::TimeReached => {
                self.motion.advance(cell)?;
                match &self.motion.callback {
                    Some(name) => Ok(Next::Callback { name: name.clone(), args: self.motion.plan.callback_args() }),
                    None => Ok(Next::Pass),
                }
            }
        }
    }

    fn brake(&mut self, _cell: &Cell) {
        self.motion.brake();
    }

    fn is_moving(&self) -> bool {
        self.motion.callback.is_none()
    }
}

/// Motions that a client steps itself, by the number in their state map.
#[derive(Debug, Default)]
pub struct Plans {
    plans: BTreeMap<i64, Motion>,
    next: i64,
}

impl Plans {
    /// Keeps a motion.
    ///
    /// # Errors
    /// The client has too many.
    pub fn keep(&mut self, motion: Motion) -> Result<i64, ApiError> {
        if self.plans.len() >= MAX_PLANS {
            let text =
                format!("a client may prepare {MAX_PLANS} motions: call the _cleanup function of those that are done.");
            return Err(ApiError::Other(text));
        }
        self.next += 1;
        self.plans.insert(self.next, motion);
        Ok(self.next)
    }

    /// The motion that a state map belongs to.
    ///
    /// # Errors
    /// There is no such motion, or no longer.
    pub fn of(&mut self, state: &Fields<'_>) -> Result<(i64, &mut Motion), ApiError> {
        let id = Self::id(state)?;
        let motion = self.plans.get_mut(&id).ok_or(ApiError::Field { problem: "invalid", name: "ruckigObj" })?;
        Ok((id, motion))
    }

    /// Forgets the motion that a state map belongs to.
    ///
    /// # Errors
    /// The map is not a state map.
    pub fn drop_of(&mut self, state: &Fields<'_>) -> Result<(), ApiError> {
        self.plans.remove(&Self::id(state)?);
        Ok(())
    }

    /// Every motion.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Motion> {
        self.plans.values_mut()
    }

    fn id(state: &Fields<'_>) -> Result<i64, ApiError> {
        state.integer("ruckigObj")?.ok_or(ApiError::Field { problem: "missing", name: "ruckigObj" })
    }
}

/// The synchronisation of a `flags` value; absent and −1 mean the default.
pub fn sync_of(flags: Option<i64>) -> Sync {
    match flags.unwrap_or(-1) {
        flags if flags < 0 => Sync::Phase,
        flags => match flags & 0xff {
            1 => Sync::Time,
            3 => Sync::None,
            _ => Sync::Phase,
        },
    }
}

/// A time step that a client gives; zero and absent mean the simulation's.
///
/// # Errors
/// One that is not a multiple of 0.1 ms, or out of range.
pub fn time_step_of(given: Option<f64>) -> Result<Option<f64>, ApiError> {
    let Some(time_step_s) = given.filter(|&dt| dt != 0.0) else { return Ok(None) };
    let grains = time_step_s / TIME_GRAIN_S;
    if !(TIME_GRAIN_S..=MAX_TIME_STEP_S).contains(&time_step_s) || (grains - grains.round()).abs() > 1e-3 * grains {
        return Err(ApiError::Field { problem: "invalid", name: "timeStep" });
    }
    Ok(Some(time_step_s))
}

/// Time step and flags as a state map shows them: with limits the time step of the simulation is 0, and without any the
/// motion is over in a step of 10 s whatever was requested; minimum velocities and accelerations are always in use.
pub fn stated(time_step_s: Option<f64>, flags: Option<i64>, has_limits: bool) -> (f64, i64) {
    const NO_SYNC: i64 = 3;
    const MINIMA: i64 = 0x300;
    if !has_limits {
        return (10.0, NO_SYNC | MINIMA);
    }
    (time_step_s.unwrap_or(0.0), flags.filter(|&flags| flags >= 0).unwrap_or(0) | MINIMA)
}

/// Limits of a motion: all of `maxVel`, `maxAccel` and `maxJerk`, or none for a jump.
///
/// # Errors
/// Some but not all, or lists of the wrong length.
pub fn limits_of(fields: &Fields<'_>, dofs: usize) -> Result<Option<MotionLimits>, ApiError> {
    let max_vel = fields.numbers_of("maxVel", dofs)?;
    let max_accel = fields.numbers_of("maxAccel", dofs)?;
    let max_jerk = fields.numbers_of("maxJerk", dofs)?;
    let missing = |name| ApiError::Field { problem: "missing", name };
    let (max_vel, max_accel, max_jerk) = match (max_vel, max_accel, max_jerk) {
        (None, None, None) => return Ok(None),
        (Some(vel), Some(accel), Some(jerk)) => (vel, accel, jerk),
        (None, _, _) => return Err(missing("maxVel")),
        (_, None, _) => return Err(missing("maxAccel")),
        (_, _, None) => return Err(missing("maxJerk")),
    };
    let min_vel = fields.numbers_of("minVel", dofs)?;
    let min_accel = fields.numbers_of("minAccel", dofs)?;
    Ok(Some(MotionLimits { max_vel, max_accel, max_jerk, min_vel, min_accel }))
}

/// The limits as a state map shows them.
pub fn limits_in_state(limits: Option<&MotionLimits>) -> Vec<(Value, Value)> {
    let Some(limits) = limits else { return Vec::new() };
    let negated = |values: &Vec<f64>| values.iter().map(|v| -v).collect();
    let MotionLimits { max_vel, max_accel, max_jerk, min_vel, min_accel } = limits;
    vec![
        entry("maxVel", wire::floats(max_vel.clone())),
        entry("maxAccel", wire::floats(max_accel.clone())),
        entry("maxJerk", wire::floats(max_jerk.clone())),
        entry("minVel", wire::floats(min_vel.clone().unwrap_or_else(|| negated(max_vel)))),
        entry("minAccel", wire::floats(min_accel.clone().unwrap_or_else(|| negated(max_accel)))),
    ]
}

/// An entry of a state map.
pub fn entry(name: &str, value: Value) -> (Value, Value) {
    (Value::from(name), value)
}

/// Sets fields of a state map, leaving the others as the client gave them.
pub fn with_fields(given: &[(Value, Value)], mut fields: Vec<(Value, Value)>) -> Vec<(Value, Value)> {
    /// Names of functions and of what only the server needs.
    const HIDDEN: [&str; 3] = ["callback", "ruckigObj", "ik"];
    let is_set = |key: &Value| fields.iter().any(|(set, _)| set == key);
    let is_hidden = |key: &Value| HIDDEN.iter().any(|name| key.as_text() == Some(name));
    let kept: Vec<_> = given.iter().filter(|(key, _)| !is_set(key) && !is_hidden(key)).cloned().collect();
    fields.extend(kept);
    fields
}
