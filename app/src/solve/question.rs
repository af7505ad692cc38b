//! What a solve answers.

use handeye_core::project::session::{CaptureId, Role};

use crate::model::Goal;

/// What a calibration depends on. When it is another, there is something to solve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Question {
    pub meta: (
        handeye_core::estimate::handeye::Mode,
        handeye_core::targets::TargetSpec,
        Option<handeye_core::project::dataset::CameraInput>,
    ),
    pub captures: Vec<(CaptureId, Role, bool, bool)>,
    pub folder: Option<std::path::PathBuf>,
    pub method: String,
    pub keep_outliers: bool,
    pub goal: Goal,
}
