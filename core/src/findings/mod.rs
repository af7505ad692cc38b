//! What is wrong or weak in a set of views and its calibration, and what to do next.
//!
//! A finding is data first: a code, a severity, numbers with units and the views concerned; as text it says what it is,
//! by which evidence, and what to do. Residuals say how well the model fits, and are never given as accuracy; where a
//! finding speaks of the expected error it is the one stated by the covariance.
//!
//! Before a calibration only the views themselves are judged; with one, also the answer.

mod answer;
mod views;

use std::fmt;

use serde::Serialize;

use crate::calibrate::{Calibration, Observations};

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum FindingCode {
    /// Fewer views than a calibration takes, or than a good one does.
    TooFewViews,
    /// The target was not found in some views.
    TargetNotFound,
    /// The robot hardly turned between the views.
    ViewsAlike,
    /// All turns are about one axis.
    OneRotationAxis,
    /// Turns about the other axes are small.
    WeakRotation,
    /// The board is hardly tilted, which leaves the focal length weak.
    LittleTilt,
    /// Part of the image was never covered.
    PoorCoverage,
    /// One view moves the answer a lot.
    InfluentialView,
    /// One view fits much worse than the others.
    LargeResidual,
    /// The robot pose of one view was corrected much more than those of the others.
    LargeCorrection,
    /// Views outside the fit are predicted worse than the noise levels explain.
    PoorPrediction,
    /// The robot's noise, not the corners', limits the answer.
    RobotNoise,
    /// The closed forms do not agree.
    ClosedFormsDisagree,
    /// The expected error is below the goal.
    GoalReached,
    /// The expected error is above the goal.
    GoalNotReached,
}

/// How much it matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know.
    Info,
    /// Following it makes the answer better.
    Advice,
    /// The answer may be much worse than it could be.
    Warning,
    /// There is no answer, or it is not to be used.
    Problem,
}

/// One number that supports a finding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Evidence {
    /// What it is.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its unit; empty for a count or a ratio.
    pub unit: &'static str,
}

/// What was found, by which evidence. As text it is a sentence or two with what to do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// What.
    pub code: FindingCode,
    /// How much it matters.
    pub severity: Severity,
    /// The numbers behind it.
    pub evidence: Vec<Evidence>,
    /// The views concerned, by name; empty when it concerns the whole set.
    pub views: Vec<String>,
    /// The finding in words.
    pub text: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Finding {
    fn new(code: FindingCode, severity: Severity, text: String) -> Self {
        Self { code, severity, evidence: Vec::new(), views: Vec::new(), text }
    }

    fn with(mut self, name: &'static str, value: f64, unit: &'static str) -> Self {
        self.evidence.push(Evidence { name, value, unit });
        self
    }

    fn of_view(mut self, name: &str) -> Self {
        self.views.push(name.to_owned());
        self
    }

    /// The value of the evidence of that name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.evidence.iter().find(|e| e.name == name).map(|e| e.value)
    }
}

/// What the user wants.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FindingOptions {
    /// The expected error to reach (95 %, see [`Calibration::tip_error_95_m`]), millimetres; `None` for no goal.
    pub goal_mm: Option<f64>,
}

/// Everything found, the most severe first, in the order of [`FindingCode`] within a severity. Views out of the fit
/// count for nothing.
///
/// `calibration` is that of these observations; findings on the answer need it.
pub fn findings(
    observations: &Observations,
    calibration: Option<&Calibration>,
    options: &FindingOptions,
) -> Vec<Finding> {
    let mut found = views::findings(observations, calibration);
    if let Some(calibration) = calibration {
        found.extend(answer::findings(calibration, options));
    }
    found.sort_by(|a, b| b.severity.cmp(&a.severity).then(a.code.cmp(&b.code)));
    found
}

/// The names of views for a sentence: all of a few, else the first and how many more.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 4;
    if names.len() <= SHOWN {
        return names.join(", ");
    }
    format!("{} and {} more", names[..SHOWN].join(", "), names.len() - SHOWN)
}

/// `s` unless there is one.
fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

#[cfg(test)]
mod tests;
