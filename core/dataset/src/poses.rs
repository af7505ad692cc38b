//! Pose tables: one image and one rigid transform per row.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::config::{LengthUnit, RobotConfig, RotationConvention};
use super::error::{DatasetError, DatasetProblem, shown};
use super::joints::{self, JointColumns};
use super::text::{Row, Table, TextFile};
use crate::value::AngleUnit;
use handeye_geometry::se3;

/// Largest deviation of a quaternion's length from 1. Three printed decimals stay within it; swapped columns or another
/// convention do not.
pub(super) const UNIT_TOLERANCE: f64 = 1e-3;
/// A length within this of 1 is 1 up to rounding.
const ROUNDING: f64 = 1e-12;
/// Largest angle that a controller reports, in radians: joints turn up to two full turns either way.
const LARGEST_ANGLE_RAD: f64 = 4.0 * std::f64::consts::PI;

/// A row of a pose table.
pub(super) struct PoseRow {
    /// The image as the table names it.
    pub name: String,
    /// Path in the data set.
    pub path: PathBuf,
    /// Line in the table.
    pub line: usize,
    /// The transform as the table gives it.
    pub isometry: Isometry3<f64>,
    /// Joint angles in radians, where the table has them.
    pub joints_rad: Option<Vec<f64>>,
}

/// Reads the poses of a table in the conventions of `[robot]`, and the joint angles if it has them. No image is there
/// twice.
pub(super) fn read_poses(
    file: &TextFile,
    conventions: &RobotConfig,
    joints: Option<&JointColumns>,
) -> Result<Vec<PoseRow>, DatasetError> {
    let joint_names = joints.map_or(&[][..], |joints| &joints::COLUMNS[..joints.count]);
    let headers: Vec<_> = headers(conventions.rotation).iter().map(|header| [header, joint_names].concat()).collect();
    let table = Table::parse(file, &headers, "one row per view is needed")?;
    let mut first_rows = BTreeMap::new();
    let mut poses = Vec::with_capacity(table.rows.len());
    for row in &table.rows {
        let name = row.text(0);
        let path = table.image_path(row, 0)?;
        if let Some(&first_row) = first_rows.get(&path) {
            let what = format!("image {:?}", shown(name));
            return Err(table.fail(row, DatasetProblem::Duplicate { what, first_row }));
        }
        first_rows.insert(path.clone(), row.line);
        let isometry = read_pose(&table, row, conventions)?;
        let joints_rad = joints.map(|joints| read_joints(&table, row, joints)).transpose()?;
        poses.push(PoseRow { name: name.to_owned(), path, line: row.line, isometry, joints_rad });
    }
    Ok(poses)
}

pub(super) fn headers(rotation: RotationConvention) -> Vec<Vec<&'static str>> {
    let rotations: &[&[&'static str]] = match rotation {
        RotationConvention::QuaternionXyzw => &[&["qx", "qy", "qz", "qw"]],
        RotationConvention::QuaternionWxyz => &[&["qw", "qx", "qy", "qz"]],
        RotationConvention::RotationVector(_) => &[&["rx", "ry", "rz"]],
        RotationConvention::Rpy(_) => &[&["roll", "pitch", "yaw"], &["rx", "ry", "rz"]],
        RotationConvention::Matrix => &[&["r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"]],
    };
    rotations.iter().map(|columns| [&["image", "x", "y", "z"], *columns].concat()).collect()
}

fn read_pose(table: &Table<'_>, row: &Row, conventions: &RobotConfig) -> Result<Isometry3<f64>, DatasetError> {
    const FIRST_OF_TRANSLATION: usize = 1;
    const FIRST_OF_ROTATION: usize = 4;
    let metres_per_unit = match conventions.length_unit {
        LengthUnit::Metre => 1.0,
        LengthUnit::Millimetre => 1e-3,
    };
    let translation = Vector3::from(table.numbers::<3>(row, FIRST_OF_TRANSLATION)?) * metres_per_unit;
    let rotation = match conventions.rotation {
        RotationConvention::QuaternionXyzw => {
            let [x, y, z, w] = table.numbers(row, FIRST_OF_ROTATION)?;
            unit_quaternion(Quaternion::new(w, x, y, z)).map_err(|p| table.fail(row, p))?
        }
        RotationConvention::QuaternionWxyz => {
            let [w, x, y, z] = table.numbers(row, FIRST_OF_ROTATION)?;
            unit_quaternion(Quaternion::new(w, x, y, z)).map_err(|p| table.fail(row, p))?
        }
        RotationConvention::RotationVector(unit) => {
            let vector = rotation_angles(table, row, FIRST_OF_ROTATION, unit)?;
            UnitQuaternion::from_scaled_axis(Vector3::from(vector))
        }
        RotationConvention::Rpy(unit) => {
            let [roll, pitch, yaw] = rotation_angles(table, row, FIRST_OF_ROTATION, unit)?;
            // URDF: about the fixed axes x, then y, then z. nalgebra builds the same product Rz·Ry·Rx.
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
        }
        RotationConvention::Matrix => {
            let elements: [f64; 9] = table.numbers(row, FIRST_OF_ROTATION)?;
            se3::rotation_of_matrix(&Matrix3::from_row_slice(&elements))
                .map_err(|why| table.fail(row, DatasetProblem::NotARotation(why)))?
        }
    };
    Ok(Isometry3::from_parts(Translation3::from(translation), rotation))
}

/// The last columns of a row.
fn read_joints(table: &Table<'_>, row: &Row, joints: &JointColumns) -> Result<Vec<f64>, DatasetError> {
    let first = table.column_count() - joints.count;
    (0..joints.count).map(|i| angle(table, row, first + i, joints.unit, "joint_unit")).collect()
}

fn rotation_angles(table: &Table<'_>, row: &Row, first: usize, unit: AngleUnit) -> Result<[f64; 3], DatasetError> {
    let at = |i| angle(table, row, first + i, unit, "angle_unit");
    Ok([at(0)?, at(1)?, at(2)?])
}

/// An angle in radians; `key` declares its unit.
fn angle(table: &Table<'_>, row: &Row, column: usize, unit: AngleUnit, key: &'static str) -> Result<f64, DatasetError> {
    let (radians_per_unit, unit) = match unit {
        AngleUnit::Degree => (std::f64::consts::PI / 180.0, "deg"),
        AngleUnit::Radian => (1.0, "rad"),
    };
    let value = table.number(row, column)?;
    let angle = value * radians_per_unit;
    if angle.abs() > LARGEST_ANGLE_RAD {
        let column = table.column_name(column);
        return Err(table.fail(row, DatasetProblem::AngleTooLarge { column, value, unit, key }));
    }
    Ok(angle)
}

pub(super) fn unit_quaternion(q: Quaternion<f64>) -> Result<UnitQuaternion<f64>, DatasetProblem> {
    let length = q.norm();
    if (length - 1.0).abs() > UNIT_TOLERANCE {
        return Err(DatasetProblem::NotUnit { length, tolerance: UNIT_TOLERANCE });
    }
    // Exact values stay as they are, bit for bit: a session solves to the same numbers live and from its files.
    let is_exact = (length - 1.0).abs() < ROUNDING;
    Ok(if is_exact { UnitQuaternion::new_unchecked(q) } else { UnitQuaternion::from_quaternion(q) })
}
