//! `sim.*`: parameters of the simulator and of objects, by number or by name.

use ciborium::Value;

use super::{Call, Outcome, Table, nothing, one, shapes};
use crate::args::ApiError;
use handeye_cell::world::{Handle, Kind, VisionSensor, WorldError};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[
    ("getStringParam", get_string_param),
    ("getInt32Param", get_int32_param),
    ("setInt32Param", set_int32_param),
    ("getFloatParam", get_float_param),
    ("setFloatParam", set_float_param),
    ("getBoolParam", get_bool_param),
    ("setBoolParam", set_bool_param),
    ("getNamedStringParam", get_named_string_param),
    ("getObjectFloatParam", get_object_float_param),
    ("getObjectInt32Param", get_object_int32_param),
    ("getObjectStringParam", get_object_string_param),
    ("getFloatProperty", get_float_property),
    ("getFloatArrayProperty", get_float_array_property),
    ("getBoolProperty", get_bool_property),
    ("getIntProperty", get_int_property),
    ("getIntArray2Property", get_int_array2_property),
    ("getStringProperty", get_string_property),
];

const PROGRAM_VERSION: i64 = 41000;
const PLATFORM_LINUX: i64 = 2;

mod int_param {
    pub const PROGRAM_VERSION: i64 = 1;
    pub const PLATFORM: i64 = 19;
    pub const IDLE_FPS: i64 = 26;
    pub const PROGRAM_REVISION: i64 = 30;
    pub const PROCESS_ID: i64 = 52;
}
const FLOAT_PARAM_TIME_STEP: i64 = 1;
mod bool_param {
    pub const REAL_TIME: i64 = 25;
    pub const HEADLESS: i64 = 34;
}
mod string_param {
    pub const APPLICATION_PATH: i64 = 0;
    pub const SCENE_PATH_AND_NAME: i64 = 13;
    pub const SCENE_PATH: i64 = 14;
    pub const UNIQUE_ID: i64 = 126;
    pub const SCENE_DEFAULT_DIR: i64 = 132;
}
mod vision {
    pub const NEAR: i64 = 1000;
    pub const FAR: i64 = 1001;
    pub const RESOLUTION_X: i64 = 1002;
    pub const RESOLUTION_Y: i64 = 1003;
    pub const PERSPECTIVE_ANGLE: i64 = 1004;
    pub const RENDER_MODE: i64 = 1017;
    pub const PERSPECTIVE: i64 = 1018;
    pub const RGB_IGNORED: i64 = 1020;
    pub const DEPTH_IGNORED: i64 = 1021;
}

/// Bounding box of a shape: the corner with the smallest coordinates, x, y, z, and then that with the largest.
const BOUNDS: std::ops::RangeInclusive<i64> = 15..=20;

/// The cell has no files, so all paths are empty.
fn get_string_param(call: &mut Call<'_>) -> Outcome {
    match call.args.integer(0)? {
        string_param::APPLICATION_PATH
        | string_param::SCENE_PATH_AND_NAME
        | string_param::SCENE_PATH
        | string_param::SCENE_DEFAULT_DIR => one(""),
        string_param::UNIQUE_ID => one(format!("handeye-{}", call.cell.scene.seed)),
        _ => Err(WorldError::InvalidArguments.into()),
    }
}

fn get_int32_param(call: &mut Call<'_>) -> Outcome {
    match call.args.integer(0)? {
        int_param::PROGRAM_VERSION => one(PROGRAM_VERSION),
        int_param::PLATFORM => one(PLATFORM_LINUX),
        int_param::IDLE_FPS => one(call.cell.idle_fps),
        int_param::PROGRAM_REVISION | int_param::PROCESS_ID => one(0),
        _ => Err(WorldError::InvalidArguments.into()),
    }
}

fn set_int32_param(call: &mut Call<'_>) -> Outcome {
    let (parameter, value) = (call.args.integer(0)?, call.args.integer(1)?);
    match parameter {
        int_param::IDLE_FPS => call.cell.idle_fps = value,
        _ => return Err(WorldError::InvalidArguments.into()),
    }
    nothing()
}

fn get_float_param(call: &mut Call<'_>) -> Outcome {
    match call.args.integer(0)? {
        FLOAT_PARAM_TIME_STEP => one(call.cell.world.simulation().time_step_s()),
        _ => Err(WorldError::InvalidArguments.into()),
    }
}

fn set_float_param(call: &mut Call<'_>) -> Outcome {
    let (parameter, value) = (call.args.integer(0)?, call.args.number(1)?);
    match parameter {
        FLOAT_PARAM_TIME_STEP => call.cell.world.set_time_step(value)?,
        _ => return Err(WorldError::InvalidArguments.into()),
    }
    nothing()
}

fn get_bool_param(call: &mut Call<'_>) -> Outcome {
    match call.args.integer(0)? {
        bool_param::REAL_TIME => one(call.cell.real_time),
        bool_param::HEADLESS => one(true),
        _ => Err(WorldError::InvalidArguments.into()),
    }
}

fn set_bool_param(call: &mut Call<'_>) -> Outcome {
    let (parameter, value) = (call.args.integer(0)?, call.args.boolean_or(1, true)?);
    match parameter {
        bool_param::REAL_TIME => call.cell.real_time = value,
        // Scripts switch displays and dialogs off, of which there are none; the others cannot be set.
        bool_param::HEADLESS => return Err(WorldError::InvalidArguments.into()),
        _ => {}
    }
    nothing()
}

/// No parameters are given to the cell by name.
fn get_named_string_param(call: &mut Call<'_>) -> Outcome {
    call.args.text(0)?;
    nothing()
}

/// The vision sensor with a handle, `None` for objects of another type.
fn sensor<'a>(call: &'a Call<'_>, handle: Handle) -> Result<Option<&'a VisionSensor>, ApiError> {
    match &call.cell.world.tree.get(handle)?.kind {
        Kind::VisionSensor(sensor) => Ok(Some(sensor)),
        _ => Ok(None),
    }
}

/// A parameter that the object does not have gives no value, and no error.
fn optional(value: Option<impl Into<Value>>) -> Outcome {
    value.map_or_else(nothing, one)
}

fn get_object_float_param(call: &mut Call<'_>) -> Outcome {
    let (handle, parameter) = (call.args.handle(0)?, call.args.integer(1)?);
    if BOUNDS.contains(&parameter) && matches!(call.cell.world.tree.get(handle)?.kind, Kind::Shape) {
        let bounds = shapes::bounds(call.cell, handle);
        let at = (parameter - BOUNDS.start()) as usize;
        return one(bounds[at / 3][at % 3]);
    }
    optional(sensor(call, handle)?.and_then(|sensor| match parameter {
        vision::NEAR => Some(sensor.near_m),
        vision::FAR => Some(sensor.far_m),
        vision::PERSPECTIVE_ANGLE => Some(sensor.view_angle_rad()),
        _ => None,
    }))
}

fn get_object_int32_param(call: &mut Call<'_>) -> Outcome {
    let (handle, parameter) = (call.args.handle(0)?, call.args.integer(1)?);
    optional(sensor(call, handle)?.and_then(|sensor| match parameter {
        vision::RESOLUTION_X => Some(i64::from(sensor.intrinsics.width)),
        vision::RESOLUTION_Y => Some(i64::from(sensor.intrinsics.height)),
        vision::RENDER_MODE => Some(0),
        vision::PERSPECTIVE => Some(1),
        vision::RGB_IGNORED => Some(i64::from(sensor.ignore_rgb)),
        vision::DEPTH_IGNORED => Some(i64::from(sensor.ignore_depth)),
        _ => None,
    }))
}

fn get_object_string_param(call: &mut Call<'_>) -> Outcome {
    call.cell.world.tree.get(call.args.handle(0)?)?;
    nothing()
}

fn no_property(name: &str) -> ApiError {
    ApiError::Other(format!("unknown property: {name}."))
}

fn get_float_property(call: &mut Call<'_>) -> Outcome {
    let (handle, name) = (call.args.handle(0)?, call.args.text(1)?);
    let object = call.cell.world.tree.get(handle)?;
    match (&object.kind, name) {
        (Kind::VisionSensor(sensor), "viewAngle") => one(sensor.view_angle_rad()),
        (Kind::Joint(joint), "position") => one(joint.position_rad()),
        (Kind::Joint(joint), "targetPosition") => one(joint.target_rad()),
        (Kind::Dummy { size_m }, "dummySize") => one(*size_m),
        _ => Err(no_property(name)),
    }
}

fn get_float_array_property(call: &mut Call<'_>) -> Outcome {
    let (handle, name) = (call.args.handle(0)?, call.args.text(1)?);
    match &call.cell.world.tree.get(handle)?.kind {
        Kind::VisionSensor(sensor) if name == "clippingPlanes" => one(wire::floats([sensor.near_m, sensor.far_m])),
        Kind::Joint(joint) if name == "interval" => {
            let (min_rad, max_rad) = joint.interval_rad();
            one(wire::floats([min_rad, max_rad]))
        }
        _ => Err(no_property(name)),
    }
}

fn get_bool_property(call: &mut Call<'_>) -> Outcome {
    let (handle, name) = (call.args.handle(0)?, call.args.text(1)?);
    let object = call.cell.world.tree.get(handle)?;
    match (&object.kind, name) {
        (Kind::VisionSensor(_), "perspective") => one(true),
        (Kind::VisionSensor(sensor), "explicitHandling") => one(sensor.explicit),
        (Kind::Joint(joint), "cyclic") => one(joint.cyclic),
        (_, "modelBase") => one(object.model_base),
        _ => Err(no_property(name)),
    }
}

fn get_int_property(call: &mut Call<'_>) -> Outcome {
    let (handle, name) = (call.args.handle(0)?, call.args.text(1)?);
    let object = call.cell.world.tree.get(handle)?;
    match name {
        "objectUid" | "handle" => one(handle),
        "parentUid" | "parentHandle" => one(object.parent().unwrap_or(-1)),
        _ => Err(no_property(name)),
    }
}

fn get_int_array2_property(call: &mut Call<'_>) -> Outcome {
    let (handle, name) = (call.args.handle(0)?, call.args.text(1)?);
    match sensor(call, handle)? {
        Some(sensor) if name == "resolution" => {
            one(wire::integers([sensor.intrinsics.width, sensor.intrinsics.height].map(i64::from)))
        }
        _ => Err(no_property(name)),
    }
}

fn get_string_property(call: &mut Call<'_>) -> Outcome {
    let (handle, name) = (call.args.handle(0)?, call.args.text(1)?);
    let object = call.cell.world.tree.get(handle)?;
    if name == "alias" { one(object.alias.clone()) } else { Err(no_property(name)) }
}
