//! What is wrong or weak in a set of views and its calibration, and what to do next.
//!
//! A finding is data first: a code, a severity, numbers with units and the views concerned; as text, in any language, it
//! states what it is, by which evidence, and what to do. Residuals show how well the model fits, and are never given as
//! accuracy; where a finding speaks of the expected error it is the one stated by the covariance.
//!
//! Before a calibration only the views themselves are judged; with one, also the answer.

mod answer;
mod depth;
mod direction;
pub(crate) mod finding;
mod given_lens;
pub(crate) mod outliers;
mod shared_lens;
mod views;

pub use depth::finding as depth_finding;
pub(crate) use finding::listed;
pub use finding::{Evidence, Finding, FindingCode, Severity};
pub use outliers::WIDENING_WORTH_SAYING;

use crate::Observations;
use crate::diagnose::Calibration;
use crate::placement::ArmOfViews;
use crate::robot_accuracy::RobotAccuracy;

/// What the user wants, and has.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct FindingOptions<'a> {
    /// The expected error to reach (95 %, see [`Calibration::promised`]), millimetres; `None` for no goal.
    pub goal_mm: Option<f64>,
    /// The arm, its tool and its joints in the views; `None` where its chain is not known.
    pub arm: Option<&'a ArmOfViews>,
    /// How accurate the robot is, and its tool: counts where its chain is not known.
    pub robot_accuracy: Option<RobotAccuracy>,
}

impl<'a> FindingOptions<'a> {
    /// With an error to reach (95 %), millimetres; `None` for no goal.
    pub const fn with_goal_mm(goal_mm: Option<f64>) -> Self {
        Self { goal_mm, arm: None, robot_accuracy: None }
    }

    /// With the arm of the views of the calibration, for the errors that a tool arrives within.
    #[must_use]
    pub const fn with_arm(self, arm: Option<&'a ArmOfViews>) -> Self {
        Self { arm, ..self }
    }

    /// With the accuracy of the robot, for the error that a tool arrives within where its chain is not known.
    #[must_use]
    pub const fn with_robot_accuracy(self, robot_accuracy: Option<RobotAccuracy>) -> Self {
        Self { robot_accuracy, ..self }
    }
}

/// Everything found, the most severe first, in the order of [`FindingCode`] within a severity. Views out of the fit
/// count for nothing.
///
/// `calibration` is that of these observations; findings on the answer need it.
pub fn findings(
    observations: &Observations,
    calibration: Option<&Calibration>,
    options: &FindingOptions<'_>,
) -> Vec<Finding> {
    let mut found = views::findings(observations, calibration);
    if let Some(calibration) = calibration {
        found.extend(answer::findings(calibration, options));
        found.extend(direction::finding(calibration));
        found.extend(given_lens::findings(calibration));
        found.extend(shared_lens::finding(calibration));
        found.extend(crate::diagnose::findings::outliers::findings(calibration));
    }
    sort(&mut found);
    found
}

/// The most severe first, in the order of the codes within a severity.
pub fn sort(found: &mut [Finding]) {
    found.sort_by(|a, b| b.severity.cmp(&a.severity).then(a.code.cmp(&b.code)));
}

#[cfg(test)]
mod tests;
