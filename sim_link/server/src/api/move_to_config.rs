//! `sim.moveToConfig` and its steps.

use ciborium::Value;

use super::{Call, Outcome, Table, nothing, several};
use crate::args::{ApiError, Args, Fields};
use crate::cell::Cell;
use crate::plans::{
    Motion, MotionTask, Plan, entry, limits_in_state, limits_of, stated, sync_of, time_step_of, with_fields,
};
use crate::task::Answer;
use handeye_cell::world::Handle;
use handeye_motion::{JointMotion, MotionLimits, MotionState, MotionStep, shortest_way};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[
    ("moveToConfig", move_to_config),
    ("moveToConfig_init", move_to_config_init),
    ("moveToConfig_step", motion_step),
    ("moveToConfig_cleanup", motion_cleanup),
];

/// Degrees of freedom that one motion may have.
const MAX_DOFS: usize = 64;

/// Form of the call: the map of 4.7, or positions.
#[derive(Debug, Clone)]
enum Form {
    Map,
    Positional { aux: Value },
}

/// A move of joints, or of numbers that a callback does something with.
#[derive(Debug)]
struct ConfigPlan {
    given: Vec<(Value, Value)>,
    form: Form,
    joints: Vec<Handle>,
    motion: JointMotion,
    limits: Option<MotionLimits>,
    latest: MotionStep,
    time_step_s: f64,
    flags: i64,
}

impl Plan for ConfigPlan {
    fn advance(&mut self, dt_s: f64) -> Result<(), ApiError> {
        self.latest = self.motion.step(dt_s);
        Ok(())
    }

    fn apply(&mut self, cell: &mut Cell) -> Result<(), ApiError> {
        for (&handle, &position_rad) in self.joints.iter().zip(&self.latest.pos) {
            cell.world.tree.joint_mut(handle)?.command(position_rad)?;
        }
        Ok(())
    }

    fn is_finished(&self) -> bool {
        self.latest.finished
    }

    fn brake(&mut self) {
        let Some(limits) = &self.limits else { return };
        // The state is one that the same limits have led to, so a way to rest exists; without it the motion goes on.
        match JointMotion::stop(self.latest.state(), limits) {
            Ok(stop) => self.motion = stop,
            Err(error) => tracing::error!(%error, "a motion could not be braked"),
        }
    }

    fn state(&self) -> Vec<(Value, Value)> {
        let MotionStep { pos, vel, accel, .. } = &self.latest;
        let over_s = if self.latest.finished { self.motion.time_s() - self.motion.duration_s() } else { 0.0 };
        let mut fields = vec![
            entry("pos", wire::floats(pos.clone())),
            entry("vel", wire::floats(vel.clone())),
            entry("accel", wire::floats(accel.clone())),
            entry("targetPos", wire::floats(self.motion.target_pos().iter().copied())),
            entry("flags", Value::from(self.flags)),
            entry("timeStep", Value::Float(self.time_step_s)),
            entry("timeLeft", Value::Float(over_s.max(0.0))),
        ];
        let is_given = |name: &str| self.given.iter().any(|(key, _)| key.as_text() == Some(name));
        if !is_given("targetVel") {
            fields.push(entry("targetVel", wire::floats(vec![0.0; pos.len()])));
        }
        fields.extend(limits_in_state(self.limits.as_ref()));
        with_fields(&self.given, fields)
    }

    fn callback_args(&self) -> Vec<Value> {
        let MotionStep { pos, vel, accel, .. } = self.latest.clone();
        match &self.form {
            Form::Map => vec![Value::Map(self.state())],
            Form::Positional { aux } => {
                vec![wire::floats(pos), wire::floats(vel), wire::floats(accel), aux.clone()]
            }
        }
    }

    fn result(&self) -> Vec<Value> {
        let MotionStep { pos, vel, accel, .. } = self.latest.clone();
        match &self.form {
            Form::Map => vec![Value::Map(self.state())],
            Form::Positional { .. } => {
                let over_s = (self.motion.time_s() - self.motion.duration_s()).max(0.0);
                vec![wire::floats(pos), wire::floats(vel), wire::floats(accel), Value::Float(over_s)]
            }
        }
    }
}

/// Numbers of a motion before it is planned.
struct Wanted {
    given: Vec<(Value, Value)>,
    form: Form,
    joints: Vec<Handle>,
    start: MotionState,
    target_pos: Vec<f64>,
    target_vel: Vec<f64>,
    cyclic: Vec<bool>,
    limits: Option<MotionLimits>,
    flags: Option<i64>,
}

impl Wanted {
    fn plan(self, time_step_s: Option<f64>) -> Result<ConfigPlan, ApiError> {
        if self.start.pos.len() > MAX_DOFS {
            return Err(ApiError::Other(format!("a motion has at most {MAX_DOFS} degrees of freedom.")));
        }
        let target_pos = shortest_way(&self.start.pos, &self.target_pos, &self.cyclic);
        let sync = sync_of(self.flags);
        let latest = MotionStep {
            pos: self.start.pos.clone(),
            vel: self.start.vel.clone(),
            accel: self.start.accel.clone(),
            finished: false,
            time_left: 0.0,
        };
        let motion = JointMotion::new(self.start, &target_pos, &self.target_vel, self.limits.as_ref(), sync)?;
        let (time_step_s, flags) = stated(time_step_s, self.flags, self.limits.is_some());
        let Self { given, form, joints, limits, .. } = self;
        Ok(ConfigPlan { given, form, joints, motion, limits, latest, time_step_s, flags })
    }
}

fn numbers_or_zeros(fields: &Fields<'_>, name: &'static str, count: usize) -> Result<Vec<f64>, ApiError> {
    Ok(fields.numbers_of(name, count)?.unwrap_or_else(|| vec![0.0; count]))
}

fn from_map(call: &Call<'_>, fields: &Fields<'_>) -> Result<Motion, ApiError> {
    let tree = &call.cell.world.tree;
    let joints = fields.handles("joints")?.unwrap_or_default();
    let target_pos = fields.numbers("targetPos").ok().flatten();
    let target_pos = target_pos.ok_or(ApiError::Field { problem: "missing or invalid", name: "targetPos" })?;
    let count = target_pos.len();
    for &joint in &joints {
        tree.joint(joint)?;
    }
    let pos = match fields.numbers_of("pos", count)? {
        Some(pos) => pos,
        None if joints.is_empty() => {
            return Err(ApiError::Other("missing field: either 'pos' or 'joints' is required.".to_owned()));
        }
        None => joints.iter().map(|&joint| Ok(tree.joint(joint)?.position_rad())).collect::<Result<_, ApiError>>()?,
    };
    if !joints.is_empty() && joints.len() != count {
        return Err(ApiError::Field { problem: "invalid", name: "joints" });
    }
    let vel = numbers_or_zeros(fields, "vel", count)?;
    let accel = numbers_or_zeros(fields, "accel", count)?;
    let wanted = Wanted {
        given: fields.entries().to_vec(),
        form: Form::Map,
        start: MotionState { pos, vel, accel },
        target_vel: numbers_or_zeros(fields, "targetVel", count)?,
        cyclic: cyclic(call, fields, &joints)?,
        limits: limits_of(fields, count)?,
        flags: fields.integer("flags")?,
        joints,
        target_pos,
    };
    let time_step_s = time_step_of(fields.number("timeStep")?)?;
    let plan = wanted.plan(time_step_s)?;
    Ok(Motion::new(Box::new(plan), fields.callback("callback"), time_step_s))
}

/// Which joints go the short way round: those that the call names, or those that turn without end.
fn cyclic(call: &Call<'_>, fields: &Fields<'_>, joints: &[Handle]) -> Result<Vec<bool>, ApiError> {
    let invalid = ApiError::Field { problem: "invalid", name: "cyclicJoints" };
    match fields.get("cyclicJoints") {
        Some(given) => booleans(given).ok_or(invalid),
        None => joints.iter().map(|&joint| Ok(call.cell.world.tree.joint(joint)?.cyclic)).collect(),
    }
}

fn booleans(value: &Value) -> Option<Vec<bool>> {
    use handeye_wire::Reader;
    value.list()?.iter().map(Reader::boolean).collect()
}

/// `(flags, pos, vel, accel, maxVel, maxAccel, maxJerk, targetPos, targetVel, callback, auxData, cyclic, timeStep)`
fn from_positions(call: &Call<'_>) -> Result<Motion, ApiError> {
    let args: &Args = call.args;
    let pos = args.numbers(1)?;
    let count = pos.len();
    let zeros = || vec![0.0; count];
    let name = args.callback(9).ok_or(ApiError::WrongType { number: 10, expected: "a function" })?;
    let (max_vel, max_accel, max_jerk) = (args.numbers(4)?, args.numbers(5)?, args.numbers(6)?);
    let cyclic = match args.get(11) {
        None => Vec::new(),
        Some(value) => booleans(value).ok_or(ApiError::WrongType { number: 12, expected: "a table" })?,
    };
    let wanted = Wanted {
        given: Vec::new(),
        form: Form::Positional { aux: args.get(10).cloned().unwrap_or(Value::Null) },
        joints: Vec::new(),
        start: MotionState {
            pos,
            vel: args.optional_numbers(2)?.unwrap_or_else(zeros),
            accel: args.optional_numbers(3)?.unwrap_or_else(zeros),
        },
        target_pos: args.numbers(7)?,
        target_vel: args.optional_numbers(8)?.unwrap_or_else(zeros),
        cyclic,
        limits: Some(MotionLimits { max_vel, max_accel, max_jerk, min_vel: None, min_accel: None }),
        flags: Some(args.integer(0)?),
    };
    let time_step_s = time_step_of(args.get(12).map(|_| args.number(12)).transpose()?)?;
    let plan = wanted.plan(time_step_s)?;
    Ok(Motion::new(Box::new(plan), Some(name), time_step_s))
}

fn move_to_config(call: &mut Call<'_>) -> Outcome {
    let motion =
        if call.args.is_table(0) { from_map(call, &call.args.map_or_empty(0)?)? } else { from_positions(call)? };
    Ok(Answer::Later(Box::new(MotionTask::new(motion, call.cell))))
}

fn move_to_config_init(call: &mut Call<'_>) -> Outcome {
    let motion = from_map(call, &call.args.map_or_empty(0)?)?;
    keep(call, motion)
}

/// Keeps a motion for its client and returns its state with the number that finds it again.
pub(super) fn keep(call: &mut Call<'_>, motion: Motion) -> Outcome {
    let state = motion.plan.state();
    let id = call.client.plans.keep(motion)?;
    super::one(with_id(state, id))
}

fn with_id(mut state: Vec<(Value, Value)>, id: i64) -> Value {
    state.push(entry("ruckigObj", Value::from(id)));
    Value::Map(state)
}

/// One step of a motion that the client runs: 0 under way, 1 done, 2 ended early.
pub(super) fn motion_step(call: &mut Call<'_>) -> Outcome {
    let state = call.args.map_or_empty(0)?;
    let (id, motion) = call.client.plans.of(&state)?;
    if !motion.plan.is_finished() {
        motion.advance(call.cell)?;
    }
    let result = match (motion.plan.is_finished(), motion.braking) {
        (false, _) => 0,
        (true, false) => 1,
        (true, true) => 2,
    };
    several([Value::from(result), with_id(motion.plan.state(), id)])
}

/// Forgets a motion that the client ran.
pub(super) fn motion_cleanup(call: &mut Call<'_>) -> Outcome {
    let state = call.args.map_or_empty(0)?;
    call.client.plans.drop_of(&state)?;
    nothing()
}
