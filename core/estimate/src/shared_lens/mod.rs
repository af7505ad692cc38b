//! Several sessions of one camera, calibrated together with one lens.
//!
//! # What it estimates
//! The lens that all sessions share, and for each what [`fit`](super::fit) estimates in addition: both links, the
//! corrections of its robot poses, its noise levels, and where its data show them a bent target and the robot's field. The
//! result is the optimum of all sessions together, found in rounds over the sessions (`handeye/joint/shared_lens.rs`).
//!
//! A session counts for less in proportion to its own [`overdispersion`].
//!
//! # Needs
//! Two sessions or more, each enough for a calibration of its own with an estimated lens, of one image size and lens model.
//! Mode and target may differ. Focus, zoom and resolution of the camera must be the same in all of them: [`agreement`]
//! tests that.
//!
//! Source: `docs/maths/shared_intrinsics.md`.

mod agreement;
mod distortion;
pub(crate) mod found;

use nalgebra::DVector;

use super::corners::{Prepared, Session};
use super::refine::Refined;
use super::uncertainty::overdispersion;
use super::{CalibrateError, CameraKnowledge, Fit, Observations, Options};
use crate::handeye::HandEyeError;
use crate::handeye::joint::print_errors;
use crate::handeye::joint::shared_lens::{self, Fitted, LensEstimate, LensInformation};
use crate::handeye::joint::{JointSolution, LensPrior};
use crate::stated_uncertainty::Alternative;
use handeye_geometry::progress::Work;
use handeye_geometry::se3;

pub use found::{OddSession, SharedLens};

use distortion::Together;

/// Rounds in which outliers, the shape of the target, the robot's field and the widening are decided again: in the first the
/// lens is near its end, and the second decides with it.
const DECIDING: usize = 2;

/// Why sessions are not calibrated together.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SharedLensError {
    /// There is nothing to share.
    #[error("{sessions} session: a lens is shared by two or more; calibrate one by itself")]
    TooFewSessions {
        /// Number of sessions.
        sessions: usize,
    },
    /// The camera of a session is known.
    #[error(
        "the camera of {session} is given as fixed, so there is no lens to estimate with the others: let it be estimated \
         (`fixed = false` in its [camera]), or calibrate that session by itself"
    )]
    FixedLens {
        /// Name of the session.
        session: String,
    },
    /// Images of unequal size.
    #[error(
        "images of {session} have {}×{} pixels and those of {first} {}×{}: sessions of one lens have images of one size; \
         calibrate those of each size together", size.0, size.1, first_size.0, first_size.1
    )]
    ImageSize {
        /// Name of the session.
        session: String,
        /// Size of its images.
        size: (u32, u32),
        /// The session it is compared with.
        first: String,
        /// Size of its images.
        first_size: (u32, u32),
    },
    /// Unequal lens models.
    #[error(
        "the lens of {session} is {model} and that of {first} {first_model}: write the same `model` into the [camera] of \
         all sessions"
    )]
    LensModel {
        /// Name of the session.
        session: String,
        /// Its model.
        model: &'static str,
        /// The session it is compared with.
        first: String,
        /// The lens model of the first session.
        first_model: &'static str,
    },
    /// No hand-eye transform to estimate.
    #[error(
        "{session} has no robot poses: sessions share their lens in a hand-eye calibration, a camera alone does not"
    )]
    NoRobot {
        /// Name of the session.
        session: String,
    },
    /// Poses of the target without corners.
    #[error("{session} has poses of the target and no corners, which say nothing of the lens: leave it out")]
    NoCorners {
        /// Name of the session.
        session: String,
    },
    /// One session cannot be calibrated.
    #[error("{session}: {error}")]
    Session {
        /// Name of the session.
        session: String,
        /// Why.
        error: CalibrateError,
    },
    /// The sessions together do not converge to one lens.
    #[error(
        "the sessions together do not come to one lens: calibrate them one by one, compare their lenses, and leave out those \
         whose lens is another one or hardly known"
    )]
    NoLens,
}

impl SharedLensError {
    /// Whether the work was cancelled.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Session { error: CalibrateError::HandEye(HandEyeError::Cancelled), .. })
    }

    /// Whether the sessions by their descriptions do not go together, independent of the views.
    pub fn is_usage(&self) -> bool {
        !matches!(self, Self::Session { .. } | Self::NoLens)
    }
}

/// A session by its name in messages.
#[derive(Debug, Clone, Copy)]
pub struct NamedSession<'a> {
    /// Name of the session, for messages.
    pub name: &'a str,
    /// What was observed.
    pub observations: &'a Observations,
}

/// Calibrates sessions of one camera together; one calibration for each, in their order, all with the same lens. `work` is
/// a `&CancelToken`, or a [`Work`].
///
/// # Errors
/// [`SharedLensError`] says which session and what to do.
pub fn calibrate_sharing_lens<'a>(
    sessions: &[NamedSession<'_>],
    options: Options,
    work: impl Into<Work<'a>>,
) -> Result<Vec<Fit>, SharedLensError> {
    let work = &work.into();
    check(sessions)?;
    let mut prepared = Vec::with_capacity(sessions.len());
    for session in sessions {
        match Prepared::new(session.observations, options, work).map_err(|error| session.fails(error))? {
            Prepared::HandEye(it) => prepared.push(*it),
            Prepared::Camera(_) => return Err(SharedLensError::NoRobot { session: session.name.to_owned() }),
        }
    }
    let mut alone = Vec::with_capacity(sessions.len());
    for (session, prepared) in sessions.iter().zip(&prepared) {
        let refined = prepared.alone(None, options, work).map_err(|error| session.fails(error))?;
        alone.push(fitted(prepared, refined, None, None, work).map_err(|error| session.fails(error))?);
    }
    let agreement = agreement::test(sessions, &alone).ok_or(SharedLensError::NoLens)?;
    let refit = |i: usize, round: usize, last: &Refit, others: LensEstimate| {
        let (session, prepared) = (&sessions[i], &prepared[i]);
        let again = || -> Result<Fitted<Refit>, CalibrateError> {
            let others = others.clone().times(last.factor);
            let refined = prepared.refine(Some(others.as_prior()), options, work)?;
            fitted(prepared, refined, Some(others.as_prior()), None, work)
        };
        let next = if round < DECIDING { again() } else { distortion::again(prepared, last, &others, work) };
        next.map_err(|error| session.fails(error))
    };
    let shared = shared_lens::share(alone.clone(), DECIDING, refit)?;
    let (shared, lens) = shared.ok_or(SharedLensError::NoLens)?;
    let together = Together::new(sessions, &prepared, shared, lens, work)?;
    let (shared, lens) = (&together.sessions, &together.lens);
    let sigma = together.lens_covariance().map(|covariance| covariance.diagonal().map(|v| v.max(0.0).sqrt()));
    let views = shared.iter().map(|session| session.fit.refined.screened.kept.len()).sum();
    let mut calibrations = Vec::with_capacity(sessions.len());
    for (i, prepared) in prepared.into_iter().enumerate() {
        let Refit { mut refined, factor } = shared[i].fit.clone();
        let others = shared_lens::by_others(shared, i).ok_or(SharedLensError::NoLens)?.times(factor);
        let from = prepared.fitted(&refined);
        let problem = prepared.problem(&refined, &from, Some(others.as_prior()));
        refined = refined.stated(&problem, work).map_err(|error| sessions[i].fails(error))?;
        refined.screened.solution = together.with_error(i, refined.screened.solution);
        refined.distortion = together.shown().cloned();
        // Rounds end with every session within some thousandths of a standard deviation of it.
        refined.screened.solution.intrinsics = lens.intrinsics;
        let solution = refined.screened.solution.clone();
        let finished = prepared.finish(refined, Some(others.as_prior()), work);
        let mut calibration = finished.map_err(|error| sessions[i].fails(error))?;
        if let Some(camera) = &mut calibration.camera {
            camera.sigma_px = sigma.as_ref().and_then(four);
        }
        calibration.shared_lens = Some(SharedLens {
            sessions: sessions.len(),
            views,
            p_value: agreement.p_value,
            odd: agreement.odd.clone(),
            with_own_lens: with_own_lens(&solution, &alone[i].fit),
        });
        calibrations.push(calibration);
    }
    Ok(calibrations)
}

/// One session's estimate in the rounds.
#[derive(Clone)]
struct Refit {
    refined: Refined,
    /// Factor by which its variances have to be multiplied, see [`widening`].
    factor: f64,
}

impl NamedSession<'_> {
    fn fails(&self, error: impl Into<CalibrateError>) -> SharedLensError {
        SharedLensError::Session { session: self.name.to_owned(), error: error.into() }
    }
}

/// An estimate with its information on the lens; `factor` is the widening where it is known.
fn fitted(
    session: &Session<'_>,
    refined: Refined,
    prior: Option<LensPrior<'_>>,
    factor: Option<f64>,
    work: &Work<'_>,
) -> Result<Fitted<Refit>, CalibrateError> {
    let from = session.fitted(&refined);
    let problem = session.problem(&refined, &from, prior);
    let solution = &refined.screened.solution;
    let factor = if let Some(factor) = factor {
        factor
    } else {
        let widening = overdispersion::check(&problem, solution, refined.shown(), work.cancel)?;
        // By chance the ratio is above one in half of all sessions, and a session does not weigh less for that.
        widening.factor * if widening.lens_is_refuted() { widening.lens } else { 1.0 }
    };
    // A residual distortion makes the lens more uncertain than the curvature of the cost shows.
    let stated = refined.distortion.as_ref().and_then(|_| LensInformation::stated(solution));
    let says = if let Some(stated) = stated {
        stated
    } else {
        let says = LensInformation::of(&problem, solution, work.cancel)?;
        let print = refined.print.as_ref();
        let unknown =
            print.map(|print| print_errors::lens_unknown(&problem, solution, print, work.cancel)).transpose()?;
        unknown.flatten().and_then(|unknown| says.clone().less(&unknown)).unwrap_or(says)
    };
    let says = says.widened(factor);
    Ok(Fitted { fit: Refit { refined, factor }, says })
}

fn with_own_lens(shared: &JointSolution, alone: &Refit) -> Alternative {
    let own = &alone.refined.screened.solution;
    let (from, to) = (shared.hand_eye.mount_from_camera(), own.hand_eye.mount_from_camera());
    Alternative {
        shift: se3::log((from.inverse() * to).isometry()),
        covariance: own.hand_eye_covariance() * alone.factor,
    }
}

/// Standard deviations of fx, fy, cx, cy.
fn four(sigma: &DVector<f64>) -> Option<[f64; 4]> {
    sigma.as_slice().first_chunk::<4>().copied()
}

/// Whether the sessions may have one lens at all.
fn check(sessions: &[NamedSession<'_>]) -> Result<(), SharedLensError> {
    let [first, _, ..] = sessions else {
        return Err(SharedLensError::TooFewSessions { sessions: sessions.len() });
    };
    for NamedSession { name, observations } in sessions {
        let session = || (*name).to_owned();
        if observations.mode.is_none() {
            return Err(SharedLensError::NoRobot { session: session() });
        }
        if observations.views.iter().all(|view| view.corners.is_none()) {
            return Err(SharedLensError::NoCorners { session: session() });
        }
        let CameraKnowledge::Estimate { model, .. } = observations.camera else {
            return Err(SharedLensError::FixedLens { session: session() });
        };
        let (size, first_size) = (observations.image_size, first.observations.image_size);
        if size != first_size {
            let first = first.name.to_owned();
            return Err(SharedLensError::ImageSize { session: session(), size, first, first_size });
        }
        if let CameraKnowledge::Estimate { model: of_first, .. } = first.observations.camera
            && of_first.name() != model.name()
        {
            let (model, first_model) = (model.name(), of_first.name());
            let first = first.name.to_owned();
            return Err(SharedLensError::LensModel { session: session(), model, first, first_model });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
