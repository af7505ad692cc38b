//! Possible meanings of numbers in files: which conventions are open, and which numbers cannot be a rotation.

use nalgebra::{Matrix3, Matrix4};

pub use handeye_estimate::diagnose::hypotheses::conventions::{
    AngleUnit, Direction, Euler, LengthUnit, Numbers, Reading, RotationForm,
};

/// Largest deviation of a quaternion from unit length, and of a matrix from orthonormal: three printed decimals.
pub(super) const UNIT_TOLERANCE: f64 = 5e-3;
/// No arm reaches farther than this; a larger number is not in metres.
const FARTHEST_M: f64 = 20.0;
/// Controllers report angles within two turns.
const LARGEST_ANGLE_RAD: f64 = 4.0 * std::f64::consts::PI;

/// Units of lengths that numbers up to this size may have.
pub(super) fn lengths_for(largest: f64) -> Vec<LengthUnit> {
    LengthUnit::ALL.into_iter().filter(|unit| largest * unit.metres() <= FARTHEST_M).collect()
}

/// Units of angles that numbers up to this size may have.
pub(super) fn angles_for(largest: f64) -> Vec<AngleUnit> {
    AngleUnit::ALL.into_iter().filter(|unit| *unit == AngleUnit::Degree || largest <= LARGEST_ANGLE_RAD).collect()
}

/// The matrix of 16 or 12 numbers, row by row or column by column, when it is a rigid transform; the translation may have
/// any unit.
pub(super) fn rigid(numbers: &[f64]) -> Option<Matrix4<f64>> {
    let row_major = match numbers.len() {
        16 => Matrix4::from_row_slice(numbers),
        12 => {
            let mut m = Matrix4::identity();
            m.fixed_view_mut::<3, 4>(0, 0).copy_from(&nalgebra::Matrix3x4::from_row_slice(numbers));
            m
        }
        _ => return None,
    };
    let candidates = if numbers.len() == 16 { vec![row_major, row_major.transpose()] } else { vec![row_major] };
    candidates.into_iter().find(is_rigid)
}

/// Whether a matrix is a rotation with a translation, up to the rounding of printed numbers.
fn is_rigid(m: &Matrix4<f64>) -> bool {
    let last = m.row(3);
    let r = m.fixed_view::<3, 3>(0, 0).into_owned();
    m.iter().all(|v| v.is_finite())
        && last[0] == 0.0
        && last[1] == 0.0
        && last[2] == 0.0
        && (last[3] - 1.0).abs() < 1e-9
        && is_rotation(&r)
}

/// Whether nine numbers are a rotation matrix.
pub(super) fn is_rotation(r: &Matrix3<f64>) -> bool {
    r.iter().all(|v| v.is_finite())
        && (r.transpose() * r - Matrix3::identity()).amax() < 2.0 * UNIT_TOLERANCE
        && r.determinant() > 0.0
}

/// Whether four numbers are a quaternion.
pub(super) fn is_unit(numbers: &[f64]) -> bool {
    (numbers.iter().map(|n| n * n).sum::<f64>().sqrt() - 1.0).abs() < UNIT_TOLERANCE
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::*;

    #[test]
    fn a_matrix_by_columns_is_told_from_one_by_rows() {
        let pose = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.4, 0.5, 0.6)).to_homogeneous();
        let columns: Vec<f64> = pose.as_slice().to_vec();
        let rows: Vec<f64> = pose.transpose().as_slice().to_vec();
        assert_eq!(rigid(&columns), Some(pose));
        assert_eq!(rigid(&rows), Some(pose));
        assert_eq!(rigid(&rows[..12]), Some(pose));
    }
}
