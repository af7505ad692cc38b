//! How accurately noise levels can be estimated at all: the least scatter of an estimate of them.
//!
//! Like the bound it is computed from the model and not with the estimator: the inverse of the expected information of
//! the restricted likelihood, `½ tr(P V_k P V_l)`.

use handeye_estimate::handeye::joint::Noise;
use nalgebra::{DMatrix, DVector, Matrix3, Vector6};

use super::bound::{Blocks, Normals, scaled_inverse};

/// Adds the two orders of a product that is not symmetric itself.
fn symmetric(m: &DMatrix<f64>) -> DMatrix<f64> {
    (m + m.transpose()) * 0.5
}

/// Relative standard deviations that estimates of the levels of corners, robot position and robot orientation have at
/// least; infinite for one that is zero, `None` when the views determine neither answer nor noise levels.
pub fn level_scatter(normals: &Normals, noise: &Noise) -> Option<[f64; 3]> {
    let p = normals.shared;
    let theta = [noise.corner_px.powi(2), noise.robot_m.powi(2), noise.robot_rad.powi(2)];
    // Robot covariance of a view, and which of its six components a variance scales.
    let robot = Vector6::from_fn(|i, _| if i < 3 { theta[1] } else { theta[2] });
    let part = |k: usize| DMatrix::from_fn(6, 6, |i, j| f64::from(i == j && (i < 3) == (k == 1)));
    let parts = [part(1), part(2)];
    let mut information = DMatrix::zeros(p, p);
    // For the robot's variances 1 and 2: A_i = Xᵀ V⁻¹ V_i V⁻¹ X, Q_ij = Xᵀ V⁻¹ V_i V⁻¹ V_j V⁻¹ X, tr(V⁻¹ V_i V⁻¹ V_j).
    let mut a = [DMatrix::zeros(p, p), DMatrix::zeros(p, p)];
    let mut q = [[DMatrix::zeros(p, p), DMatrix::zeros(p, p)], [DMatrix::zeros(p, p), DMatrix::zeros(p, p)]];
    let mut once = [0.0; 2];
    let mut twice = [[0.0; 2]; 2];
    for Blocks { shared, cross, own } in normals.blocks() {
        let noisy = &own * DMatrix::from_diagonal(&DVector::from_column_slice(robot.as_slice()))
            + DMatrix::identity(6, 6) * theta[0];
        let lu = noisy.lu();
        let g = lu.solve(&cross)?;
        let k = symmetric(&lu.solve(&own)?);
        let carried = DMatrix::from_fn(6, p, |i, j| robot[i] * g[(i, j)]);
        information += (shared - cross.transpose() * carried) / theta[0];
        for i in 0..2 {
            a[i] += g.transpose() * &parts[i] * &g;
            once[i] += (&parts[i] * &k).trace();
            for j in 0..2 {
                q[i][j] += g.transpose() * &parts[i] * &k * &parts[j] * &g;
                twice[i][j] += (&parts[i] * &k * &parts[j] * &k).trace();
            }
        }
    }
    let phi = scaled_inverse(&symmetric(&information))?;
    // tr(P V_i) and tr(P V_i P V_j), P the projector of the restricted likelihood.
    let first = |i: usize| once[i] - (&phi * &a[i]).trace();
    let second = |i: usize, j: usize| {
        twice[i][j] - 2.0 * (&phi * symmetric(&q[i][j])).trace() + (&phi * &a[i] * &phi * &a[j]).trace()
    };
    let mut pairs = Matrix3::zeros();
    for i in 0..2 {
        for j in 0..2 {
            pairs[(i + 1, j + 1)] = second(i, j);
        }
    }
    for j in 0..2 {
        let with_corner = (first(j) - theta[1] * second(0, j) - theta[2] * second(1, j)) / theta[0];
        pairs[(0, j + 1)] = with_corner;
        pairs[(j + 1, 0)] = with_corner;
    }
    let freedom = (normals.residuals - p) as f64;
    let of_corner = (freedom - theta[1] * first(0) - theta[2] * first(1)) / theta[0];
    pairs[(0, 0)] = (of_corner - theta[1] * pairs[(0, 1)] - theta[2] * pairs[(0, 2)]) / theta[0];
    let information = DMatrix::from_fn(3, 3, |i, j| 0.5 * pairs[(i, j)]);
    let variances = scaled_inverse(&information)?;
    Some(std::array::from_fn(|k| 0.5 * variances[(k, k)].sqrt() / theta[k]))
}
