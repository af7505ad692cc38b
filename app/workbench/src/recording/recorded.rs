//! What of the model has been recorded.

use std::sync::Arc;

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_plan::Surroundings;
use handeye_session::CaptureId;

use crate::shell::state::Step;

/// What of the model was noted already.
#[derive(Debug, Default)]
pub(crate) struct Recorded {
    pub step: Option<Step>,
    pub selection: Vec<CaptureId>,
    pub planned: Vec<Pose<Base, Tip>>,
    /// The obstacles that the cell reports, and what the user keeps the arm out of.
    pub around: Option<[Arc<Surroundings>; 2]>,
    /// Messages with smaller numbers.
    pub reported: u64,
}
