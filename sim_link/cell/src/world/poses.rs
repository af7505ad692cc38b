//! Poses relative to anything, and between the forms that the API has for them.
//!
//! A pose is `[x y z qx qy qz qw]`, a matrix the twelve numbers of `[R | p]` row by row, Euler angles are those of
//! `Rx(α) · Ry(β) · Rz(γ)`.

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::error::WorldError;
use super::tree::{Chain, Kind, Tree};
use crate::world::handle::Handle;

/// `sim.handle_world`.
pub const HANDLE_WORLD: Handle = -1;
/// `sim.handle_parent`.
pub const HANDLE_PARENT: Handle = -11;
/// `sim.handle_inverse`.
pub const HANDLE_INVERSE: Handle = -14;
/// `sim.handleflag_reljointbaseframe`.
pub(crate) const FLAG_JOINT_BASE: Handle = 0x0040_0000;
/// `sim.handleflag_wxyzquat`.
pub(crate) const FLAG_WXYZ: Handle = 0x0100_0000;

/// Coordinates beyond this \[m\] are a script's mistake, and their products would leave the range of numbers.
const MAX_COORDINATE_M: f64 = 1e6;

/// A handle as scripts give it: with flags added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flagged {
    /// The object.
    pub handle: Handle,
    /// Poses relative to a joint are meant relative to its fixed frame.
    pub joint_base: bool,
    /// Quaternions come as w x y z.
    pub wxyz: bool,
}

impl Flagged {
    /// Splits the flags off.
    pub fn parse(handle: Handle) -> Self {
        if handle < 0 {
            return Self { handle, joint_base: false, wxyz: false };
        }
        let joint_base = handle & FLAG_JOINT_BASE != 0;
        let wxyz = handle & FLAG_WXYZ != 0;
        Self { handle: handle & !(FLAG_JOINT_BASE | FLAG_WXYZ), joint_base, wxyz }
    }
}

/// The frame that `relative_to` means for `object`: `world_from_reference`.
fn reference(tree: &Tree, object: Flagged, relative_to: Handle) -> Result<Isometry3<f64>, WorldError> {
    let reference = match relative_to {
        HANDLE_WORLD => return Ok(Isometry3::identity()),
        HANDLE_PARENT => match tree.get(object.handle)?.parent() {
            Some(parent) => parent,
            None => return Ok(Isometry3::identity()),
        },
        other => other,
    };
    let is_joint = matches!(tree.get(reference).ok().ok_or(WorldError::NoSuchReference)?.kind, Kind::Joint(_));
    if is_joint && !object.joint_base {
        tree.moving_pose(reference, Chain::Reported)
    } else {
        tree.world_pose(reference, Chain::Reported)
    }
}

/// `reference_from_object`; for [`HANDLE_INVERSE`] the inverse of the world pose.
///
/// # Errors
/// Objects that do not exist.
pub fn get(tree: &Tree, object: Flagged, relative_to: Handle) -> Result<Isometry3<f64>, WorldError> {
    let world_from_object = tree.world_pose(object.handle, Chain::Reported)?;
    if relative_to == HANDLE_INVERSE {
        return Ok(world_from_object.inverse());
    }
    Ok(reference(tree, object, relative_to)?.inv_mul(&world_from_object))
}

/// Puts an object to `reference_from_object`.
///
/// # Errors
/// Objects that do not exist; [`WorldError::InvalidData`] for coordinates that are not usable.
pub fn set(tree: &mut Tree, object: Flagged, relative_to: Handle, pose: &Isometry3<f64>) -> Result<(), WorldError> {
    tree.get(object.handle)?;
    check(pose)?;
    let world_from_object =
        if relative_to == HANDLE_INVERSE { pose.inverse() } else { reference(tree, object, relative_to)? * pose };
    check(&world_from_object)?;
    tree.set_world_pose(object.handle, &world_from_object)
}

fn check(pose: &Isometry3<f64>) -> Result<(), WorldError> {
    let usable = pose.translation.vector.iter().all(|v| v.abs() <= MAX_COORDINATE_M)
        && pose.rotation.coords.iter().all(|v| v.is_finite());
    if usable { Ok(()) } else { Err(WorldError::InvalidData) }
}

/// A pose from its seven numbers; the quaternion is normalised.
///
/// # Errors
/// [`WorldError::InvalidData`] for numbers that are not finite and a quaternion of no length.
pub fn from_numbers(values: &[f64; 7], wxyz: bool) -> Result<Isometry3<f64>, WorldError> {
    let [x, y, z, a, b, c, d] = *values;
    let quaternion = if wxyz { Quaternion::new(a, b, c, d) } else { Quaternion::new(d, a, b, c) };
    let norm = quaternion.norm();
    if !norm.is_finite() || norm < 1e-12 {
        return Err(WorldError::InvalidData);
    }
    let pose = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(quaternion));
    check(&pose)?;
    Ok(pose)
}

/// The seven numbers of a pose.
pub fn to_numbers(pose: &Isometry3<f64>, wxyz: bool) -> [f64; 7] {
    let t = pose.translation.vector;
    let q = pose.rotation.coords;
    // The sign that a conversion from the matrix would give for most rotations; scripts compare poses by number.
    let s = if q.w < 0.0 { -1.0 } else { 1.0 };
    let (x, y, z, w) = (s * q.x, s * q.y, s * q.z, s * q.w);
    if wxyz { [t.x, t.y, t.z, w, x, y, z] } else { [t.x, t.y, t.z, x, y, z, w] }
}

/// A pose from the twelve numbers of its matrix, made orthonormal with the z axis as the one that is kept.
///
/// # Errors
/// [`WorldError::InvalidData`] for numbers that are not finite and axes that span no frame.
pub fn from_matrix(m: &[f64; 12]) -> Result<Isometry3<f64>, WorldError> {
    let axis = |column: usize| Vector3::new(m[column], m[4 + column], m[8 + column]);
    let unit = |v: Vector3<f64>| v.try_normalize(1e-12).filter(|v| v.iter().all(|c| c.is_finite()));
    let z = unit(axis(2)).ok_or(WorldError::InvalidData)?;
    let y = unit(z.cross(&axis(0))).ok_or(WorldError::InvalidData)?;
    let x = y.cross(&z);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    let pose = Isometry3::from_parts(Translation3::from(axis(3)), UnitQuaternion::from_rotation_matrix(&rotation));
    check(&pose)?;
    Ok(pose)
}

/// The twelve numbers of a pose's matrix.
pub fn to_matrix(pose: &Isometry3<f64>) -> [f64; 12] {
    let r = pose.rotation.to_rotation_matrix();
    let t = pose.translation.vector;
    let mut m = [0.0; 12];
    for row in 0..3 {
        for column in 0..3 {
            m[4 * row + column] = r[(row, column)];
        }
        m[4 * row + 3] = t[row];
    }
    m
}

/// The rotation `Rx(α) · Ry(β) · Rz(γ)`.
///
/// # Errors
/// [`WorldError::InvalidData`] for angles that are not finite.
pub fn rotation_from_euler(angles: &[f64; 3]) -> Result<UnitQuaternion<f64>, WorldError> {
    if !angles.iter().all(|v| v.is_finite()) {
        return Err(WorldError::InvalidData);
    }
    let [x, y, z] = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    Ok(UnitQuaternion::from_axis_angle(&x, angles[0])
        * UnitQuaternion::from_axis_angle(&y, angles[1])
        * UnitQuaternion::from_axis_angle(&z, angles[2]))
}

/// The Euler angles α, β, γ of a rotation; α is 0 where it is not determined (β = ±90°).
pub fn euler_from_rotation(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    /// Sine of β beyond which only the sum or difference of α and γ is determined: 0.18° from the pole.
    const POLE: f64 = 0.999995;
    let r = rotation.to_rotation_matrix();
    let beta = r[(0, 2)].clamp(-1.0, 1.0).asin();
    if r[(0, 2)].abs() < POLE {
        [(-r[(1, 2)]).atan2(r[(2, 2)]), beta, (-r[(0, 1)]).atan2(r[(0, 0)])]
    } else {
        [0.0, beta, r[(1, 0)].atan2(r[(1, 1)])]
    }
}

/// The pose a part of the way from one to another: position on the line, rotation about one axis, the short way.
pub fn interpolate(from: &Isometry3<f64>, to: &Isometry3<f64>, t: f64) -> Isometry3<f64> {
    let position = from.translation.vector.lerp(&to.translation.vector, t);
    let turn = handeye_geometry::se3::rotation_vector(&(from.rotation.inverse() * to.rotation));
    Isometry3::from_parts(Translation3::from(position), from.rotation * UnitQuaternion::from_scaled_axis(turn * t))
}

#[cfg(test)]
#[path = "poses_tests.rs"]
mod tests;
