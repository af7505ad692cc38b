//! `sim.*`: computing with poses and matrices.

use ciborium::Value;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{Call, Outcome, Table, one, several};
use crate::args::ApiError;
use handeye_cell::world::{WorldError, poses};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[
    ("poseToMatrix", pose_to_matrix),
    ("matrixToPose", matrix_to_pose),
    ("buildIdentityMatrix", build_identity_matrix),
    ("buildMatrix", build_matrix),
    ("buildMatrixQ", build_matrix_q),
    ("buildPose", build_pose),
    ("multiplyPoses", multiply_poses),
    ("multiplyMatrices", multiply_matrices),
    ("multiplyVector", multiply_vector),
    ("getMatrixInverse", get_matrix_inverse),
    ("getPoseInverse", get_pose_inverse),
    ("invertMatrix", get_matrix_inverse),
    ("interpolatePoses", interpolate_poses),
    ("interpolateMatrices", interpolate_matrices),
    ("getEulerAnglesFromMatrix", get_euler_angles_from_matrix),
    ("getQuaternionFromMatrix", get_quaternion_from_matrix),
    ("getRotationAxis", get_rotation_axis),
    ("rotateAroundAxis", rotate_around_axis),
    ("alphaBetaGammaToYawPitchRoll", alpha_beta_gamma_to_yaw_pitch_roll),
    ("yawPitchRollToAlphaBetaGamma", yaw_pitch_roll_to_alpha_beta_gamma),
];

fn pose_at(call: &Call<'_>, at: usize) -> Result<Isometry3<f64>, ApiError> {
    Ok(poses::from_numbers(&call.args.array(at)?, false)?)
}

fn matrix_at(call: &Call<'_>, at: usize) -> Result<Isometry3<f64>, ApiError> {
    Ok(poses::from_matrix(&call.args.array(at)?)?)
}

fn as_pose(pose: &Isometry3<f64>) -> Value {
    wire::floats(poses::to_numbers(pose, false))
}

fn as_matrix(pose: &Isometry3<f64>) -> Value {
    wire::floats(poses::to_matrix(pose))
}

fn pose_to_matrix(call: &mut Call<'_>) -> Outcome {
    one(as_matrix(&pose_at(call, 0)?))
}

fn matrix_to_pose(call: &mut Call<'_>) -> Outcome {
    one(as_pose(&matrix_at(call, 0)?))
}

fn build_identity_matrix(_call: &mut Call<'_>) -> Outcome {
    one(as_matrix(&Isometry3::identity()))
}

fn build_matrix(call: &mut Call<'_>) -> Outcome {
    one(as_matrix(&at_euler(call)?))
}

fn at_euler(call: &Call<'_>) -> Result<Isometry3<f64>, ApiError> {
    let position = call.args.array::<3>(0)?;
    let rotation = poses::rotation_from_euler(&call.args.array(1)?)?;
    Ok(Isometry3::from_parts(Translation3::from(position), rotation))
}

fn build_matrix_q(call: &mut Call<'_>) -> Outcome {
    let ([x, y, z], [a, b, c, d]) = (call.args.array(0)?, call.args.array(1)?);
    one(as_matrix(&poses::from_numbers(&[x, y, z, a, b, c, d], false)?))
}

/// Mode 0 takes Euler angles; mode 1 an axis and the angle about it as the fourth argument.
fn build_pose(call: &mut Call<'_>) -> Outcome {
    match call.args.integer_or(2, 0)? {
        0 => one(as_pose(&at_euler(call)?)),
        1 => {
            let position = call.args.array::<3>(0)?;
            let axis = nalgebra::Unit::try_new(Vector3::from(call.args.array(1)?), 1e-12);
            let axis = axis.ok_or(WorldError::InvalidData)?;
            let rotation = UnitQuaternion::from_axis_angle(&axis, call.args.number(3)?);
            one(as_pose(&Isometry3::from_parts(Translation3::from(position), rotation)))
        }
        _ => Err(WorldError::InvalidArguments.into()),
    }
}

fn multiply_poses(call: &mut Call<'_>) -> Outcome {
    one(as_pose(&(pose_at(call, 0)? * pose_at(call, 1)?)))
}

fn multiply_matrices(call: &mut Call<'_>) -> Outcome {
    one(as_matrix(&(matrix_at(call, 0)? * matrix_at(call, 1)?)))
}

/// A matrix or a pose times one point, or several in one list.
fn multiply_vector(call: &mut Call<'_>) -> Outcome {
    let transform = if call.args.numbers(0)?.len() == 7 { pose_at(call, 0)? } else { matrix_at(call, 0)? };
    let numbers = call.args.numbers(1)?;
    if numbers.is_empty() || !numbers.len().is_multiple_of(3) {
        return Err(ApiError::WrongSize);
    }
    let points = numbers.chunks_exact(3).map(|p| transform * nalgebra::Point3::new(p[0], p[1], p[2]));
    one(wire::floats(points.flat_map(|p| [p.x, p.y, p.z])))
}

fn get_matrix_inverse(call: &mut Call<'_>) -> Outcome {
    one(as_matrix(&matrix_at(call, 0)?.inverse()))
}

fn get_pose_inverse(call: &mut Call<'_>) -> Outcome {
    one(as_pose(&pose_at(call, 0)?.inverse()))
}

fn interpolate_poses(call: &mut Call<'_>) -> Outcome {
    one(as_pose(&poses::interpolate(&pose_at(call, 0)?, &pose_at(call, 1)?, call.args.number(2)?)))
}

fn interpolate_matrices(call: &mut Call<'_>) -> Outcome {
    one(as_matrix(&poses::interpolate(&matrix_at(call, 0)?, &matrix_at(call, 1)?, call.args.number(2)?)))
}

fn get_euler_angles_from_matrix(call: &mut Call<'_>) -> Outcome {
    one(wire::floats(poses::euler_from_rotation(&matrix_at(call, 0)?.rotation)))
}

fn get_quaternion_from_matrix(call: &mut Call<'_>) -> Outcome {
    one(wire::floats(poses::to_numbers(&matrix_at(call, 0)?, false)[3..].iter().copied()))
}

/// Axis, in the frame that both are given in, and angle of the rotation from one orientation to another.
fn get_rotation_axis(call: &mut Call<'_>) -> Outcome {
    let at = |index| if call.args.numbers(index)?.len() == 7 { pose_at(call, index) } else { matrix_at(call, index) };
    let turn = handeye_geometry::se3::rotation_vector(&(at(1)?.rotation * at(0)?.rotation.inverse()));
    let angle = turn.norm();
    let axis = if angle > 0.0 { turn / angle } else { Vector3::x() };
    several([wire::floats(axis.iter().copied()), Value::Float(angle)])
}

/// Turns a pose or matrix about an axis through a point.
fn rotate_around_axis(call: &mut Call<'_>) -> Outcome {
    let is_pose = call.args.numbers(0)?.len() == 7;
    let pose = if is_pose { pose_at(call, 0)? } else { matrix_at(call, 0)? };
    let axis = nalgebra::Unit::try_new(Vector3::from(call.args.array(1)?), 1e-12).ok_or(WorldError::InvalidData)?;
    let through = Translation3::from(call.args.array::<3>(2)?);
    let rotation = UnitQuaternion::from_axis_angle(&axis, call.args.number(3)?);
    let turned = through * rotation * through.inverse() * pose;
    one(if is_pose { as_pose(&turned) } else { as_matrix(&turned) })
}

/// From `Rx(α)·Ry(β)·Rz(γ)` to `Rz(yaw)·Ry(pitch)·Rx(roll)`.
fn alpha_beta_gamma_to_yaw_pitch_roll(call: &mut Call<'_>) -> Outcome {
    let angles = [call.args.number(0)?, call.args.number(1)?, call.args.number(2)?];
    let (roll, pitch, yaw) = poses::rotation_from_euler(&angles)?.euler_angles();
    several([yaw, pitch, roll].map(Value::Float))
}

fn yaw_pitch_roll_to_alpha_beta_gamma(call: &mut Call<'_>) -> Outcome {
    let (yaw, pitch, roll) = (call.args.number(0)?, call.args.number(1)?, call.args.number(2)?);
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    several(poses::euler_from_rotation(&rotation).map(Value::Float))
}
