//! `sim.*`: running the simulation, stepping it, waiting for it.

use ciborium::Value;

use super::{Call, Effect, Outcome, Table, nothing, one};
use crate::args::ApiError;
use crate::task::{Answer, CallbackTask, StepTask, StopTask, WaitTask};
use handeye_cell::world::WorldError;
use handeye_wire::Reader;

pub(super) const FUNCTIONS: Table = &[
    ("startSimulation", start_simulation),
    ("pauseSimulation", pause_simulation),
    ("stopSimulation", stop_simulation),
    ("getSimulationState", get_simulation_state),
    ("getSimulationTime", get_simulation_time),
    ("getSimulationTimeStep", get_simulation_time_step),
    ("getSystemTime", get_system_time),
    ("getSystemTimeInMs", get_system_time_in_ms),
    ("setStepping", set_stepping),
    ("step", step),
    ("switchThread", step),
    ("yield", step),
    ("wait", wait),
    ("acquireLock", acquire_lock),
    ("releaseLock", release_lock),
    ("setThreadSwitchTiming", set_thread_switch_timing),
    ("setThreadAutomaticSwitch", set_thread_automatic_switch),
    ("addLog", add_log),
    ("testCB", test_cb),
];

fn start_simulation(call: &mut Call<'_>) -> Outcome {
    call.cell.world.start_simulation();
    nothing()
}

fn pause_simulation(call: &mut Call<'_>) -> Outcome {
    call.cell.world.pause_simulation();
    nothing()
}

/// Ends everybody's stepping, or the passes that lead to the end would never come.
fn stop_simulation(call: &mut Call<'_>) -> Outcome {
    let wait = call.args.boolean_or(0, false)?;
    call.cell.world.stop_simulation();
    call.effects.push(Effect::ReleaseEverybody);
    if wait { Ok(Answer::Later(Box::new(StopTask::default()))) } else { nothing() }
}

fn get_simulation_state(call: &mut Call<'_>) -> Outcome {
    one(call.cell.world.simulation().state() as i64)
}

fn get_simulation_time(call: &mut Call<'_>) -> Outcome {
    one(call.cell.world.simulation().time_s())
}

fn get_simulation_time_step(call: &mut Call<'_>) -> Outcome {
    one(call.cell.world.simulation().time_step_s())
}

fn get_system_time(call: &mut Call<'_>) -> Outcome {
    one(call.cell.now.as_secs_f64())
}

fn get_system_time_in_ms(call: &mut Call<'_>) -> Outcome {
    one(call.cell.now.as_millis() as i64)
}

fn set_stepping(call: &mut Call<'_>) -> Outcome {
    let enable = call.args.boolean_or(0, true)?;
    one(i64::from(call.client.set_stepping(enable, call.step)))
}

#[expect(clippy::unnecessary_wraps, reason = "every function of the API has this type")]
fn step(_call: &mut Call<'_>) -> Outcome {
    Ok(Answer::Later(Box::new(StepTask)))
}

fn wait(call: &mut Call<'_>) -> Outcome {
    let seconds = call.args.number(0)?;
    let simulated = call.args.boolean_or(1, true)?;
    if !seconds.is_finite() {
        return Err(WorldError::InvalidArguments.into());
    }
    let since_s = if simulated { call.cell.world.simulation().time_s() } else { call.cell.now.as_secs_f64() };
    Ok(Answer::Later(Box::new(WaitTask { seconds, simulated, since_s })))
}

fn acquire_lock(call: &mut Call<'_>) -> Outcome {
    call.client.locks = call.client.locks.saturating_add(1);
    nothing()
}

fn release_lock(call: &mut Call<'_>) -> Outcome {
    call.client.locks = call.client.locks.saturating_sub(1);
    nothing()
}

/// Requests are answered at once, whatever the timing.
fn set_thread_switch_timing(call: &mut Call<'_>) -> Outcome {
    call.args.number(0)?;
    one(0)
}

fn set_thread_automatic_switch(_call: &mut Call<'_>) -> Outcome {
    nothing()
}

fn add_log(call: &mut Call<'_>) -> Outcome {
    const MAX_LINE: usize = 4000;
    let verbosity = call.args.integer(0)? & 0xfff;
    let Some(text) = call.args.get(1) else { return nothing() };
    let text = text.text().ok_or(ApiError::WrongType { number: 2, expected: "a string" })?;
    let text: String = text.chars().take(MAX_LINE).collect();
    tracing::info!(verbosity, "{text}");
    call.cell.add_log(text);
    nothing()
}

/// Calls a function of the client with two values, 99 times by default, and once more for its result.
fn test_cb(call: &mut Call<'_>) -> Outcome {
    const MAX_ITERATIONS: i64 = 100_000;
    let name = call.args.callback(1).ok_or(ApiError::WrongType { number: 2, expected: "a function" })?;
    let argument = |at| call.args.get(at).cloned().unwrap_or(Value::Null);
    let iterations = call.args.integer_or(3, 99)?.clamp(0, MAX_ITERATIONS);
    let task = CallbackTask { name, args: vec![argument(0), argument(2)], left: iterations.unsigned_abs() + 1 };
    Ok(Answer::Later(Box::new(task)))
}
