//! Following long work from another thread, and cancelling it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

/// A flag that long work polls; clones share it.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// Requests the work to end.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether that was requested.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What a calibration is doing, in the order in which it does it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Stage {
    /// The camera from the corners alone, as one step.
    Intrinsics,
    /// The target's pose in every view; counts views.
    TargetPoses,
    /// The closed forms; counts methods.
    ClosedForms,
    /// The joint estimate; counts rounds of weights and optimum, seldom all of them are needed.
    Joint,
    /// Fits that leave views out; counts folds.
    HeldOut,
    /// The expected error by number of views; counts views.
    Prediction,
    /// Captures that were never in the fit; counts captures.
    Verification,
}

impl Stage {
    /// What is being done, for a line of status.
    pub fn label(self) -> &'static str {
        match self {
            Self::Intrinsics => "calibrating the camera",
            Self::TargetPoses => "locating the target",
            Self::ClosedForms => "solving the closed forms",
            Self::Joint => "estimating jointly",
            Self::HeldOut => "predicting held-out views",
            Self::Prediction => "predicting the error by number of views",
            Self::Verification => "verifying captures",
        }
    }
}

/// Progress of long work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// The present stage.
    pub stage: Stage,
    /// How much of this stage is done.
    pub done: usize,
    /// The total of this stage; at least 1. A stage may end before `done` reaches it.
    pub of: usize,
}

impl Progress {
    /// Fraction of the stage that is done, 0 to 1.
    pub fn fraction(&self) -> f64 {
        self.done.min(self.of) as f64 / self.of.max(1) as f64
    }
}

/// What long work gets in addition to its input: a flag to poll, and a callback for its progress. Where no progress is
/// wanted a `&CancelToken` is enough.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    /// Polled at least every few milliseconds of our own loops; a call into OpenCV is not interrupted.
    pub cancel: &'a CancelToken,
    /// Called often on the working thread; it must return at once.
    pub progress: &'a dyn Fn(Progress),
}

impl<'a> From<&'a CancelToken> for Work<'a> {
    fn from(cancel: &'a CancelToken) -> Self {
        Self { cancel, progress: &|_unheard| {} }
    }
}

impl Work<'_> {
    /// Reports progress; also at the start of a stage, with nothing done.
    pub fn report(&self, stage: Stage, done: usize, of: usize) {
        (self.progress)(Progress { stage, done, of: of.max(1) });
    }

    /// Whether the work was requested to end.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_cancelled()
    }
}
