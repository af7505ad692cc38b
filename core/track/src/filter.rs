//! A Kalman filter for a rigid body whose velocity is constant except for white noise in its acceleration.
//!
//! The state is the board's centre `p`, its orientation `R` (`base_from_target`), its velocity `v` and its angular
//! velocity `ω`, all in base axes; the covariance is that of the error `[δp δθ δv δω]` with `p + δp`, `Exp(δθ) R`,
//! `v + δv`, `ω + δω`. The centre, and not the origin, because there the errors of place and of turn are nearly
//! independent, and because a board that turns on the spot has no velocity there.
//!
//! Reference: Solà 2017, "Quaternion kinematics for the error-state Kalman filter" (errors in the global frame);
//! Bar-Shalom, Li & Kirubarajan 2001, "Estimation with applications to tracking and navigation", 6.2 (exact
//! discretisation).

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, SMatrix, Translation3, UnitQuaternion, Vector3, Vector6};

use super::{Estimate, MotionModel};
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::se3;

/// Errors that a sight may have: 99.99 % of chi-square with six degrees of freedom. At 30 images a second one true sight
/// in five minutes is refused.
const GATE: f64 = 27.86;
/// Standard deviation of a board's velocity [m/s] and angular velocity [rad/s] before any motion is seen: a brisk hand.
const START_SIGMA: (f64, f64) = (0.5, 2.0);
/// Steps of prediction turn by no more than this [rad]: within them the noise of the turn is taken as not turning
/// itself, with an error of the square of a third of it.
const STEP_RAD: f64 = 0.1;
/// Most steps of prediction; only an unreasonable time or spin needs more.
const MAX_STEPS: f64 = 1000.0;

type Matrix12 = SMatrix<f64, 12, 12>;

/// A board located by one image.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoardPose {
    centre: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    /// Covariance of `[δp δθ]`.
    covariance: Matrix6<f64>,
}

impl BoardPose {
    /// `covariance` is of the right perturbation `[t; r]`, `centre` the board's middle in the target frame.
    pub fn new(base_from_target: &Pose<Base, Target>, covariance: &Matrix6<f64>, centre: &Point3<f64>) -> Self {
        let rotation = base_from_target.rotation();
        let r = rotation.to_rotation_matrix().into_inner();
        // δp = R (ρ − [c]× φ), δθ = R φ.
        let mut by_perturbation = Matrix6::zeros();
        by_perturbation.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
        by_perturbation.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-r * se3::skew(&centre.coords)));
        by_perturbation.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
        Self {
            centre: (base_from_target.isometry() * centre).coords,
            rotation,
            covariance: by_perturbation * covariance * by_perturbation.transpose(),
        }
    }
}

/// The state and how sure it is.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    motion: MotionModel,
    /// The board's middle in the target frame.
    centre_in_target: Point3<f64>,
    time_s: f64,
    centre: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    covariance: Matrix12,
}

impl Filter {
    /// Starts with one sight, at rest as far as anyone knows.
    pub fn new(motion: MotionModel, centre_in_target: Point3<f64>, time_s: f64, sight: &BoardPose) -> Self {
        let mut covariance = Matrix12::zeros();
        covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(&sight.covariance);
        for i in 0..3 {
            covariance[(6 + i, 6 + i)] = START_SIGMA.0.powi(2);
            covariance[(9 + i, 9 + i)] = START_SIGMA.1.powi(2);
        }
        Self {
            motion,
            centre_in_target,
            time_s,
            centre: sight.centre,
            rotation: sight.rotation,
            velocity: Vector3::zeros(),
            spin: Vector3::zeros(),
            covariance,
        }
    }

    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Goes on to `time_s`; a time in the past changes nothing.
    pub fn predict(&mut self, time_s: f64) {
        let whole = time_s - self.time_s;
        if whole.is_nan() || whole <= 0.0 {
            return;
        }
        let steps = (self.spin.norm() * whole / STEP_RAD).ceil().clamp(1.0, MAX_STEPS);
        for _ in 0..steps as usize {
            self.step(whole / steps);
        }
        self.time_s = time_s;
    }

    fn step(&mut self, dt: f64) {
        let turned = self.spin * dt;
        let turn = UnitQuaternion::from_scaled_axis(turned);
        let mut transition = Matrix12::identity();
        transition.fixed_view_mut::<3, 3>(0, 6).copy_from(&(Matrix3::identity() * dt));
        transition.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.to_rotation_matrix().matrix());
        transition.fixed_view_mut::<3, 3>(3, 9).copy_from(&(se3::left_jacobian(&turned) * dt));
        let mut covariance = transition * self.covariance * transition.transpose();
        for i in 0..6 {
            let density = if i < 3 { self.motion.acceleration } else { self.motion.angular_acceleration };
            let q = density * density;
            covariance[(i, i)] += q * dt.powi(3) / 3.0;
            covariance[(i, i + 6)] += q * dt * dt / 2.0;
            covariance[(i + 6, i)] += q * dt * dt / 2.0;
            covariance[(i + 6, i + 6)] += q * dt;
        }
        self.covariance = symmetric(&covariance);
        self.centre += self.velocity * dt;
        self.rotation = turn * self.rotation;
        self.rotation.renormalize();
    }

    /// The innovation: `sight` at the filter's time minus the prediction, and the covariance of that difference.
    fn innovation(&self, sight: &BoardPose) -> (Vector6<f64>, Matrix6<f64>) {
        let turn = se3::rotation_vector(&(sight.rotation * self.rotation.inverse()));
        let shift = sight.centre - self.centre;
        let difference = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
        (difference, self.covariance.fixed_view::<6, 6>(0, 0) + sight.covariance)
    }

    /// Squared Mahalanobis distance of a sight from what is expected; `None` when it cannot be computed.
    pub fn distance_squared(&self, sight: &BoardPose) -> Option<f64> {
        let (difference, covariance) = self.innovation(sight);
        let squared = difference.dot(&covariance.cholesky()?.solve(&difference));
        squared.is_finite().then_some(squared)
    }

    /// Takes a sight of the filter's time in, if it can be one of the board; `false` and no change otherwise.
    pub fn update(&mut self, sight: &BoardPose) -> bool {
        if !self.distance_squared(sight).is_some_and(|squared| squared <= GATE) {
            return false;
        }
        let (difference, covariance) = self.innovation(sight);
        let Some(inverse) = covariance.cholesky().map(|c| c.inverse()) else { return false };
        let gain: SMatrix<f64, 12, 6> = self.covariance.fixed_view::<12, 6>(0, 0) * inverse;
        let correction = gain * difference;
        let mut kept = Matrix12::identity();
        for row in 0..12 {
            for column in 0..6 {
                kept[(row, column)] -= gain[(row, column)];
            }
        }
        // Joseph's form stays positive definite whatever the rounding.
        let joseph = kept * self.covariance * kept.transpose() + gain * sight.covariance * gain.transpose();
        self.covariance = symmetric(&joseph);
        self.centre += correction.fixed_rows::<3>(0);
        self.rotation = UnitQuaternion::from_scaled_axis(correction.fixed_rows::<3>(3).into_owned()) * self.rotation;
        self.rotation.renormalize();
        self.velocity += correction.fixed_rows::<3>(6);
        self.spin += correction.fixed_rows::<3>(9);
        true
    }

    pub fn base_from_target(&self) -> Pose<Base, Target> {
        let origin = self.centre - self.rotation * self.centre_in_target.coords;
        Pose::from_isometry(Isometry3::from_parts(Translation3::from(origin), self.rotation))
    }

    /// Largest standard deviations over all directions: of the centre \[m\] and of the turn \[rad\].
    pub fn sigmas(&self) -> (f64, f64) {
        let largest = |at: usize| {
            let block: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(at, at).into_owned();
            block.symmetric_eigenvalues().max().max(0.0).sqrt()
        };
        (largest(0), largest(3))
    }

    pub fn estimate(&self) -> Estimate {
        let r = self.rotation.to_rotation_matrix().into_inner();
        let to_centre = self.rotation * self.centre_in_target.coords;
        // ρ = Rᵀ (δp + [R c]× δθ), φ = Rᵀ δθ.
        let mut by_error = Matrix6::zeros();
        by_error.fixed_view_mut::<3, 3>(0, 0).copy_from(&r.transpose());
        by_error.fixed_view_mut::<3, 3>(0, 3).copy_from(&(r.transpose() * se3::skew(&to_centre)));
        by_error.fixed_view_mut::<3, 3>(3, 3).copy_from(&r.transpose());
        let covariance = by_error * self.covariance.fixed_view::<6, 6>(0, 0) * by_error.transpose();
        Estimate {
            time_s: self.time_s,
            base_from_target: self.base_from_target(),
            covariance: 0.5 * (covariance + covariance.transpose()),
            velocity_m_s: self.velocity - self.spin.cross(&to_centre),
            angular_velocity_rad_s: self.spin,
        }
    }
}

fn symmetric(m: &Matrix12) -> Matrix12 {
    0.5 * (m + m.transpose())
}

#[cfg(test)]
#[path = "filter_tests.rs"]
mod tests;
