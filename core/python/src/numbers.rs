//! Arrays as bytes, and poses out of them.

use handeye_geometry::frames::{Frame, Pose};
use handeye_geometry::se3::rotation_of_matrix;
use nalgebra::{Isometry3, Matrix3, Translation3};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::Failure;

/// Numbers of a 4 × 4 matrix.
pub const OF_MATRIX: usize = 16;
/// Largest deviation of the last row of a transform from 0 0 0 1.
const LAST_ROW: f64 = 1e-9;

/// The doubles of an array.
pub fn doubles(bytes: &[u8]) -> Vec<f64> {
    let (whole, _none) = bytes.as_chunks::<8>();
    whole.iter().map(|chunk| f64::from_ne_bytes(*chunk)).collect()
}

/// The whole numbers of an array.
pub fn integers(bytes: &[u8]) -> Vec<i64> {
    let (whole, _none) = bytes.as_chunks::<8>();
    whole.iter().map(|chunk| i64::from_ne_bytes(*chunk)).collect()
}

/// An array as Python takes it.
pub fn bytes_of(py: Python<'_>, numbers: impl IntoIterator<Item = f64>) -> Bound<'_, PyBytes> {
    let bytes: Vec<u8> = numbers.into_iter().flat_map(f64::to_ne_bytes).collect();
    PyBytes::new(py, &bytes)
}

/// The numbers of a 4 × 4 matrix, row by row.
pub fn of_pose<Dst: Frame, Src: Frame>(pose: &Pose<Dst, Src>) -> Vec<f64> {
    let matrix = pose.matrix();
    (0..OF_MATRIX).map(|k| matrix[(k / 4, k % 4)]).collect()
}

/// The poses of a stack of 4 × 4 matrices, one for each name.
pub fn poses<Dst: Frame, Src: Frame>(
    what: &str,
    bytes: &[u8],
    names: &[String],
) -> Result<Vec<Pose<Dst, Src>>, Failure> {
    let numbers = doubles(bytes);
    let (matrices, _none) = numbers.as_chunks::<OF_MATRIX>();
    if matrices.len() != names.len() {
        let (got, need) = (matrices.len(), names.len());
        return Err(Failure::Input(format!("{what} has {got} poses for {need} views: one for each view is needed")));
    }
    let one = |(matrix, name): (&[f64; OF_MATRIX], &String)| {
        let pose = isometry(matrix).map_err(|why| Failure::Input(format!("{what} of view {name:?}: {why}")))?;
        Ok(Pose::from_isometry(pose))
    };
    matrices.iter().zip(names).map(one).collect()
}

/// The transform of a matrix; an error text where it is not one.
pub fn isometry(m: &[f64; OF_MATRIX]) -> Result<Isometry3<f64>, String> {
    if !m.iter().all(|v| v.is_finite()) {
        return Err("a number is not finite: leave this view out, or correct its pose".to_owned());
    }
    let last = [m[12], m[13], m[14], m[15] - 1.0];
    if last.iter().any(|v| v.abs() > LAST_ROW) {
        return Err(format!(
            "its last row is {:?} and must be [0, 0, 0, 1]: points are columns, is the matrix transposed?",
            &m[12..]
        ));
    }
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let rotation = rotation_of_matrix(&rotation).map_err(|problem| problem.to_string())?;
    Ok(Isometry3::from_parts(Translation3::new(m[3], m[7], m[11]), rotation))
}
