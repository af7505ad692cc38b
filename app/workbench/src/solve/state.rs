//! The calibration of the present set of captures.

use std::sync::Arc;

use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::diagnose::findings::Finding;
use handeye_estimate::diagnose::{Calibration, Promised};
use handeye_estimate::verify::{DepthReport, Predictor, Verification, VerifyError};
use handeye_geometry::progress::Stage;
use handeye_result::CalibrationResult;
use handeye_session::CaptureId;
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// Counts solves, to distinguish reports from those of earlier solves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct JobId(pub u64);

/// A finished solve.
#[derive(Debug, Clone)]
pub struct Solved {
    pub job: JobId,
    /// The captures, in the order of the views of `calibration` and of `result`.
    pub captures: Vec<CaptureId>,
    pub calibration: Calibration,
    /// The document that is exported and compared.
    pub result: CalibrationResult,
    /// What is needed for commands that are corrected for the errors of the arm; `None` where these are not known or not reliable.
    pub corrected: Option<Arc<Corrected>>,
    /// What is weak and what to do next.
    pub findings: Vec<Finding>,
    /// The calibration, for predicting and measuring; `None` without a hand-eye.
    pub calibrated: Option<Predictor>,
    /// How well it does on captures that never entered the fit; `None` while there are none.
    pub verification: Option<Result<Verification, VerifyError>>,
    /// What the depths of the captures show about a depth camera; `None` if they have none.
    pub depth: Option<DepthReport>,
    /// The captures of `verification` in its order.
    pub verified_captures: Vec<CaptureId>,
    /// How long it took \[s\].
    pub took_s: f64,
}

/// What is needed for commands that are corrected for the errors of the arm.
#[derive(Debug, Clone)]
pub struct Corrected {
    /// The arm with its errors.
    pub arm: Arc<CorrectedArm>,
    /// The calibration, for predicting and measuring with corrected tip poses.
    pub calibrated: Predictor,
    /// As [`Solved::verification`]; `None` also if the joints of a capture are not known.
    pub verification: Option<Verification>,
}

impl Solved {
    /// The verification with the tip poses that tools are commanded by: corrected ones, if these are expected to bring the tip
    /// nearer.
    pub fn verification_in_use(&self) -> Option<&Verification> {
        let corrected = self.corrected.as_ref().filter(|_| self.result.quality.correcting_helps());
        let corrected = corrected.and_then(|corrected| corrected.verification.as_ref());
        corrected.or_else(|| self.verification.as_ref()?.as_ref().ok())
    }

    /// The error that a goal \[m\] is compared with; `None` if none may be stated.
    pub fn promised(&self, goal_m: f64) -> Option<Promised> {
        let quality = &self.result.quality;
        let metres = |mm: Option<f64>| mm.map(|mm| mm * 1e-3);
        let reach = [quality.reach_error_95_mm, quality.reach_error_corrected_95_mm].map(metres);
        let promised = Promised::of(goal_m, reach[0], reach[1], metres(quality.tip_error_95_mm))?;
        Some(promised.by_accuracy(quality.robot_accuracy_mm.is_some()))
    }
}

/// What the solver does.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub enum SolveStatus {
    /// Nothing to do.
    #[default]
    Idle,
    /// It is running.
    Running {
        job: JobId,
        /// What it does.
        stage: Stage,
        /// How much of that is done, 0 to 1.
        part: f64,
        /// Since when.
        since_s: f64,
    },
    /// There is no answer for the present set, and this is why.
    Failed {
        /// What is missing and what to do.
        why: Text,
    },
    /// The user stopped it.
    Cancelled,
}

/// The solver and its newest answer.
#[derive(Debug, Clone, Default)]
pub struct SolveState {
    /// What it does.
    pub status: SolveStatus,
    /// The newest answer.
    pub solved: Option<Arc<Solved>>,
    /// Whether that answer is for the present set of captures.
    pub fresh: bool,
}

impl SolveState {
    /// The answer for the present set.
    pub fn current(&self) -> Option<&Arc<Solved>> {
        self.solved.as_ref().filter(|_| self.fresh)
    }

    /// Whether it is running.
    pub fn is_running(&self) -> bool {
        matches!(self.status, SolveStatus::Running { .. })
    }
}
