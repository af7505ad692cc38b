//! `sim.*`: joints.

use ciborium::Value;

use super::{Call, Outcome, Table, one, several};
use crate::args::ApiError;
use handeye_arm::JointKind;
use handeye_cell::world::{DriveLimits, Joint, JointMode, State};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[
    ("getJointPosition", get_joint_position),
    ("setJointPosition", set_joint_position),
    ("getJointTargetPosition", get_joint_target_position),
    ("setJointTargetPosition", set_joint_target_position),
    ("getJointInterval", get_joint_interval),
    ("getJointType", get_joint_type),
    ("getJointMode", get_joint_mode),
    ("getJointVelocity", get_joint_velocity),
    ("isDynamicallyEnabled", is_dynamically_enabled),
];

const JOINT_REVOLUTE: i64 = 10;
const JOINT_PRISMATIC: i64 = 11;
const JOINTMODE_KINEMATIC: i64 = 0;
const JOINTMODE_DYNAMIC: i64 = 5;

fn joint<'a>(call: &'a Call<'_>) -> Result<&'a Joint, ApiError> {
    Ok(call.cell.world.tree.joint(call.args.handle(0)?)?)
}

fn get_joint_position(call: &mut Call<'_>) -> Outcome {
    one(joint(call)?.position_rad())
}

fn set_joint_position(call: &mut Call<'_>) -> Outcome {
    let position_rad = call.args.number(1)?;
    let done = call.cell.world.tree.joint_mut(call.args.handle(0)?)?.set_position(position_rad)?;
    one(i64::from(done))
}

fn get_joint_target_position(call: &mut Call<'_>) -> Outcome {
    one(joint(call)?.target_rad())
}

fn set_joint_target_position(call: &mut Call<'_>) -> Outcome {
    let target_rad = call.args.number(1)?;
    let limits: Option<DriveLimits> = match call.args.optional_numbers(2)? {
        None => None,
        Some(limits) if limits.is_empty() => None,
        Some(limits) => Some(limits.try_into().ok().ok_or(ApiError::WrongSize)?),
    };
    call.cell.world.tree.joint_mut(call.args.handle(0)?)?.drive_to(target_rad, limits)?;
    one(1)
}

/// Whether it is cyclic, and the smallest position with the *range* above it.
fn get_joint_interval(call: &mut Call<'_>) -> Outcome {
    let joint = joint(call)?;
    let (min_rad, max_rad) = joint.interval_rad();
    several([Value::Bool(joint.cyclic), wire::floats([min_rad, max_rad - min_rad])])
}

fn get_joint_type(call: &mut Call<'_>) -> Outcome {
    one(match joint(call)?.kind {
        JointKind::Revolute => JOINT_REVOLUTE,
        JointKind::Prismatic => JOINT_PRISMATIC,
    })
}

fn get_joint_mode(call: &mut Call<'_>) -> Outcome {
    let mode = match joint(call)?.mode {
        JointMode::Kinematic => JOINTMODE_KINEMATIC,
        JointMode::Dynamic => JOINTMODE_DYNAMIC,
    };
    several([Value::from(mode), Value::from(0)])
}

fn is_dynamically_enabled(call: &mut Call<'_>) -> Outcome {
    let is_dynamic = joint(call)?.mode == JointMode::Dynamic;
    one(is_dynamic && call.cell.world.simulation().state() != State::Stopped)
}

fn get_joint_velocity(call: &mut Call<'_>) -> Outcome {
    one(joint(call)?.velocity_rad_s())
}
