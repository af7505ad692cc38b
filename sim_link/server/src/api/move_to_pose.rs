//! `sim.moveToPose` and its steps.

use ciborium::Value;
use nalgebra::Isometry3;

use super::move_to_config::{keep, motion_cleanup, motion_step};
use super::{Call, Outcome, Table};
use crate::args::{ApiError, Fields};
use crate::cell::Cell;
use crate::plans::{
    Motion, MotionTask, Plan, entry, limits_in_state, limits_of, stated, sync_of, time_step_of, with_fields,
};
use crate::task::Answer;
use handeye_arm::{DlsOptions, JointRange};
use handeye_cell::world::{Chain, Flagged, Handle, poses};
use handeye_geometry::frames::Pose;
use handeye_motion::{MotionLimits, PoseMotion, PoseStep};
use handeye_wire::{self as wire, Reader};

pub(super) const FUNCTIONS: Table = &[
    ("moveToPose", move_to_pose),
    ("moveToPose_init", move_to_pose_init),
    ("moveToPose_step", motion_step),
    ("moveToPose_cleanup", motion_cleanup),
];

/// Notation of a pose for a callback of the positional form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Notation {
    Pose,
    Matrix,
}

#[derive(Debug, Clone)]
enum Form {
    Map,
    Positional { aux: Value, notation: Notation },
}

#[derive(Debug)]
enum Mover {
    /// Nothing: a callback does something with the pose.
    Nobody,
    /// An object, relative to another.
    Object { object: Flagged, relative_to: Handle },
    /// The arm, by inverse kinematics.
    Arm(ArmIk),
}

/// How the joints follow a target with the tip of the arm.
#[derive(Debug)]
struct ArmIk {
    tip: Handle,
    target: Handle,
    options: DlsOptions,
}

/// A move of a pose.
#[derive(Debug)]
struct PosePlan {
    given: Vec<(Value, Value)>,
    form: Form,
    mover: Mover,
    start: Isometry3<f64>,
    motion: PoseMotion,
    limits: Option<MotionLimits>,
    target_vel: Vec<f64>,
    latest: PoseStep,
    time_step_s: f64,
    over_s: f64,
    flags: i64,
}

impl Plan for PosePlan {
    fn advance(&mut self, dt_s: f64) -> Result<(), ApiError> {
        let left_s = self.latest.time_left;
        self.latest = self.motion.step(dt_s);
        if self.latest.finished {
            self.over_s = (dt_s - left_s).max(0.0);
        }
        Ok(())
    }

    fn apply(&mut self, cell: &mut Cell) -> Result<(), ApiError> {
        match &self.mover {
            Mover::Nobody => Ok(()),
            Mover::Object { object, relative_to } => {
                Ok(poses::set(&mut cell.world.tree, *object, *relative_to, &self.latest.pose)?)
            }
            Mover::Arm(ik) => ik.follow(cell, &self.latest.pose),
        }
    }

    fn is_finished(&self) -> bool {
        self.latest.finished
    }

    fn brake(&mut self) {
        let Some(limits) = &self.limits else { return };
        match self.motion.stop(limits) {
            Ok(stop) => self.motion = stop,
            Err(error) => tracing::error!(%error, "a motion could not be braked"),
        }
    }

    fn state(&self) -> Vec<(Value, Value)> {
        let pose = |pose: &Isometry3<f64>| wire::floats(poses::to_numbers(pose, false));
        let matrix = |pose: &Isometry3<f64>| wire::floats(poses::to_matrix(pose));
        let mut fields = vec![
            entry("pose", pose(&self.latest.pose)),
            entry("matrix", matrix(&self.latest.pose)),
            entry("startMatrix", matrix(&self.start)),
            entry("targetPose", pose(self.motion.goal())),
            entry("targetMatrix", matrix(self.motion.goal())),
            entry("vel", wire::floats(self.latest.vel.clone())),
            entry("accel", wire::floats(self.latest.accel.clone())),
            entry("targetVel", wire::floats(self.target_vel.clone())),
            entry("flags", Value::from(self.flags)),
            entry("timeStep", Value::Float(self.time_step_s)),
            entry("timeLeft", Value::Float(self.over_s)),
            entry("dist", Value::Float(self.motion.distance())),
            entry("angle", Value::Float(self.motion.angle_rad())),
        ];
        if let Mover::Object { object, relative_to } = &self.mover {
            fields.push(entry("object", Value::from(object.handle)));
            fields.push(entry("relObject", Value::from(*relative_to)));
        }
        fields.extend(limits_in_state(self.limits.as_ref()));
        with_fields(&self.given, fields)
    }

    fn callback_args(&self) -> Vec<Value> {
        match &self.form {
            Form::Map => vec![Value::Map(self.state())],
            Form::Positional { aux, notation } => {
                let pose = match notation {
                    Notation::Pose => wire::floats(poses::to_numbers(&self.latest.pose, false)),
                    Notation::Matrix => wire::floats(poses::to_matrix(&self.latest.pose)),
                };
                let (vel, accel) = (self.latest.vel.clone(), self.latest.accel.clone());
                vec![pose, wire::floats(vel), wire::floats(accel), aux.clone()]
            }
        }
    }

    fn result(&self) -> Vec<Value> {
        match &self.form {
            Form::Map => vec![Value::Map(self.state())],
            Form::Positional { .. } => {
                vec![wire::floats(poses::to_matrix(&self.latest.pose)), Value::Float(self.over_s)]
            }
        }
    }
}

impl ArmIk {
    /// Puts the target to a pose in the world, and the joints to where the tip meets it. If there is no such place
    /// nearby, the joints stay where they are and nothing is reported, as in the simulator.
    fn follow(&self, cell: &mut Cell, world_from_goal: &Isometry3<f64>) -> Result<(), ApiError> {
        cell.world.tree.set_world_pose(self.target, world_from_goal)?;
        let tree = &cell.world.tree;
        let chain = &cell.stage.chain;
        let mut seed = Vec::with_capacity(cell.stage.joints.len());
        let mut ranges = chain.ranges();
        for (&handle, range) in cell.stage.joints.iter().zip(&mut ranges) {
            let joint = tree.joint(handle)?;
            seed.push(joint.position_rad());
            // One that turns without end is wrapped when it is put there.
            if !joint.cyclic {
                let (min, max) = joint.interval_rad();
                *range = JointRange { min, max, ..*range };
            }
        }
        let goal = tree.world_pose(cell.stage.arm, Chain::Reported)?.inv_mul(world_from_goal);
        let world_from_connection = tree.world_pose(cell.stage.connection, Chain::Reported)?;
        let tip = world_from_connection.inv_mul(&tree.world_pose(self.tip, Chain::Reported)?);
        let (base_from_first, flange_from_tip) = (chain.base_from_first, chain.flange_from_tip * tip);
        let arm = chain.clone().mounted(base_from_first, flange_from_tip).with_ranges(&ranges);
        let found = arm.and_then(|arm| arm.descend(&Pose::from_isometry(goal), &seed, &self.options));
        let joints = found.map_err(|error| ApiError::Other(error.to_string()))?;
        for (&handle, position_rad) in cell.stage.joints.iter().zip(joints.unwrap_or_default()) {
            cell.world.tree.joint_mut(handle)?.command(position_rad)?;
        }
        Ok(())
    }
}

fn seven(fields: &Fields<'_>, name: &'static str) -> Result<Option<Isometry3<f64>>, ApiError> {
    let Some(numbers) = fields.numbers_of(name, 7)? else { return Ok(None) };
    let numbers: [f64; 7] = numbers.try_into().ok().ok_or(ApiError::Field { problem: "invalid", name })?;
    Ok(Some(poses::from_numbers(&numbers, false)?))
}

fn twelve(fields: &Fields<'_>, name: &'static str) -> Result<Option<Isometry3<f64>>, ApiError> {
    let Some(numbers) = fields.numbers_of(name, 12)? else { return Ok(None) };
    let numbers: [f64; 12] = numbers.try_into().ok().ok_or(ApiError::Field { problem: "invalid", name })?;
    Ok(Some(poses::from_matrix(&numbers)?))
}

/// The one of `pose`, `object` and `ik` that a call names, and the pose that it starts from.
fn mover(call: &mut Call<'_>, fields: &Fields<'_>) -> Result<(Mover, Isometry3<f64>), ApiError> {
    if let Some(ik) = fields.get("ik") {
        let ik = Fields::of(ik).ok_or(ApiError::Field { problem: "invalid", name: "ik" })?;
        let (arm, start) = arm_ik(call.cell, &ik)?;
        return Ok((Mover::Arm(arm), start));
    }
    if let Some(object) = fields.integer("object")? {
        let object = Flagged::parse(object);
        let relative_to = fields.integer("relObject")?.unwrap_or(poses::HANDLE_WORLD);
        let start = poses::get(&call.cell.world.tree, object, relative_to)?;
        return Ok((Mover::Object { object, relative_to }, start));
    }
    let start = match seven(fields, "pose")? {
        Some(pose) => Some(pose),
        None => twelve(fields, "matrix")?,
    };
    let start =
        start.ok_or_else(|| ApiError::Other("missing field: 'pose', 'object' or 'ik' is required.".to_owned()))?;
    Ok((Mover::Nobody, start))
}

fn arm_ik(cell: &mut Cell, ik: &Fields<'_>) -> Result<(ArmIk, Isometry3<f64>), ApiError> {
    const POSE_CONSTRAINTS: i64 = 31;
    let required = |name| ik.integer(name)?.ok_or(ApiError::Field { problem: "missing", name });
    let (tip, target) = (required("tip")?, required("target")?);
    let tree = &mut cell.world.tree;
    tree.get(target)?;
    tree.get(tip)?;
    let is_of_the_arm = |joints: &Vec<Handle>| joints.is_empty() || joints[..] == cell.stage.joints;
    if tree.ancestors(tip).all(|above| above != cell.stage.connection) {
        let text = "the built-in cell solves inverse kinematics for what hangs on the end of its arm: 'tip' does not.";
        return Err(ApiError::Other(text.to_owned()));
    }
    if ik.handles("joints")?.is_some_and(|joints| !is_of_the_arm(&joints)) {
        return Err(ApiError::Field { problem: "invalid", name: "joints" });
    }
    if ik.integer("constraints")?.unwrap_or(POSE_CONSTRAINTS) & POSE_CONSTRAINTS != POSE_CONSTRAINTS {
        let text = "the built-in cell solves inverse kinematics for whole poses: leave 'constraints' out.";
        return Err(ApiError::Other(text.to_owned()));
    }
    let mut options = DlsOptions::default();
    if let Some(damping) = ik.number("damping")?.filter(|d| d.is_finite() && *d > 0.0) {
        options.damping = damping;
    }
    if let Some(iterations) = ik.integer("iterations")? {
        options.iterations = usize::try_from(iterations).unwrap_or(0).clamp(1, 200);
    }
    if let Some(precision) = ik.numbers_of("precision", 2)? {
        (options.precision_m, options.precision_rad) = (precision[0], precision[1]);
    }
    if ik.get("allowError").and_then(Reader::boolean) == Some(true) {
        let text = "the built-in cell moves joints only where the tip reaches the target: leave 'allowError' out.";
        return Err(ApiError::Other(text.to_owned()));
    }
    let start = tree.world_pose(tip, Chain::Reported)?;
    tree.set_world_pose(target, &start)?;
    Ok((ArmIk { tip, target, options }, start))
}

struct Wanted {
    given: Vec<(Value, Value)>,
    form: Form,
    mover: Mover,
    start: Isometry3<f64>,
    goal: Isometry3<f64>,
    metric: Option<[f64; 4]>,
    target_vel: Vec<f64>,
    limits: Option<MotionLimits>,
    flags: Option<i64>,
}

impl Wanted {
    fn plan(self, time_step_s: Option<f64>) -> Result<PosePlan, ApiError> {
        let Self { given, form, mover, start, goal, metric, target_vel, limits, flags } = self;
        let sync = sync_of(flags);
        let motion = PoseMotion::with_target_velocity(&start, &goal, &target_vel, limits.as_ref(), metric, sync)?;
        let zeros = vec![0.0; target_vel.len()];
        let time_left = motion.duration_s();
        let latest = PoseStep { pose: start, vel: zeros.clone(), accel: zeros, finished: false, time_left };
        let (time_step_s, flags) = stated(time_step_s, flags, limits.is_some());
        Ok(PosePlan { given, form, mover, start, motion, limits, target_vel, latest, time_step_s, over_s: 0.0, flags })
    }
}

fn metric_of(numbers: Option<Vec<f64>>) -> Result<Option<[f64; 4]>, ApiError> {
    numbers
        .map(|metric| metric.try_into().ok().ok_or(ApiError::Field { problem: "invalid", name: "metric" }))
        .transpose()
}

fn from_map(call: &mut Call<'_>, fields: &Fields<'_>) -> Result<Motion, ApiError> {
    let goal = match seven(fields, "targetPose")? {
        Some(pose) => Some(pose),
        None => twelve(fields, "targetMatrix")?,
    };
    let goal = goal.ok_or(ApiError::Field { problem: "missing or invalid", name: "targetPose" })?;
    let metric = metric_of(fields.numbers("metric")?)?;
    let dofs = if metric.is_some() { 1 } else { 4 };
    let limits = limits_of(fields, dofs)?;
    let target_vel = fields.numbers_of("targetVel", dofs)?.unwrap_or_else(|| vec![0.0; dofs]);
    let flags = fields.integer("flags")?;
    let time_step_s = time_step_of(fields.number("timeStep")?)?;
    let (mover, start) = mover(call, fields)?;
    let given = fields.entries().to_vec();
    let wanted = Wanted { given, form: Form::Map, mover, start, goal, metric, target_vel, limits, flags };
    let plan = wanted.plan(time_step_s)?;
    Ok(Motion::new(Box::new(plan), fields.callback("callback"), time_step_s))
}

/// A pose or a matrix, distinguished by the number of numbers.
fn either(call: &Call<'_>, at: usize) -> Result<(Isometry3<f64>, Notation), ApiError> {
    if call.args.numbers(at)?.len() == 7 {
        Ok((poses::from_numbers(&call.args.array(at)?, false)?, Notation::Pose))
    } else {
        Ok((poses::from_matrix(&call.args.array(at)?)?, Notation::Matrix))
    }
}

/// `(flags, pose, maxVel, maxAccel, maxJerk, targetPose, callback, auxData, metric, timeStep)`
fn from_positions(call: &Call<'_>) -> Result<Motion, ApiError> {
    let args = call.args;
    let flags = Some(args.integer(0)?);
    let (start, notation) = either(call, 1)?;
    let (goal, _) = either(call, 5)?;
    let name = args.callback(6).ok_or(ApiError::WrongType { number: 7, expected: "a function" })?;
    let (max_vel, max_accel, max_jerk) = (args.numbers(2)?, args.numbers(3)?, args.numbers(4)?);
    let metric = metric_of(args.optional_numbers(8)?)?;
    let time_step_s = time_step_of(args.get(9).map(|_| args.number(9)).transpose()?)?;
    let wanted = Wanted {
        given: Vec::new(),
        form: Form::Positional { aux: args.get(7).cloned().unwrap_or(Value::Null), notation },
        mover: Mover::Nobody,
        start,
        goal,
        metric,
        target_vel: vec![0.0; if metric.is_some() { 1 } else { 4 }],
        limits: Some(MotionLimits { max_vel, max_accel, max_jerk, min_vel: None, min_accel: None }),
        flags,
    };
    let plan = wanted.plan(time_step_s)?;
    Ok(Motion::new(Box::new(plan), Some(name), time_step_s))
}

fn move_to_pose(call: &mut Call<'_>) -> Outcome {
    let motion = if call.args.is_table(0) {
        let fields = call.args.map_or_empty(0)?;
        from_map(call, &fields)?
    } else {
        from_positions(call)?
    };
    Ok(Answer::Later(Box::new(MotionTask::new(motion, call.cell))))
}

fn move_to_pose_init(call: &mut Call<'_>) -> Outcome {
    let fields = call.args.map_or_empty(0)?;
    let motion = from_map(call, &fields)?;
    keep(call, motion)
}
