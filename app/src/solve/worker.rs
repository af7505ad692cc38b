//! The solver: calibrates the newest set of captures, and checks the answer on the captures that never entered it.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use handeye_core::diagnose::doctor;
use handeye_core::diagnose::findings::{Finding, FindingOptions};
use handeye_core::estimate::handeye::HandEyeError;
use handeye_core::estimate::{self, CalibrateError, Calibration, Method, Observations, Options};
use handeye_core::progress::{CancelToken, Progress, Work};
use handeye_core::project::result::{VerificationSummary, solve_options};
use handeye_core::project::session::CaptureId;
use handeye_core::targets::observation::View;
use handeye_core::verify::{self, CheckCapture, Predictor, Verification, VerifyError};

use crate::command::{Event, SolveOutcome};
use crate::model::{JobId, Solved, Truth};
use crate::text;
use crate::text::Text;
use crate::truth;
use crate::worker::link::Outlet;

/// Progress is told when it has come so much further: a window that is drawn for every step would slow the solve down.
const PROGRESS_STEP: f64 = 0.05;

/// A set of captures to calibrate.
pub struct SolveJob {
    /// Its number.
    pub id: JobId,
    /// What was observed; captures that are left out are among the views.
    pub observations: Observations,
    /// The captures of the views.
    pub captures: Vec<CaptureId>,
    /// What was observed in captures that never enter the fit.
    pub verification: Vec<(CaptureId, View)>,
    /// Which answer is asked for.
    pub method: Method,
    /// What is changed about it.
    pub options: Options,
    /// The error \[m\] that is good enough.
    pub goal_m: f64,
    /// For comparison with the answer, when that is there.
    pub truth: Option<Truth>,
}

/// Solves a job and reports how that went.
pub fn solve(job: &SolveJob, cancel: &CancelToken, outlet: &Outlet) {
    let id = job.id;
    let began_s = outlet.now_s();
    let told = Cell::new(None::<Progress>);
    let progress = |now: Progress| {
        let tell = told.get().is_none_or(|before| {
            before.stage != now.stage || (now.fraction() - before.fraction()).abs() >= PROGRESS_STEP
        });
        if tell {
            told.set(Some(now));
            outlet.report(Event::SolveProgress { job: id, stage: now.stage, part: now.fraction() });
        }
    };
    let work = Work { cancel, progress: &progress };
    // A defect in a solver must not take the captures with it.
    let solved = catch_unwind(AssertUnwindSafe(|| answer(job, work)));
    let outcome = match solved {
        Ok(Ok(solved)) => SolveOutcome::Solved(Arc::new(Solved { took_s: outlet.now_s() - began_s, ..solved })),
        Ok(Err(CalibrateError::HandEye(HandEyeError::Cancelled))) => SolveOutcome::Cancelled,
        Ok(Err(error)) => SolveOutcome::Failed(Text::verbatim(error.to_string())),
        Err(_panic) => SolveOutcome::Failed(text!(
            "The solver broke down on this set. The captures are safe. Please report it with the session folder"
        )),
    };
    outlet.report(Event::SolveEnded { job: id, outcome });
}

/// The calibration of a job with all that is said about it: one path for the window and the command line.
///
/// # Errors
/// [`CalibrateError`].
pub fn answer(job: &SolveJob, work: Work<'_>) -> Result<Solved, CalibrateError> {
    let calibration = estimate::calibrate_with(&job.observations, job.method, job.options, work)?;
    examined(job, calibration, work)
}

/// All that is said about the calibration of a job.
///
/// # Errors
/// When the work was cancelled.
pub fn examined(job: &SolveJob, mut calibration: Calibration, work: Work<'_>) -> Result<Solved, CalibrateError> {
    let goal = FindingOptions::with_goal_mm(Some(job.goal_m * 1e3));
    let findings = doctor::diagnose(&job.observations, Some(&mut calibration), &goal, work.cancel).findings;
    let options = solve_options(job.method, job.options, &job.observations.target);
    let mut result = calibration.to_result(env!("CARGO_PKG_VERSION"), None, options);
    if let Some(truth) = &job.truth {
        result.truth = truth::comparison(&result, &truth.tip_from_camera, &truth.intrinsics);
    }
    result.findings = findings.iter().map(Finding::to_record).collect();
    let calibrated = Predictor::new(&calibration).ok();
    let verification = calibrated.as_ref().filter(|_| !job.verification.is_empty()).map(|calibrated| {
        let captures: Vec<CheckCapture<'_>> =
            job.verification.iter().map(|(_, view)| CheckCapture { view, depth: None, far_m: f32::INFINITY }).collect();
        verify::verify(calibrated, &job.observations.target, &captures, work)
    });
    if let Some(Err(VerifyError::Cancelled)) = verification {
        return Err(CalibrateError::HandEye(HandEyeError::Cancelled));
    }
    result.verification = verification.as_ref().and_then(|outcome| outcome.as_ref().ok()).map(summary);
    Ok(Solved {
        job: job.id,
        captures: job.captures.clone(),
        result,
        findings,
        calibrated,
        verification,
        verified_captures: job.verification.iter().map(|(id, _)| *id).collect(),
        calibration,
        took_s: 0.0,
    })
}

fn summary(verification: &Verification) -> VerificationSummary {
    VerificationSummary {
        captures: verification.captures.len(),
        rms_px: verification.rms_px,
        centre_rms_mm: verification.centre_rms_m * 1e3,
        orientation_rms_deg: verification.orientation_rms_rad.to_degrees(),
        as_stated: verification.is_as_stated(),
    }
}
