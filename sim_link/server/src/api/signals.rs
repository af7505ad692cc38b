//! `sim.*`: values that clients leave for each other.

use ciborium::Value;

use super::{Call, Outcome, Table, nothing, one};
use crate::args::ApiError;
use crate::cell::{MAX_SIGNAL_BYTES, MAX_SIGNALS};
use handeye_cell::world::WorldError;

pub(super) const FUNCTIONS: Table = &[
    ("setStringSignal", set_string_signal),
    ("getStringSignal", get_string_signal),
    ("clearStringSignal", clear_string_signal),
    ("setInt32Signal", set_int32_signal),
    ("getInt32Signal", get_int32_signal),
    ("clearInt32Signal", clear_int32_signal),
    ("setFloatSignal", set_float_signal),
    ("getFloatSignal", get_float_signal),
    ("clearFloatSignal", clear_float_signal),
    ("writeCustomDataBlock", write_custom_data_block),
    ("readCustomDataBlock", read_custom_data_block),
    ("writeCustomStringData", write_custom_data_block),
    ("readCustomStringData", read_custom_data_block),
];

/// Signals of different types have different name spaces, as the data of every object.
fn key(call: &Call<'_>, space: &str, at: usize) -> Result<String, ApiError> {
    Ok(format!("{space} {}", call.args.text(at)?))
}

fn store(call: &mut Call<'_>, key: String, value: Value) -> Outcome {
    let signals = &mut call.cell.signals;
    if key.len() > MAX_SIGNAL_BYTES || (signals.len() >= MAX_SIGNALS && !signals.contains_key(&key)) {
        return Err(WorldError::TooMany { what: "signals", limit: MAX_SIGNALS }.into());
    }
    signals.insert(key, value);
    nothing()
}

fn load(call: &Call<'_>, key: &str) -> Outcome {
    call.cell.signals.get(key).map_or_else(nothing, |value| one(value.clone()))
}

fn clear(call: &mut Call<'_>, space: &str) -> Outcome {
    let key = key(call, space, 0)?;
    call.cell.signals.remove(&key);
    nothing()
}

fn blob(call: &Call<'_>, at: usize) -> Result<Value, ApiError> {
    if call.args.blob(at)?.len() > MAX_SIGNAL_BYTES {
        return Err(WorldError::TooMany { what: "bytes in a signal", limit: MAX_SIGNAL_BYTES }.into());
    }
    Ok(call.args.get(at).cloned().unwrap_or(Value::Null))
}

fn set_string_signal(call: &mut Call<'_>) -> Outcome {
    let value = blob(call, 1)?;
    store(call, key(call, "string", 0)?, value)
}

fn get_string_signal(call: &mut Call<'_>) -> Outcome {
    load(call, &key(call, "string", 0)?)
}

fn clear_string_signal(call: &mut Call<'_>) -> Outcome {
    clear(call, "string")
}

fn set_int32_signal(call: &mut Call<'_>) -> Outcome {
    let value = Value::from(call.args.integer(1)?);
    store(call, key(call, "int", 0)?, value)
}

fn get_int32_signal(call: &mut Call<'_>) -> Outcome {
    load(call, &key(call, "int", 0)?)
}

fn clear_int32_signal(call: &mut Call<'_>) -> Outcome {
    clear(call, "int")
}

fn set_float_signal(call: &mut Call<'_>) -> Outcome {
    let value = Value::Float(call.args.number(1)?);
    store(call, key(call, "float", 0)?, value)
}

fn get_float_signal(call: &mut Call<'_>) -> Outcome {
    load(call, &key(call, "float", 0)?)
}

fn clear_float_signal(call: &mut Call<'_>) -> Outcome {
    clear(call, "float")
}

fn data_key(call: &Call<'_>) -> Result<String, ApiError> {
    let handle = call.args.handle(0)?;
    // Data may belong to an object or, under a negative handle, to the scene.
    if handle >= 0 {
        call.cell.world.tree.get(handle)?;
    }
    key(call, &handle.to_string(), 1)
}

fn write_custom_data_block(call: &mut Call<'_>) -> Outcome {
    let value = blob(call, 2)?;
    store(call, data_key(call)?, value)
}

/// Always a string for clients, never nothing.
fn read_custom_data_block(call: &mut Call<'_>) -> Outcome {
    let key = data_key(call)?;
    one(call.cell.signals.get(&key).cloned().unwrap_or_else(|| Value::from("")))
}
