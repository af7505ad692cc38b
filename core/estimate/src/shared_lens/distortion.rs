//! Residual distortion of the lens of all sessions.

use nalgebra::DMatrix;

use super::{NamedSession, Refit, SharedLensError, fitted};
use crate::corners::Session;
use crate::handeye::joint::effects::Equations;
use crate::handeye::joint::residual_distortion::shared::{Share, lens_covariance, together, with_shared_error};
use crate::handeye::joint::residual_distortion::{DEGREES, corrected, settled};
use crate::handeye::joint::shared_lens::{self, Fitted, LensEstimate};
use crate::handeye::joint::{JointSolution, ShownDistortion};
use handeye_geometry::progress::Work;
use handeye_geometry::targets::observation::View;

/// Sessions with one lens, and with its residual distortion where they show one.
pub struct Together {
    pub sessions: Vec<Fitted<Refit>>,
    pub lens: LensEstimate,
    shown: Option<(ShownDistortion, Vec<Share>, Equations)>,
}

impl Together {
    /// From the sessions with their lens and no residual distortion.
    pub fn new(
        names: &[NamedSession<'_>],
        prepared: &[Session<'_>],
        sessions: Vec<Fitted<Refit>>,
        lens: LensEstimate,
        work: &Work<'_>,
    ) -> Result<Self, SharedLensError> {
        let plain: Vec<Vec<View>> = sessions.iter().map(|session| session.fit.refined.screened.views.clone()).collect();
        let [.., most] = DEGREES;
        let mut now = Self { sessions, lens, shown: None };
        let Some((_, all)) = now.equations(names, prepared, most, work)? else { return Ok(now) };
        let kept: Vec<View> = now.sessions.iter().flat_map(|it| it.fit.refined.screened.kept_views()).collect();
        let intrinsics = now.lens.intrinsics;
        let mut next = Self { sessions: now.sessions.clone(), lens: now.lens.clone(), shown: None };
        let mut last = None;
        let shown = settled(&intrinsics, &all, &kept, |field, degree| {
            for (session, plain) in next.sessions.iter_mut().zip(&plain) {
                session.fit.refined.screened.views = corrected(plain, field);
            }
            let refit = |i: usize, _round: usize, last: &Refit, others: LensEstimate| {
                again(&prepared[i], last, &others, work).map_err(|error| names[i].fails(error))
            };
            let shared = shared_lens::share(next.sessions.clone(), 0, refit)?;
            (next.sessions, next.lens) = shared.ok_or(SharedLensError::NoLens)?;
            let Some((shares, equations)) = next.equations(names, prepared, degree, work)? else { return Ok(None) };
            last = Some((shares, equations.clone()));
            Ok(Some(equations))
        })?;
        if let Some((shown, (shares, equations))) = shown.zip(last) {
            next.shown = Some((shown, shares, equations));
            now = next;
        }
        Ok(now)
    }

    /// Information of every session on the coefficients up to a degree, and of all together; `None` where they have
    /// none.
    fn equations(
        &self,
        names: &[NamedSession<'_>],
        prepared: &[Session<'_>],
        degree: usize,
        work: &Work<'_>,
    ) -> Result<Option<(Vec<Share>, Equations)>, SharedLensError> {
        let mut shares = Vec::with_capacity(self.sessions.len());
        for (i, Fitted { fit: Refit { refined, factor }, .. }) in self.sessions.iter().enumerate() {
            let Some(others) = shared_lens::by_others(&self.sessions, i) else { return Ok(None) };
            let (from, others) = (prepared[i].fitted(refined), others.times(*factor));
            let problem = prepared[i].problem(refined, &from, Some(others.as_prior()));
            let share = Share::new(&problem, &refined.screened.solution, degree, *factor, work.cancel);
            let Some(share) = share.map_err(|error| names[i].fails(error))? else { return Ok(None) };
            shares.push(share);
        }
        let together = together(&shares, &self.lens);
        Ok(together.map(|together| (shares, together)))
    }

    /// The residual distortion of the lens.
    pub fn shown(&self) -> Option<&ShownDistortion> {
        self.shown.as_ref().map(|(shown, _, _)| shown)
    }

    /// Covariance of the lens; `None` where a direction is open.
    pub fn lens_covariance(&self) -> Option<DMatrix<f64>> {
        match &self.shown {
            Some((shown, shares, equations)) => lens_covariance(&self.lens, shares, equations, shown),
            None => self.lens.covariance(),
        }
    }

    /// A solution of session `i` with the uncertainty of the residual distortion.
    pub fn with_error(&self, i: usize, solution: JointSolution) -> JointSolution {
        match &self.shown {
            Some((shown, shares, equations)) => with_shared_error(solution, shares, i, equations, shown),
            None => solution,
        }
    }
}

/// A session fitted again with the information of the others on the lens, with the same views, unknowns and widening.
pub fn again(
    prepared: &Session<'_>,
    last: &Refit,
    others: &LensEstimate,
    work: &Work<'_>,
) -> Result<Fitted<Refit>, crate::CalibrateError> {
    let others = others.clone().times(last.factor);
    let from = prepared.fitted(&last.refined);
    let problem = prepared.problem(&last.refined, &from, Some(others.as_prior()));
    fitted(prepared, last.refined.again(&problem, work)?, Some(others.as_prior()), Some(last.factor), work)
}
