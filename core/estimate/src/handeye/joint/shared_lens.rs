//! One lens for several sessions: the information of each on it, and rounds until all agree.
//!
//! The sessions of one camera have nothing in common but the lens `ℓ`. With everything else of session `j` at its best the
//! cost of that session is a function of the lens alone, `P_j(ℓ)`, and the joint optimum has the least sum of these. To
//! second order about the lens `ℓ_j` of a fit, `P_j` has the gradient `2 g_j` and the curvature `2 I_j`, where `I_j` is what
//! remains of the session's normal matrix when all but the lens is eliminated from it. So the other sessions are a Gaussian
//! prior of the lens, and every session is estimated as if alone, with that prior ([`LensPrior`]).
//!
//! Where the rounds have converged all sessions have the same lens, and it is that of the joint optimum, exactly: session
//! `i` ends where `g_i + Σ_{j≠i} [g_j + I_j (ℓ_i − ℓ_j)] = 0`. For all `i` that is the same linear equation, of which the
//! matrix `Σ I_j` is regular; so all `ℓ_i` are equal, and `Σ g_j = 0` there. The covariance of a session with the prior is
//! its block of the inverse of the joint normal matrix.
//!
//! Source: Triggs et al. 2000, "Bundle adjustment — a modern synthesis", §6 (Schur complement and reduced systems);
//! `docs/maths/shared_intrinsics.md`.

use nalgebra::{DMatrix, DVector};

use super::normal::{System, covariance_of};
use super::state::State;
use super::view_block::Layout;
use super::{JointProblem, JointSolution, LensPrior};
use crate::handeye::HandEyeError;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::progress::CancelToken;

/// Name of the method in errors.
const METHOD: &str = "the shared lens";
/// Most rounds; a handful is usual.
const MAX_ROUNDS: usize = 30;
/// Change of the lens of all sessions in a round, in its standard deviations, below which it has converged: noise levels
/// converge to a thousandth, too.
const TOLERANCE: f64 = 1e-3;

/// The information of the fit of one session on its lens: its least cost as a function of the lens, to second order.
#[derive(Debug, Clone)]
pub struct LensInformation {
    /// The lens of the fit.
    at: Intrinsics,
    /// Half the gradient of the cost by [`Intrinsics::parameters`] there.
    gradient: DVector<f64>,
    /// Half the second derivative of the cost.
    information: DMatrix<f64>,
}

impl LensInformation {
    /// The information of a solution of `problem`, without that of the prior of its lens.
    ///
    /// # Errors
    /// [`HandEyeError::NoSolution`] when the lens is not estimated or not determined, [`HandEyeError::Cancelled`].
    pub fn of(
        problem: &JointProblem<'_>,
        solution: &JointSolution,
        cancel: &CancelToken,
    ) -> Result<Self, HandEyeError> {
        let fails = |reason| HandEyeError::NoSolution { method: METHOD, views: problem.views.len(), reason };
        if !problem.free.intrinsics {
            return Err(fails("the lens is given, and not estimated"));
        }
        let state = State::of(solution);
        let reduced = |problem: &JointProblem<'_>| System::new(problem, &state, cancel)?.reduce(&solution.noise);
        // Subtracting a strong prior would leave only rounding where the session alone has little information.
        let (reduced, prior) = match reduced(&JointProblem { lens_prior: None, ..*problem }) {
            Ok(by_itself) => (by_itself, None),
            Err(HandEyeError::Cancelled) => return Err(HandEyeError::Cancelled),
            Err(_) => (reduced(problem)?, problem.lens_prior),
        };
        let count = solution.intrinsics.parameter_count();
        let at = Layout::FORM_AT;
        let covariance = reduced.inverse().view((at, at), (count, count)).into_owned();
        let mut information = covariance_of(&covariance).ok_or_else(|| fails("the lens is not determined"))?;
        let mut gradient = -(&information * reduced.shared_step().rows(at, count));
        if let Some(prior) = prior {
            gradient -= prior.information * difference(&solution.intrinsics, &prior.expected);
            information -= prior.information;
        }
        Ok(Self { at: solution.intrinsics, gradient, information })
    }

    /// The information of a single solution, by its covariance; `None` when the lens is not determined.
    pub fn stated(solution: &JointSolution) -> Option<Self> {
        let (at, count) = (Layout::FORM_AT, solution.intrinsics.parameter_count());
        let information = covariance_of(&solution.covariance.view((at, at), (count, count)).into_owned())?;
        Some(Self { at: solution.intrinsics, gradient: DVector::zeros(count), information })
    }

    /// The same from a session in which something else makes the lens more uncertain: its covariance `I⁻¹` grows by
    /// `I⁻¹ G I⁻¹`. `None` where the lens is not determined.
    #[must_use]
    pub fn less(self, unknown: &DMatrix<f64>) -> Option<Self> {
        let covariance = covariance_of(&self.information)?;
        let information = covariance_of(&(&covariance + &covariance * unknown * &covariance))?;
        // The step to the optimum is the same.
        let gradient = &information * (&covariance * &self.gradient);
        Some(Self { gradient, information, ..self })
    }

    /// The same from a session whose variances are all this many times as large.
    #[must_use]
    pub fn widened(mut self, factor: f64) -> Self {
        self.gradient /= factor;
        self.information /= factor;
        self
    }
}

/// A lens and how well it is known.
#[derive(Debug, Clone)]
pub struct LensEstimate {
    /// The lens.
    pub intrinsics: Intrinsics,
    /// Inverse of the covariance of [`Intrinsics::parameters`].
    pub information: DMatrix<f64>,
}

impl LensEstimate {
    /// The lens by the information of several sessions together: the one with the least sum of their costs, to second
    /// order. `None` when they leave it undetermined, as no sessions do.
    pub fn by<'a>(all: impl IntoIterator<Item = &'a LensInformation>) -> Option<Self> {
        let mut all = all.into_iter();
        let LensInformation { at, mut gradient, mut information } = all.next()?.clone();
        for other in all {
            gradient += &other.gradient + &other.information * difference(&at, &other.at);
            information += &other.information;
        }
        let step = covariance_of(&information)? * -gradient;
        let parameters: Vec<f64> = at.parameters().iter().zip(&step).map(|(p, step)| p + step).collect();
        Some(Self { intrinsics: at.with_parameters(&parameters), information })
    }

    /// This estimate as a prior for another session.
    pub fn as_prior(&self) -> LensPrior<'_> {
        LensPrior { expected: self.intrinsics, information: &self.information }
    }

    /// The same for a session that itself is to count for less by that factor: its costs over `factor` with the prior,
    /// or its costs with the prior times `factor`, have the same optimum.
    #[must_use]
    pub fn times(mut self, factor: f64) -> Self {
        self.information *= factor;
        self
    }

    /// Covariance of [`Intrinsics::parameters`]; `None` when a direction is open.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        covariance_of(&self.information)
    }

    /// How far another lens is from it, in standard deviations.
    fn distance(&self, other: &Intrinsics) -> f64 {
        let off = difference(other, &self.intrinsics);
        off.dot(&(&self.information * &off)).max(0.0).sqrt()
    }
}

/// The parameters of one lens less those of another of the same model.
pub fn difference(a: &Intrinsics, b: &Intrinsics) -> DVector<f64> {
    let (a, b) = (a.parameters(), b.parameters());
    DVector::from_iterator(a.len(), a.iter().zip(&b).map(|(a, b)| a - b))
}

/// A fit of one session and its information on the lens.
#[derive(Debug, Clone)]
pub struct Fitted<S> {
    pub fit: S,
    pub says: LensInformation,
}

/// The lens by all sessions but one; `None` when they leave it undetermined.
pub fn by_others<S>(sessions: &[Fitted<S>], one: usize) -> Option<LensEstimate> {
    LensEstimate::by(sessions.iter().enumerate().filter(|(j, _)| *j != one).map(|(_, other)| &other.says))
}

/// Rounds from fits of two or more sessions, each alone, until their joint lens converges; it is returned with the last fits.
/// `None` when the lens is undetermined or does not converge. `refit` makes a new fit of a session in a round (from 0) from its
/// last one, with the information of the others on the lens; it may decide again what belongs to the model in the first `deciding`
/// rounds.
///
/// # Errors
/// Those of `refit`.
#[expect(clippy::type_complexity, reason = "the last fits and their lens")]
pub fn share<S, E>(
    mut sessions: Vec<Fitted<S>>,
    deciding: usize,
    mut refit: impl FnMut(usize, usize, &S, LensEstimate) -> Result<Fitted<S>, E>,
) -> Result<Option<(Vec<Fitted<S>>, LensEstimate)>, E> {
    let mut last: Option<LensEstimate> = None;
    for round in 0..MAX_ROUNDS {
        let mut next = Vec::with_capacity(sessions.len());
        for (i, session) in sessions.iter().enumerate() {
            let Some(others) = by_others(&sessions, i) else { return Ok(None) };
            next.push(refit(i, round, &session.fit, others)?);
        }
        sessions = next;
        let Some(lens) = LensEstimate::by(sessions.iter().map(|session| &session.says)) else { return Ok(None) };
        let stands = last.is_some_and(|last| lens.distance(&last.intrinsics) < TOLERANCE);
        if stands && round >= deciding {
            return Ok(Some((sessions, lens)));
        }
        last = Some(lens);
    }
    Ok(None)
}

#[cfg(test)]
#[path = "shared_lens_tests.rs"]
mod tests;
