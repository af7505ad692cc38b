//! The information of the views on the lens, and whether it is enough.

use nalgebra::{DMatrix, SymmetricEigen};

use super::IntrinsicsError;
use handeye_geometry::camera::Intrinsics;

/// Corner noise \[px\] for which a calibration is judged determined or not: that of a good camera.
const TYPICAL_NOISE_PX: f64 = 0.1;
/// Largest standard deviation of the pinhole's numbers for that noise, as a part of the focal length: at 5 % every
/// distance measured is off by a centimetre in twenty.
const MAX_RELATIVE_SIGMA: f64 = 0.05;
/// Eigenvalues of the information matrix, scaled to unit diagonal, are not trusted below this: it is rounding. Only
/// combinations of distortion coefficients come near it (the rational model has such), and those do no harm.
const MIN_EIGENVALUE: f64 = 1e-14;
const PINHOLE_NAMES: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// The covariance of an information matrix of `[fx fy cx cy, …]`; refuses one that leaves the pinhole undetermined.
pub(super) fn covariance(information: &DMatrix<f64>, camera: &Intrinsics) -> Result<DMatrix<f64>, IntrinsicsError> {
    let covariance = inverse(information)?;
    for (i, (parameter, focal)) in
        PINHOLE_NAMES.into_iter().zip([camera.fx, camera.fy, camera.fx, camera.fy]).enumerate()
    {
        let sigma_px = TYPICAL_NOISE_PX * covariance[(i, i)].sqrt();
        if sigma_px.is_nan() || sigma_px > MAX_RELATIVE_SIGMA * focal {
            return Err(IntrinsicsError::Undetermined { parameter, sigma_px });
        }
    }
    Ok(covariance)
}

/// The inverse of an information matrix of any of the unknowns.
pub(super) fn inverse(information: &DMatrix<f64>) -> Result<DMatrix<f64>, IntrinsicsError> {
    let n = information.nrows();
    let scale: Vec<f64> = (0..n).map(|i| information[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    // Parameters differ in size by many orders; scaled to unit diagonal the eigenvalues can be compared.
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] / (scale[i] * scale[j]));
    if scaled.iter().any(|v| !v.is_finite()) {
        return Err(IntrinsicsError::NotACamera { reason: "its equations are not numbers" });
    }
    let eigen = SymmetricEigen::new(scaled);
    let vectors = &eigen.eigenvectors;
    Ok(DMatrix::from_fn(n, n, |i, j| {
        let sum: f64 =
            (0..n).map(|k| vectors[(i, k)] * vectors[(j, k)] / eigen.eigenvalues[k].max(MIN_EIGENVALUE)).sum();
        sum / (scale[i] * scale[j])
    }))
}
