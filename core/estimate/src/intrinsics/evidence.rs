//! What the single views show of lens and bend: how certain an estimate is, and how far a bend that it leaves out would
//! move it.
//!
//! At an optimum view `v` has, its own pose eliminated, the information `A_v` and the gradient `g_v` of the form, lens and
//! bend. With `C = (Σ A_v)⁻¹` the form would still move by `b = −C Σ g_v`: zero in what was estimated, and in a bend that
//! was not by what the corners show of it. There the views pull the chosen unknowns `X` by
//!
//! ```text
//! z_v = (C (g_v + A_v b))_X,     E z_v z_vᵀ = σ² (C A_v C − C A_v C A_v C)_XX
//! ```
//!
//! if the errors of all corners are independent. Those of one view are not: what warps an image or smears a print moves
//! neighbours equally. Only the views are assumed independent, and the covariance `σ² C_XX` is multiplied by the
//! `Σ z_vᵀ C_XX⁻¹ z_v` that is seen over the one expected.
//!
//! # Reference
//! Liang & Zeger 1986, "Longitudinal data analysis using generalized linear models" (the sum over independent groups); Bell
//! & McCaffrey 2002, "Bias reduction in standard errors for linear regression with multi-stage samples" (leverage,
//! degrees of freedom); Rao 1948 (a parameter judged without a fit that has it).

use std::borrow::Borrow;

use nalgebra::{DMatrix, DVector, Vector2};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::IntrinsicsError;
use super::adjust::{Estimate, Problem, seen};
use super::information::inverse;
use crate::bend::Deflection;
use crate::handeye::joint::pose_part::split;
use handeye_geometry::planar_pose::PoseError;
use handeye_geometry::statistics::median;
use handeye_geometry::view_equations::{FreeParameters, PoseEquations};

/// Deflection of a board before any corner is seen, one standard deviation, as a part of its longer side: the most bent one
/// that we met, on purpose, has a 42nd. It has no effect where corners have any information, and keeps the effect of a bend
/// that no oblique view shows finite.
const USUAL_BEND: f64 = 0.02;
/// Share of the errors that an interval is to hold.
const HELD: f64 = 0.95;
/// Half the width of that interval of a Gaussian, in standard deviations.
const GAUSSIAN: f64 = 1.959_963_985;

/// The part of one view in the equations of the form.
pub(crate) struct Score {
    pub information: DMatrix<f64>,
    pub gradient: DVector<f64>,
}

/// Overdispersion of the views: how much more they scatter than with independent corner errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scatter {
    /// Variance shown over variance expected.
    pub ratio: f64,
    /// Degrees of freedom of that, at least 1.
    pub degrees_of_freedom: f64,
}

/// All views at one estimate.
pub(super) struct Evidence {
    scores: Vec<Score>,
    /// Information of the views on the form, for residuals of standard deviation 1.
    pub information: DMatrix<f64>,
    /// `Σ ‖W r‖²`
    pub cost: f64,
    /// `C`
    covariance: DMatrix<f64>,
    /// `b`
    step: DVector<f64>,
    /// `σ²`; NaN where there are no more residuals than unknowns.
    variance: f64,
}

/// How well some unknowns are known.
pub(super) struct Spread {
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Factor by which the errors that corners of a view share made it larger than independent ones.
    pub ratio: f64,
    /// Degrees of freedom of that ratio.
    pub degrees_of_freedom: f64,
}

impl Evidence {
    /// Linearises all views with these columns of the form. A bend among them that the estimate leaves out gets the prior
    /// of a usual one.
    pub fn new(problem: &Problem<'_>, estimate: &Estimate, columns: FreeParameters) -> Result<Self, IntrinsicsError> {
        let n = columns.count(&estimate.intrinsics);
        let mut scores = Vec::with_capacity(problem.views.len());
        let (mut information, mut gradient, mut cost) = (DMatrix::zeros(n, n), DVector::zeros(n), 0.0);
        for (index, (view, pose)) in problem.views.iter().zip(&estimate.poses).enumerate() {
            problem.check_cancel()?;
            let seen = seen(view, problem.board, &estimate.shape, &estimate.intrinsics);
            let behind = |_| IntrinsicsError::NotACamera { reason: "a corner is not in front of it" };
            let equations = PoseEquations::new(&seen, pose, columns).map_err(behind)?;
            cost += equations.squared_px;
            let (_, rest) = split(&equations).ok_or(PoseError::CollinearCorners { view: index })?;
            let score = Score { information: rest.form, gradient: rest.gradient };
            information += &score.information;
            gradient += &score.gradient;
            scores.push(score);
        }
        let corners: usize = problem.views.iter().map(|view| view.corners.len()).sum();
        // Four corners a view can leave no more equations than unknowns; then the noise is unknown.
        let freedom = (2 * corners).saturating_sub(n + 6 * problem.views.len());
        let over_freedom = |cost: f64| if freedom > 0 { cost.max(0.0) / freedom as f64 } else { f64::NAN };
        let mut known = information.clone();
        if columns.warp && !problem.free.warp {
            let usual_m = USUAL_BEND * problem.board.longer_side_m();
            let at = columns.warp_at(&estimate.intrinsics);
            for i in at..at + 2 {
                known[(i, i)] += over_freedom(cost).max(0.0) / usual_m.powi(2);
            }
        }
        let covariance = inverse(&known)?;
        let step = -(&covariance * &gradient);
        let variance = over_freedom(cost + gradient.dot(&step));
        Ok(Self { scores, information, cost, covariance, step, variance })
    }

    /// Standard deviation of a whitened residual per axis.
    pub fn sigma(&self) -> f64 {
        self.variance.sqrt()
    }

    /// How well `count` unknowns from the column `first` on are known.
    pub fn spread(&self, first: usize, count: usize) -> Spread {
        let stated = self.covariance.view((first, first), (count, count)).into_owned();
        let found = scatter(&self.scores, &self.covariance, &self.step, (first, count)).and_then(|found| {
            let ratio = found.ratio / self.variance;
            // Corners without any noise leave rounding over rounding.
            (ratio.is_finite() && ratio > 0.0).then_some(Scatter { ratio, ..found })
        });
        let Scatter { ratio, degrees_of_freedom } = found.unwrap_or(Scatter { ratio: 1.0, degrees_of_freedom: 1.0 });
        Spread { covariance: stated * (self.variance * ratio), ratio, degrees_of_freedom }
    }

    /// The bend that the target would get from the estimate's shape, and how well that is known.
    pub fn deflection(&self, problem: &Problem<'_>, estimate: &Estimate) -> Deflection {
        let warp_at = estimate.intrinsics.parameter_count();
        let spread = self.spread(warp_at, 2);
        let middle = problem.board.middle();
        let distance_m = median(estimate.poses.iter().map(|pose| (pose * middle).coords.norm())).unwrap_or(0.0);
        Deflection {
            warp_m: Vector2::new(self.step[warp_at], self.step[warp_at + 1]) + Vector2::from(estimate.shape.warp_m),
            covariance: spread.covariance.fixed_view::<2, 2>(0, 0).into_owned(),
            degrees_of_freedom: spread.degrees_of_freedom,
            noise_m: self.sigma() * distance_m / estimate.intrinsics.fx,
        }
    }

    /// How far a bend that was left out would move the form in column `i`.
    pub fn left_out(&self, i: usize) -> f64 {
        self.step[i]
    }
}

/// How views scatter in `count` unknowns from the column `first` on, for corners of variance 1: `covariance` is `C` and `step`
/// is `b`. `None` where the unknowns are not determined.
pub(crate) fn scatter(
    scores: impl IntoIterator<Item: Borrow<Score>>,
    covariance: &DMatrix<f64>,
    step: &DVector<f64>,
    (first, count): (usize, usize),
) -> Option<Scatter> {
    let stated = covariance.view((first, first), (count, count)).into_owned();
    let root = stated.cholesky()?.l();
    let whitened = root.solve_lower_triangular(&covariance.rows(first, count).into_owned())?;
    // The trace of the expected covariance of all pulls together, and that of its square, for Satterthwaite's degrees of
    // freedom: two views are correlated because the form was fitted to both.
    let (mut shown, mut expected, mut squared) = (0.0, 0.0, 0.0);
    let mut taken = DMatrix::zeros(step.len(), step.len());
    for score in scores {
        let score: &Score = score.borrow();
        let by_view = &whitened * &score.information;
        let alone = &by_view * whitened.transpose();
        let leverage = &by_view * covariance * by_view.transpose();
        shown += (&whitened * &score.gradient + &by_view * step).norm_squared();
        expected += alone.trace() - leverage.trace();
        squared += alone.norm_squared() - 2.0 * alone.dot(&leverage);
        taken += by_view.tr_mul(&by_view);
    }
    let taken = covariance * taken;
    squared += (&taken * &taken).trace();
    let ratio = shown / expected;
    (ratio.is_finite() && squared > 0.0)
        .then(|| Scatter { ratio, degrees_of_freedom: (expected.powi(2) / squared).max(1.0) })
}

impl Spread {
    /// The standard deviation of the unknown `i` of which a Gaussian's 95 % interval holds its error in 95 % of cases: that
    /// of few degrees of freedom is wider.
    pub fn sigma(&self, i: usize) -> f64 {
        self.times() * self.covariance[(i, i)].sqrt()
    }

    /// The same for a sum of the unknowns, each with its factor in `times`.
    pub fn sigma_along(&self, times: &[f64]) -> f64 {
        let along = DVector::from_column_slice(times);
        self.times() * along.dot(&(&self.covariance * &along)).max(0.0).sqrt()
    }

    /// Half the width of an interval with these few degrees of freedom over that of a Gaussian.
    fn times(&self) -> f64 {
        StudentsT::new(0.0, 1.0, self.degrees_of_freedom)
            .map_or(1.0, |student| student.inverse_cdf(0.5 + 0.5 * HELD) / GAUSSIAN)
    }
}
