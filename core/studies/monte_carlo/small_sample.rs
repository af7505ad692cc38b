//! What estimated noise levels do to a stated covariance: its own uncertainty, by three recipes side by side.
//!
//! `docs/maths/uncertainty.md` derives them. Like the bound they are computed from the model, with the noise levels that
//! an estimate found, and not by the estimator.

use handeye_core::estimate::handeye::joint::Noise;
use nalgebra::{DMatrix, Matrix3, Matrix6, Point3, SMatrix, SymmetricEigen, Vector3, Vector6};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::bound::{Blocks, Normals, scaled_inverse};

/// Components of a hand-eye transform.
const L: f64 = 6.0;
/// Degrees of freedom that count as infinite: quantiles differ by less than one part in a thousand.
pub const MANY: f64 = 1e4;
/// A robot noise that makes the covariance larger by less than this part is at its lower end.
const NEGLIGIBLE: f64 = 0.01;

/// Covariance of the hand-eye transform at estimated noise levels, and how well it is known.
pub struct Correction {
    /// `Φ`: the covariance as if the noise levels were true.
    pub covariance: Matrix6<f64>,
    /// `∂Φ/∂θ` by the variances of corners, robot translation and robot rotation.
    by_variances: [Matrix6<f64>; 3],
    /// Covariance of the estimated variances: inverse of the expected information of the restricted likelihood.
    variances: Matrix3<f64>,
    /// Kenward and Roger's covariance, which counts what the estimated weights cost.
    pub inflated: Matrix6<f64>,
}

/// Adds the two orders of a product that is not symmetric itself.
fn symmetric(m: &DMatrix<f64>) -> DMatrix<f64> {
    (m + m.transpose()) * 0.5
}

impl Correction {
    /// `None` when the views determine neither answer nor noise levels.
    pub fn new(normals: &Normals, noise: &Noise, keep_all: bool) -> Option<Self> {
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
            let noisy = &own * DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(robot.as_slice()))
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
        // The corners' variance follows from V = θ0 V0 + θ1 V1 + θ2 V2.
        let rest = |whole: &DMatrix<f64>, one: &DMatrix<f64>, two: &DMatrix<f64>| {
            (whole - one * theta[1] - two * theta[2]) / theta[0]
        };
        let a0 = rest(&information, &a[0], &a[1]);
        let q0 = [rest(&a[0], &q[0][0], &q[1][0]), rest(&a[1], &q[0][1], &q[1][1])];
        let q00 = rest(&a0, &symmetric(&q0[0]), &symmetric(&q0[1]));
        let all_a = [a0, a[0].clone(), a[1].clone()];
        let all_q = |i: usize, j: usize| match (i, j) {
            (0, 0) => symmetric(&q00),
            (0, j) | (j, 0) => symmetric(&q0[j - 1]),
            (i, j) => symmetric(&q[i - 1][j - 1]),
        };
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
        let block = |m: &DMatrix<f64>| m.fixed_view::<6, 6>(0, 0).into_owned();
        let covariance: Matrix6<f64> = block(&phi);
        let by_variances = [0, 1, 2].map(|i: usize| block(&(&phi * &all_a[i] * &phi)));
        // A level at its lower end does not vary about its estimate: it counts as known.
        let inverse = scaled_inverse(&DMatrix::from_fn(6, 6, |i, j| covariance[(i, j)]))?;
        let matters = |i: &usize| {
            let share = theta[*i] * by_variances[*i].component_mul(&Matrix6::from_fn(|r, c| inverse[(r, c)])).sum() / L;
            keep_all || *i == 0 || share > NEGLIGIBLE
        };
        let inside: Vec<usize> = (0..3).filter(matters).collect();
        let count = inside.len();
        let of_inside = DMatrix::from_fn(count, count, |i, j| 0.5 * pairs[(inside[i], inside[j])]);
        let of_inside = scaled_inverse(&of_inside)?;
        let mut variances = Matrix3::zeros();
        for (i, &r) in inside.iter().enumerate() {
            for (j, &c) in inside.iter().enumerate() {
                variances[(r, c)] = of_inside[(i, j)];
            }
        }
        let mut cost = DMatrix::zeros(p, p);
        for i in 0..3 {
            for j in 0..3 {
                cost += (all_q(i, j) - &all_a[i] * &phi * &all_a[j]) * variances[(i, j)];
            }
        }
        let inflation: Matrix6<f64> = block(&(&phi * symmetric(&cost) * &phi)) * 2.0;
        Some(Self { covariance, by_variances, variances, inflated: covariance + inflation })
    }

    /// `2 m² / Var(m)` of a quantity that is linear in the covariance.
    fn satterthwaite(&self, of: impl Fn(&Matrix6<f64>) -> f64) -> f64 {
        let gradient = Vector3::from_fn(|i, _| of(&self.by_variances[i]));
        2.0 * of(&self.covariance).powi(2) / gradient.dot(&(self.variances * gradient))
    }

    /// Fai and Cornelius: degrees of freedom of the F region from those of the eigen-directions.
    pub fn by_directions(&self) -> f64 {
        let scale = self.covariance.diagonal().map(f64::sqrt);
        let correlation = Matrix6::from_fn(|i, j| self.covariance[(i, j)] / (scale[i] * scale[j]));
        let eigen = SymmetricEigen::new(correlation);
        let expected: f64 = (0..6)
            .map(|k| {
                // A direction of the scaled error, orthogonal to the others in the metric of the covariance.
                let direction = eigen.eigenvectors.column(k).component_div(&scale);
                let dof = self.satterthwaite(|m| direction.dot(&(m * direction)));
                if dof > 2.0 { dof / (dof - 2.0) } else { 0.0 }
            })
            .sum();
        if expected > L { 2.0 * expected / (expected - L) } else { f64::INFINITY }
    }

    /// Kenward and Roger: scale and degrees of freedom of the F region with the inflated covariance.
    pub fn kenward_roger(&self) -> Option<(f64, f64)> {
        let inverse = self.covariance.try_inverse()?;
        let relative = self.by_variances.map(|d| inverse * d);
        let (mut a1, mut a2) = (0.0, 0.0);
        for i in 0..3 {
            for j in 0..3 {
                a1 += self.variances[(i, j)] * relative[i].trace() * relative[j].trace();
                a2 += self.variances[(i, j)] * (relative[i] * relative[j]).trace();
            }
        }
        let b = (a1 + 6.0 * a2) / (2.0 * L);
        let g = ((L + 1.0) * a1 - (L + 4.0) * a2) / ((L + 2.0) * a2);
        let below = 3.0 * L + 2.0 * (1.0 - g);
        let (c1, c2, c3) = (g / below, (L - g) / below, (L + 2.0 - g) / below);
        let mean = 1.0 / (1.0 - a2 / L);
        let variance = 2.0 / L * (1.0 + c1 * b) / ((1.0 - c2 * b).powi(2) * (1.0 - c3 * b));
        let rho = variance / (2.0 * mean * mean);
        let dof = 4.0 + (L + 2.0) / (L * rho - 1.0);
        if a2 * MANY < 1.0 {
            return Some((1.0, f64::INFINITY));
        }
        (mean > 0.0 && dof > 2.0).then(|| (dof / (mean * (dof - 2.0)), dof))
    }

    /// Satterthwaite's degrees of freedom of the trace of a point's covariance.
    pub fn tip_degrees_of_freedom(&self, point: &Point3<f64>) -> f64 {
        self.satterthwaite(|m| point_covariance(m, point).trace())
    }

    /// Covariance of the estimated variances relative to themselves.
    pub fn relative_covariance(&self, noise: &Noise) -> Matrix3<f64> {
        let theta = [noise.corner_px, noise.robot_m, noise.robot_rad].map(|level| level.powi(2));
        Matrix3::from_fn(|k, l| self.variances[(k, l)] / (theta[k] * theta[l]))
    }

    /// Relative standard deviations of the estimated noise levels; infinite for one that is zero.
    pub fn level_scatter(&self, noise: &Noise) -> [f64; 3] {
        let relative = self.relative_covariance(noise);
        std::array::from_fn(|k| 0.5 * relative[(k, k)].sqrt())
    }
}

fn point_covariance(hand_eye: &Matrix6<f64>, point: &Point3<f64>) -> Matrix3<f64> {
    let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
    by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&-point.coords.cross_matrix());
    by_pose * hand_eye * by_pose.transpose()
}

/// With which probability an error of a point is shorter than a length, when the scale of its covariance rests on so many
/// degrees of freedom: along a direction `u` the squared length is `uᵀ C u` times `3 F(3, dof)`, averaged over directions.
pub fn tip_probability(hand_eye: &Matrix6<f64>, dof: f64, point: &Point3<f64>, length_m: f64) -> Option<f64> {
    const NODES: usize = 24;
    let scale = FisherSnedecor::new(3.0, dof.clamp(1.0, MANY)).ok()?;
    let variances = point_covariance(hand_eye, point).symmetric_eigenvalues();
    let floor = 1e-9 * variances.max();
    let mut sum = 0.0;
    for i in 0..NODES {
        let z = (i as f64 + 0.5) / NODES as f64;
        for j in 0..NODES {
            let azimuth = (j as f64 + 0.5) / NODES as f64 * std::f64::consts::FRAC_PI_2;
            let r2 = 1.0 - z * z;
            let squares = Vector3::new(r2 * azimuth.cos().powi(2), r2 * azimuth.sin().powi(2), z * z);
            sum += scale.cdf(length_m * length_m / (3.0 * squares.dot(&variances).max(floor)));
        }
    }
    Some(sum / (NODES * NODES) as f64)
}
