//! Commands and events of the calibration.

use std::sync::Arc;

use handeye_geometry::progress::Stage;
use serde::{Deserialize, Serialize};

use crate::solve::state::{JobId, Solved};
use crate::solve::tip_box::WorkBox;
use crate::text::Text;

/// What the user wants of the calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Solve again.
    Solve,
    /// Stop solving.
    Cancel,
    /// Which answer is requested, by its name.
    SetMethod(String),
    /// Whether views and corners that do not fit the others stay in the answer.
    SetKeepOutliers(bool),
    /// The box of the workspace over which the error is stated; `None` is that about the target.
    SetTipBox(Option<WorkBox>),
    /// The error that is good enough \[m\].
    SetGoal(f64),
    /// Where the line between good and bad residuals is \[px\]; `None` takes it away.
    SetOutlierLine(Option<f64>),
}

/// What has happened to the calibration.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// Progress of a solve.
    Progress {
        job: JobId,
        /// What it does.
        stage: Stage,
        /// How much of that is done, 0 to 1.
        part: f64,
    },
    /// A solve has ended.
    #[serde(skip)]
    Ended { job: JobId, outcome: SolveOutcome },
}

/// How a solve ended.
#[derive(Debug, Clone)]
pub enum SolveOutcome {
    /// With an answer.
    Solved(Arc<Solved>),
    /// Without one, and this is why.
    Failed(Text),
    /// It was cancelled.
    Cancelled,
}
