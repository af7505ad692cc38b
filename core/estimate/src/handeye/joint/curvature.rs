//! What the covariance at the optimum leaves out when the cost is not quadratic.
//!
//! With a free lens and few views the lens trades against place and orientation of the camera, and how well it is known
//! depends on its values: a small distortion that is estimated as a wavy one seems to determine the principal point. Two
//! effects of second order make the covariance too small:
//!
//! - The covariance is taken at the estimate, not at the true values. By a Taylor series its mean is off by `½ Σ ∂²C / ∂u_k²` over
//!   directions `u_k` of lens and target that are one standard deviation long; that much is subtracted.
//! - Along each principal axis of the error at a point the point is moved, all other unknowns follow to their optimum (the
//!   profile of the likelihood), and where minus twice its log has risen by the 95 % quantile of chi-square with one degree
//!   of freedom is the true end of the interval. The covariance is stretched along the axis to the farther of both ends.
//!
//! Both only make the covariance larger.
//!
//! # Reference
//! Bates & Watts 1988, "Nonlinear regression analysis and its applications", §6.1 (profile t); Venzon & Moolgavkar 1988,
//! "A method for computing profile-likelihood-based confidence intervals", Applied Statistics 37, 87–94.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Point3, Vector6};

use super::normal::{Reduced, System};
use super::state::State;
use super::view_block::Layout;
use super::{JointProblem, Noise};
use crate::handeye::{HandEyeError, determined};
use handeye_geometry::point_error;
use handeye_geometry::se3;

/// Views above which the cost is quadratic for practical purposes: with 0.3 px the two effects add a third to the variance
/// at ten views, a fifth at twenty and a twentieth at forty.
const MANY_VIEWS: usize = 40;
/// Standard deviations of the lens over which second differences are taken: what they leave of the fourth derivative counts a
/// twelfth of the square of it, a fiftieth.
const DIFFERENCE: f64 = 0.5;
/// The covariance is at most doubled because of the place where it is taken; a series that requires more does not hold.
const MOST_ADDED: f64 = 1.0;
/// 95 % quantile of chi-square with one degree of freedom.
const RISE: f64 = 3.841_459;
/// Axes of less than this part of the longest one's variance do not count: by the quadratic cost the error would be a
/// fortieth shorter without such an axis.
const SHORT: f64 = 0.05;
/// Gauss–Newton steps at one place, and the step in standard deviations that ends them.
const STEPS: usize = 6;
const SMALL: f64 = 1e-2;
/// Places that are tried on each side, and the part of the rise that is near enough.
const PLACES: usize = 3;
const NEAR: f64 = 0.05;
/// Farthest end in terms of that of the quadratic cost: a cost that has not risen there has no end that an ellipse
/// could state.
const FARTHEST: f64 = 4.0;

/// An optimum and the covariance of the shared unknowns there.
pub struct Optimum<'a> {
    pub problem: &'a JointProblem<'a>,
    pub state: &'a State,
    pub system: &'a System,
    pub noise: &'a Noise,
    pub reduced: &'a Reduced,
    pub covariance: &'a DMatrix<f64>,
}

impl Optimum<'_> {
    /// Makes a covariance of the shared unknowns, which noise levels may have made larger than that of the optimum, larger
    /// by as much as the shape of the cost requires. The axes are those of the error at `point`, camera coordinates.
    ///
    /// # Errors
    /// [`HandEyeError::Cancelled`].
    pub fn widened(&self, covariance: DMatrix<f64>, point: &Point3<f64>) -> Result<DMatrix<f64>, HandEyeError> {
        if !self.problem.free.intrinsics || self.problem.views.len() > MANY_VIEWS {
            return Ok(covariance);
        }
        let covariance = match self.off_by_place()? {
            Some(off) => enlarged(covariance, &-off),
            None => covariance,
        };
        self.stretched(covariance, point)
    }

    /// Difference of the mean covariance at an estimate from that at the true values; `None` where the series has no terms.
    fn off_by_place(&self) -> Result<Option<DMatrix<f64>>, HandEyeError> {
        let form = self.system.layout.form;
        let lens = self.covariance.view((Layout::FORM_AT, Layout::FORM_AT), (form, form)).into_owned();
        let Some(root) = Cholesky::new(lens).map(|factor| factor.l()) else { return Ok(None) };
        // All unknowns follow the lens as the covariance determines.
        let Some(inverse) = root.clone().try_inverse() else { return Ok(None) };
        let directions = self.covariance.columns(Layout::FORM_AT, form) * inverse.transpose();
        let at_rest = self.reduced.own_steps(&DVector::zeros(self.covariance.nrows()));
        let mut sum = DMatrix::zeros(self.covariance.nrows(), self.covariance.ncols());
        for direction in directions.column_iter() {
            for sign in [-DIFFERENCE, DIFFERENCE] {
                let step: DVector<f64> = direction * sign;
                let own = self
                    .reduced
                    .own_steps(&step)
                    .iter()
                    .zip(&at_rest)
                    .map(|(own, rest)| own - rest)
                    .collect::<Vec<_>>();
                let Some(system) = self.linearised(&self.state.stepped(self.problem, &step, &own))? else {
                    return Ok(None);
                };
                let Ok(reduced) = system.reduce(self.noise) else { return Ok(None) };
                sum += reduced.inverse() - self.covariance;
            }
        }
        Ok(Some(sum * (0.5 / DIFFERENCE.powi(2))))
    }

    /// Stretches a covariance to the ends of the profile along the axes of the error at a point.
    fn stretched(&self, mut covariance: DMatrix<f64>, point: &Point3<f64>) -> Result<DMatrix<f64>, HandEyeError> {
        let hand_eye: Matrix6<f64> = self.covariance.fixed_view::<6, 6>(0, 0).into_owned();
        let axes = point_error::covariance(&hand_eye, point).symmetric_eigen();
        let by_hand_eye = point_error::by_hand_eye(point);
        let longest = axes.eigenvalues.max();
        for (axis, variance) in axes.eigenvectors.column_iter().zip(&axes.eigenvalues) {
            if *variance <= SHORT * longest {
                continue;
            }
            let along: Vector6<f64> = by_hand_eye.tr_mul(&axis);
            let reach = RISE.sqrt() * variance.sqrt();
            let farthest = self.end(&along, -reach)?.max(self.end(&along, reach)?).max(1.0);
            let follows = covariance.columns(0, 6) * along;
            let follows = &follows / along.dot(&follows.rows(0, 6)).sqrt();
            covariance += &follows * follows.transpose() * (farthest.powi(2) - 1.0);
        }
        Ok(covariance)
    }

    /// Where the cost has risen by the quantile, over the `reach` at which a quadratic cost would have; `reach` has the
    /// sign of the side.
    fn end(&self, along: &Vector6<f64>, reach: f64) -> Result<f64, HandEyeError> {
        let (mut inside, mut outside) = (0.0, 2.0 * FARTHEST);
        let mut place = 1.0;
        for _ in 0..PLACES {
            let Some(rise) = self.rise(along, place * reach)? else { break };
            if (rise / RISE - 1.0).abs() < NEAR {
                break;
            }
            if rise < RISE {
                inside = place;
            } else {
                outside = place;
            }
            let by_parabola = place * (RISE / rise.max(f64::MIN_POSITIVE)).sqrt();
            let between = by_parabola > inside && by_parabola < outside;
            place = if between { by_parabola } else { 0.5 * (inside + outside) }.min(FARTHEST);
        }
        Ok(place)
    }

    /// By how much the cost rises when the hand-eye transform moves this far along a direction and all else follows;
    /// `None` where there is no optimum.
    fn rise(&self, along: &Vector6<f64>, wanted: f64) -> Result<Option<f64>, HandEyeError> {
        let start = self.state.mount_from_camera.isometry().inverse();
        let bottom = self.system.cost(self.noise);
        let mut direction = DVector::zeros(self.covariance.nrows());
        direction.rows_mut(0, 6).copy_from(along);
        let mut state = self.state.clone();
        let mut moved_on: Option<(System, Reduced)> = None;
        for _ in 0..STEPS {
            let (system, reduced) =
                moved_on.as_ref().map_or((self.system, self.reduced), |(system, reduced)| (system, reduced));
            let moved = along.dot(&se3::log(&(start * state.mount_from_camera.isometry())));
            let free = reduced.shared_step();
            let follows = reduced.solve(&direction);
            let left = wanted - moved - direction.dot(&free);
            let step = &free + &follows * (left / direction.dot(&follows));
            if reduced.length(&step) < SMALL {
                // This near, the cost is quadratic: least at the free step, and all corrections follow.
                let least = system.cost(self.noise) - reduced.decrease();
                return Ok(Some(least + reduced.length(&(&step - &free)).powi(2) - bottom));
            }
            state = state.stepped(self.problem, &step, &reduced.own_steps(&step));
            let Some(system) = self.linearised(&state)? else { return Ok(None) };
            let Ok(reduced) = system.reduce(self.noise) else { return Ok(None) };
            moved_on = Some((system, reduced));
        }
        Ok(moved_on.map(|(system, _)| system.cost(self.noise) - bottom))
    }

    fn linearised(&self, state: &State) -> Result<Option<System>, HandEyeError> {
        determined(System::new(self.problem, state, &self.system.cancel))
    }
}

/// The covariance plus the part of an addition that makes it larger.
fn enlarged(covariance: DMatrix<f64>, addition: &DMatrix<f64>) -> DMatrix<f64> {
    let Some(root) = Cholesky::new(covariance.clone()).map(|f| f.l()) else { return covariance };
    // In units of the covariance itself, where eigenvalues can be compared.
    let Some(left) = root.solve_lower_triangular(addition) else { return covariance };
    let Some(relative) = root.solve_lower_triangular(&left.transpose()) else { return covariance };
    let eigen = (0.5 * (&relative + relative.transpose())).symmetric_eigen();
    let added = eigen.eigenvalues.map(|v| v.clamp(0.0, MOST_ADDED));
    let grown = &root * &eigen.eigenvectors;
    &covariance + &grown * DMatrix::from_diagonal(&added) * grown.transpose()
}

#[cfg(test)]
#[path = "curvature_tests.rs"]
mod tests;
