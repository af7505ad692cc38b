//! `sim.*`: where objects are.

use nalgebra::{Isometry3, Translation3};

use super::{Call, Outcome, Table, nothing, one};
use crate::args::ApiError;
use handeye_cell::world::{Flagged, WorldError, poses};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[
    ("getObjectPosition", get_object_position),
    ("getObjectOrientation", get_object_orientation),
    ("getObjectQuaternion", get_object_quaternion),
    ("getObjectPose", get_object_pose),
    ("getObjectMatrix", get_object_matrix),
    ("setObjectPosition", set_object_position),
    ("setObjectOrientation", set_object_orientation),
    ("setObjectQuaternion", set_object_quaternion),
    ("setObjectPose", set_object_pose),
    ("setObjectMatrix", set_object_matrix),
];

/// The pose requested by a getter, and the handle with its flags.
fn asked(call: &Call<'_>) -> Result<(Isometry3<f64>, Flagged), ApiError> {
    let object = Flagged::parse(call.args.handle(0)?);
    let relative_to = call.args.integer_or(1, poses::HANDLE_WORLD)?;
    Ok((poses::get(&call.cell.world.tree, object, relative_to)?, object))
}

fn get_object_position(call: &mut Call<'_>) -> Outcome {
    if call.args.integer_or(1, poses::HANDLE_WORLD)? == poses::HANDLE_INVERSE {
        return Err(WorldError::InvalidArguments.into());
    }
    one(wire::floats(asked(call)?.0.translation.vector.iter().copied()))
}

fn get_object_orientation(call: &mut Call<'_>) -> Outcome {
    one(wire::floats(poses::euler_from_rotation(&asked(call)?.0.rotation)))
}

fn get_object_quaternion(call: &mut Call<'_>) -> Outcome {
    let (pose, object) = asked(call)?;
    one(wire::floats(poses::to_numbers(&pose, object.wxyz)[3..].iter().copied()))
}

fn get_object_pose(call: &mut Call<'_>) -> Outcome {
    let (pose, object) = asked(call)?;
    one(wire::floats(poses::to_numbers(&pose, object.wxyz)))
}

fn get_object_matrix(call: &mut Call<'_>) -> Outcome {
    one(wire::floats(poses::to_matrix(&asked(call)?.0)))
}

/// Arguments of a setter: the object, what the value is relative to, and at which position the value is.
///
/// The value comes second and the reference third, or, in the old order, the other way round.
fn pose_arguments(call: &Call<'_>) -> Result<(Flagged, i64, usize), ApiError> {
    let object = Flagged::parse(call.args.handle(0)?);
    if call.args.is_table(1) {
        return Ok((object, call.args.integer_or(2, poses::HANDLE_WORLD)?, 1));
    }
    let relative_to = call.args.integer(1)?;
    // Without a table the missing argument is the value.
    if call.args.len() < 3 { Err(ApiError::TooFewArguments) } else { Ok((object, relative_to, 2)) }
}

/// Puts an object somewhere; `change` makes the new pose from the one that it has.
fn set(
    call: &mut Call<'_>,
    change: impl FnOnce(&Call<'_>, usize, Flagged, Isometry3<f64>) -> Result<Isometry3<f64>, ApiError>,
) -> Outcome {
    let (object, relative_to, at) = pose_arguments(call)?;
    let present = poses::get(&call.cell.world.tree, object, relative_to)?;
    let pose = change(call, at, object, present)?;
    poses::set(&mut call.cell.world.tree, object, relative_to, &pose)?;
    nothing()
}

fn set_object_position(call: &mut Call<'_>) -> Outcome {
    set(call, |call, at, _, present| {
        Ok(Isometry3::from_parts(Translation3::from(call.args.array::<3>(at)?), present.rotation))
    })
}

fn set_object_orientation(call: &mut Call<'_>) -> Outcome {
    set(call, |call, at, _, present| {
        Ok(Isometry3::from_parts(present.translation, poses::rotation_from_euler(&call.args.array(at)?)?))
    })
}

fn set_object_quaternion(call: &mut Call<'_>) -> Outcome {
    set(call, |call, at, object, present| {
        let [a, b, c, d] = call.args.array(at)?;
        let turned = poses::from_numbers(&[0.0, 0.0, 0.0, a, b, c, d], object.wxyz)?;
        Ok(Isometry3::from_parts(present.translation, turned.rotation))
    })
}

fn set_object_pose(call: &mut Call<'_>) -> Outcome {
    set(call, |call, at, object, _| Ok(poses::from_numbers(&call.args.array(at)?, object.wxyz)?))
}

fn set_object_matrix(call: &mut Call<'_>) -> Outcome {
    set(call, |call, at, _, _| {
        let numbers = call.args.numbers(at)?;
        // A 4×4 matrix as some scripts send it: the last row is ignored.
        let numbers = numbers.get(..12).filter(|_| matches!(numbers.len(), 12 | 16)).ok_or(ApiError::WrongSize)?;
        let matrix: [f64; 12] = numbers.try_into().ok().ok_or(ApiError::WrongSize)?;
        Ok(poses::from_matrix(&matrix)?)
    })
}
