//! Moves of several degrees of freedom: time-optimal profiles with limited jerk.
//!
//! Reference: Berscheid, Kröger 2021, "Jerk-limited real-time trajectory generation with arbitrary target states".

use std::f64::consts::TAU;

use rsruckig::prelude::{
    ControlInterface, DataArrayOrVec, InputParameter, Ruckig, RuckigResult, Synchronization, ThrowErrorHandler,
    Trajectory,
};

use super::{MotionError, MotionLimits, MotionState, MotionStep, Sync};

/// A sample this close to the end counts as the end: fifty steps of 0.02 s are not exactly one second.
const END_SLACK_S: f64 = 1e-9;

/// A planned move of any number of degrees of freedom, and how far along it is.
#[derive(Debug, Clone)]
pub struct JointMotion {
    start: MotionState,
    target_pos: Vec<f64>,
    target_vel: Vec<f64>,
    /// Absent for a jump.
    trajectory: Option<Trajectory<0>>,
    duration_s: f64,
    time_s: f64,
}

/// What the planner works towards.
enum Goal<'a> {
    Position { pos: &'a [f64], vel: &'a [f64], sync: Sync },
    Rest,
}

impl JointMotion {
    /// Plans the fastest move within the limits from any state to `target_pos` with `target_vel` and no acceleration.
    ///
    /// Where the start itself is outside the limits, the motion first returns into them as fast as it may. Without
    /// limits the first step arrives.
    ///
    /// # Errors
    /// [`MotionError`]: lists of different length, numbers that are not finite, limits of zero, or a target velocity
    /// over the limit.
    pub fn new(
        start: MotionState,
        target_pos: &[f64],
        target_vel: &[f64],
        limits: Option<&MotionLimits>,
        sync: Sync,
    ) -> Result<Self, MotionError> {
        let dofs = start.pos.len();
        check_state(&start)?;
        check_finite("target position", target_pos, dofs)?;
        check_finite("target velocity", target_vel, dofs)?;
        let goal = Goal::Position { pos: target_pos, vel: target_vel, sync };
        let trajectory = match limits {
            Some(limits) if dofs > 0 => Some(plan(&start, limits, &goal)?),
            Some(_) | None => None,
        };
        let duration_s = trajectory.as_ref().map_or(0.0, Trajectory::get_duration);
        Ok(Self {
            start,
            target_pos: target_pos.to_vec(),
            target_vel: target_vel.to_vec(),
            trajectory,
            duration_s,
            time_s: 0.0,
        })
    }

    /// Plans the fastest way to rest within the limits of acceleration and jerk, each degree of freedom on its own.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn stop(start: MotionState, limits: &MotionLimits) -> Result<Self, MotionError> {
        let dofs = start.pos.len();
        check_state(&start)?;
        let trajectory = if dofs > 0 { Some(plan(&start, limits, &Goal::Rest)?) } else { None };
        let duration_s = trajectory.as_ref().map_or(0.0, Trajectory::get_duration);
        let target_pos = trajectory.as_ref().map_or_else(Vec::new, |t| sample(t, dofs, duration_s).pos);
        Ok(Self { start, target_pos, target_vel: vec![0.0; dofs], trajectory, duration_s, time_s: 0.0 })
    }

    /// Moves on by `dt` seconds and gives the state there.
    ///
    /// Past the end a motion stays at its target, or goes on with the target velocity if that is not zero. A `dt`
    /// that is negative or not a number counts as zero.
    pub fn step(&mut self, dt: f64) -> MotionStep {
        self.time_s += dt.max(0.0);
        self.at(self.time_s)
    }

    /// The state at a time after the start, without moving on.
    pub fn at(&self, time_s: f64) -> MotionStep {
        let time_left = self.duration_s - time_s;
        // Without a trajectory there is no time to arrive in: any step does, even one of zero length.
        if time_left > END_SLACK_S
            && let Some(trajectory) = &self.trajectory
        {
            let MotionState { pos, vel, accel } = sample(trajectory, self.start.pos.len(), time_s);
            return MotionStep { pos, vel, accel, finished: false, time_left };
        }
        let past = (-time_left).max(0.0);
        let pos = self.target_pos.iter().zip(&self.target_vel).map(|(p, v)| p + v * past).collect();
        let accel = vec![0.0; self.target_pos.len()];
        MotionStep { pos, vel: self.target_vel.clone(), accel, finished: true, time_left: 0.0 }
    }

    /// Length of the whole motion in seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Seconds since the start.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Where it ends; for a stop, the place where the arm comes to rest.
    pub fn target_pos(&self) -> &[f64] {
        &self.target_pos
    }
}

/// The target of a move of cyclic joints that is less than half a turn away from the start; the others as they are.
///
/// Joints beyond the end of `cyclic` are not cyclic.
pub fn shortest_way(start: &[f64], target: &[f64], cyclic: &[bool]) -> Vec<f64> {
    target
        .iter()
        .enumerate()
        .map(|(i, &goal)| match (cyclic.get(i), start.get(i)) {
            (Some(true), Some(&from)) => goal - ((goal - from) / TAU).round() * TAU,
            _ => goal,
        })
        .collect()
}

fn check_state(state: &MotionState) -> Result<(), MotionError> {
    let dofs = state.pos.len();
    check_finite("start position", &state.pos, dofs)?;
    check_finite("start velocity", &state.vel, dofs)?;
    check_finite("start acceleration", &state.accel, dofs)
}

fn check_finite(what: &'static str, values: &[f64], need: usize) -> Result<(), MotionError> {
    if values.len() != need {
        return Err(MotionError::WrongLength { what, got: values.len(), need });
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(dof) => Err(MotionError::NotFinite { what, dof, value: values[dof] }),
        None => Ok(()),
    }
}

fn check_limits(limits: &MotionLimits, need: usize) -> Result<(), MotionError> {
    let MotionLimits { max_vel, max_accel, max_jerk, min_vel, min_accel } = limits;
    let upper = [("maximum velocity", max_vel), ("maximum acceleration", max_accel), ("maximum jerk", max_jerk)];
    for (what, values) in upper {
        check_sign(what, values, need, 1.0)?;
    }
    for (what, values) in [("minimum velocity", min_vel), ("minimum acceleration", min_accel)] {
        if let Some(values) = values {
            check_sign(what, values, need, -1.0)?;
        }
    }
    Ok(())
}

fn check_sign(what: &'static str, values: &[f64], need: usize, sign: f64) -> Result<(), MotionError> {
    if values.len() != need {
        return Err(MotionError::WrongLength { what, got: values.len(), need });
    }
    match values.iter().position(|v| !(v.is_finite() && v * sign > 0.0)) {
        Some(dof) => {
            let sign = if sign > 0.0 { "positive" } else { "negative" };
            Err(MotionError::BadLimit { what, dof, value: values[dof], sign })
        }
        None => Ok(()),
    }
}

fn heap(values: &[f64]) -> DataArrayOrVec<f64, 0> {
    DataArrayOrVec::Heap(values.to_vec())
}

/// Where a target is just so far away that the largest acceleration is reached for no time at all, the planner may find no
/// profile by rounding; with a jerk that is smaller by this share there is one.
const OFF_THE_EDGE: f64 = 1e-7;

fn plan(start: &MotionState, limits: &MotionLimits, goal: &Goal<'_>) -> Result<Trajectory<0>, MotionError> {
    check_limits(limits, start.pos.len())?;
    match plan_exactly(start, limits, goal) {
        Err(MotionError::NoProfile { .. }) => {
            let max_jerk = limits.max_jerk.iter().map(|jerk| jerk * (1.0 - OFF_THE_EDGE)).collect();
            plan_exactly(start, &MotionLimits { max_jerk, ..limits.clone() }, goal)
        }
        planned => planned,
    }
}

fn plan_exactly(start: &MotionState, limits: &MotionLimits, goal: &Goal<'_>) -> Result<Trajectory<0>, MotionError> {
    let dofs = start.pos.len();
    let mut input = InputParameter::<0>::new(Some(dofs));
    input.current_position = heap(&start.pos);
    input.current_velocity = heap(&start.vel);
    input.current_acceleration = heap(&start.accel);
    input.max_velocity = heap(&limits.max_vel);
    input.max_acceleration = heap(&limits.max_accel);
    input.max_jerk = heap(&limits.max_jerk);
    input.min_velocity = limits.min_vel.as_deref().map(heap);
    input.min_acceleration = limits.min_accel.as_deref().map(heap);
    match goal {
        Goal::Position { pos, vel, sync } => {
            input.target_position = heap(pos);
            input.target_velocity = heap(vel);
            input.synchronization = match sync {
                Sync::Phase => Synchronization::Phase,
                Sync::Time => Synchronization::Time,
                Sync::None => Synchronization::None,
            };
        }
        Goal::Rest => {
            input.control_interface = ControlInterface::Velocity;
            input.synchronization = Synchronization::None;
        }
    }
    let mut trajectory = Trajectory::<0>::new(Some(dofs));
    // The planner samples no time here; its own step only matters for discrete durations.
    let result = Ruckig::<0, ThrowErrorHandler>::new(Some(dofs), 0.0)
        .calculate(&input, &mut trajectory)
        .map_err(|error| MotionError::NoProfile { reason: error.to_string() })?;
    match result {
        RuckigResult::Working | RuckigResult::Finished => Ok(trajectory),
        other => Err(MotionError::NoProfile { reason: format!("{other:?}") }),
    }
}

fn sample(trajectory: &Trajectory<0>, dofs: usize, time_s: f64) -> MotionState {
    let [mut pos, mut vel, mut accel] = [(); 3].map(|()| heap(&vec![0.0; dofs]));
    trajectory.at_time(time_s, &mut Some(&mut pos), &mut Some(&mut vel), &mut Some(&mut accel), &mut None, &mut None);
    MotionState { pos: pos.to_vec(), vel: vel.to_vec(), accel: accel.to_vec() }
}
